"""Edits of a scene: what they change, and that they leave the rest alone."""

from __future__ import annotations

import numpy as np
import pytest

from formats import scene as scenes
from formats.keyed import Keyed
from runtime.edits import Edits, LightEdit, knobs

RAW = {
    "format": 1,
    "camera": {"position": [0, 1, 4], "target": [0, 0, 0]},
    "lights": [
        {"type": "sun", "to_light": [0, 0, 2], "irradiance": [3, 2, 1]},
        {"type": "environment", "source": "environments/sky.exr", "scale": 0.5, "rotate": 170},
        {
            "type": "polygon",
            "outline": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
            "radiance": {"times": [0, 1], "values": [[1, 1, 1], [3, 3, 3]]},
        },
    ],
    "picture": {
        "bloom": {"strength": {"times": [0, 1], "values": [0.1, 0.9]}},
        "film": {"vignette": 0.2},
    },
}


@pytest.fixture
def scene():
    return scenes.from_dict(RAW, where="made.toml", root=None)


def test_no_edits_leave_everything_as_it_is(scene):
    same = Edits().of(scene)
    assert same.picture is scene.picture
    assert all(a is b for a, b in zip(same.lights, scene.lights, strict=True))


def test_a_sun_turns_and_takes_a_colour(scene):
    edit = LightEdit(factor=2.0, tint=(1.0, 0.5, 1.0), turn=(np.pi / 2, np.pi / 6))
    sun = Edits().light(0, edit).of(scene).lights[0]
    np.testing.assert_allclose(sun.irradiance.at(0.0), [6, 2, 2])
    half = np.sqrt(3) / 2
    np.testing.assert_allclose(sun.direction(0.0), [half, 0.5, 0.0], atol=1e-12)


def test_an_environment_turns_round_and_goes_out(scene):
    found = Edits().light(1, LightEdit(turn=(np.radians(20.0), 0.0))).of(scene).lights[1]
    assert found.rotate == pytest.approx(-170.0)
    np.testing.assert_allclose(found.factor(0.0), 0.5)
    out = Edits().light(1, LightEdit(on=False)).of(scene).lights[1]
    np.testing.assert_array_equal(out.factor(0.0), 0.0)


def test_a_polygon_moves_by_its_offset_and_keeps_its_keys(scene):
    found = Edits().light(2, LightEdit(factor=0.5, move=(1.0, 2.0, 3.0))).of(scene).lights[2]
    np.testing.assert_allclose(found.corners(0.0)[0], [1, 2, 3])
    np.testing.assert_allclose(found.radiance.at(0.5), [1, 1, 1])


def test_an_edit_that_changes_nothing_is_none():
    edits = Edits().light(0, LightEdit(factor=2.0)).value("film.vignette", 0.5)
    assert edits.light(0, LightEdit()).value("film.vignette", None) == Edits()
    assert Edits().show("mesh/a", False).show("mesh/a", True) == Edits()
    assert Edits().effect(("fog", "bloom"), False).effect(("bloom",), True).off == {"fog"}


def test_values_go_where_they_stand_and_nowhere_else(scene):
    edits = Edits().value("film.vignette", 0.7).value("fog.extinction", Keyed.hold(1.0))
    found = edits.of(scene).picture
    assert found.film.vignette == 0.7
    # A scene without fog has none to change
    assert found.fog is None
    assert found.bloom is scene.picture.bloom


def test_knobs_list_what_the_file_may_say_and_shift_what_moves(scene):
    found = knobs(scene.picture, 0.5)
    assert list(found) == ["bloom", "film"]
    assert [knob.label for knob in found["film"]] == ["exposure", "tonemap", "vignette", "grain"]
    strength = found["bloom"][0]
    assert strength.value == pytest.approx(0.5)
    moved = strength.set(0.8)
    # Shifted by 0.3 and kept within 0..1
    assert [moved.at(t) for t in (0.0, 1.0)] == pytest.approx([0.4, 1.0])
    assert found["film"][0].set(1.5).at(9.0) == 1.5
    assert found["film"][2].set(0.1) == 0.1
