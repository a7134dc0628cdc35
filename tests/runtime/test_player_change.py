"""A scene that is changed while it plays, against the same scene made that way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from formats.keyed import Keyed
from formats.mesh import Material
from runtime.edits import Edits, LightEdit, knobs
from runtime.player import Player
from runtime.switches import switched, switches
from tests.runtime.shadow_truth import ball_volume, small_box

pytestmark = pytest.mark.gpu
SIZE = (64, 40)
CAMERA = {"position": [0.5, 1.6, 5.0], "target": [0.3, 0.6, 0], "focal_length_mm": 30}
LENS = {"f_number": 0.2, "focus_distance": 1.0}
LIGHTS = [
    {"type": "sun", "to_light": [-0.3, 0.2, -1.0], "irradiance": [3, 2, 1]},
    {"type": "sphere", "position": [1.5, 1.5, 1], "radius": 0.4, "radiance": [2, 4, 12]},
]
BALL = {"name": "ball", "source": "meshes/ball.glb", "height": 1.0, "positions": [[1.4, 0, 0]]}
BOX = {"name": "box", "source": "meshes/box.glb", "position": [-0.4, 0.9, 0], "shadow": {}}
PICTURE = {
    "sky": {"zenith": [0.1, 0.2, 0.4], "horizon": [0.5, 0.4, 0.3], "glow": [0.2, 0.1, 0.0]},
    "fog": {"extinction": 0.05, "radiance": [0.2, 0.3, 0.4], "falloff": 0.1},
    "radial_blur": {"strength": 0.4},
    "bloom": {"strength": 0.6, "threshold": 0.1},
    "film": {"exposure": 0.2, "vignette": 0.3},
}
CODE = 1
"""The same numbers in another order of operations, rounded to 8 bits: one code."""


@pytest.fixture
def played(kit, write_scene, ctx):
    """Return played(called_without, raw parts) -> a player."""
    made = []

    def play(*off, camera=None, **parts):
        parts = {"meshes": [BOX], "billboards": [BALL], "lights": LIGHTS, **parts}
        camera = {**CAMERA, "lens": LENS} if camera is None else camera
        raw = kit.scene_dict(
            **{"camera": camera, "picture": PICTURE, "ground": {"albedo": [0.3, 0.3, 0.3]}, **parts}
        )
        assets = {"ball": kit.sphere_asset()} if raw.get("billboards") else {}
        if raw.get("meshes"):
            assets["box"] = kit.quad(Material("grey", (0.5, 0.4, 0.3)), half=0.5)
            if "shadow" in raw["meshes"][0]:
                assets["shadow-box"] = ball_volume(small_box())
        called = tuple(name for name in kit.called_for(raw) if name not in off)
        folder = write_scene(raw, assets, called=called, name=f"scene{len(made)}")
        made.append(Player(folder, size=SIZE, context=ctx))
        return made[-1]

    yield play
    for player in made:
        player.close()


def shown(player, edits):
    base = player.scene
    player.change(edits.of(base), hidden=edits.hidden, off=edits.off)
    found = player.frame(0.0).astype(int)
    player.change(base, hidden=(), off=())
    return found


def apart(a, b):
    return np.abs(a - b).max()


def test_every_knob_changes_the_picture_and_comes_back(played):
    player = played()
    before = player.frame(0.0).astype(int)
    for table, found in knobs(player.scene.picture, 0.0).items():
        for knob in found:
            if knob.spec.kind == "text":
                value = next(choice for choice in knob.spec.choices if choice != knob.value)
            elif np.size(knob.value) > 1:
                value = [0.8 * each + 0.02 for each in knob.value]
            else:
                value = 4 if knob.label == "samples" else 2.0 * knob.value or 2.0
            edits = Edits().value(knob.path, knob.set(value))
            assert apart(shown(player, edits), before) > 0, knob.path
            assert apart(player.frame(0.0), before) == 0, (table, knob.path)


@pytest.mark.parametrize("name", ["ground", "sky", "fog", "billboard", "radial_blur", "bloom"])
def test_an_effect_switched_off_is_as_if_it_had_not_been_called_for(played, name):
    player = played()
    edits = switched(player, player.scene, Edits(), name, False)
    assert edits is not None
    without = shown(player, edits)
    assert apart(without, played(name).frame(0.0)) <= CODE
    assert apart(without, player.frame(0.0)) > CODE


def test_a_lens_switched_off_blurs_nothing(played):
    player = played()
    without = shown(player, switched(player, player.scene, Edits(), "defocus", False))
    assert apart(without, played(camera=CAMERA).frame(0.0)) <= CODE
    assert apart(without, player.frame(0.0)) > CODE


def test_a_shadow_switched_off_is_as_if_nothing_cast_it(played):
    player = played()
    without = shown(player, switched(player, player.scene, Edits(), "occlusion", False))
    bare = {key: value for key, value in BOX.items() if key != "shadow"}
    assert apart(without, played(meshes=[bare]).frame(0.0)) <= CODE
    assert apart(without, player.frame(0.0)) > CODE


@pytest.mark.parametrize(
    ("key", "parts"), [("mesh/box", {"meshes": None}), ("billboard/ball", {"billboards": None})]
)
def test_what_is_hidden_leaves_neither_itself_nor_its_shadow(played, key, parts):
    player = played("defocus", camera=CAMERA)
    without = shown(player, Edits().show(key, False))
    assert apart(without, played("defocus", camera=CAMERA, **parts).frame(0.0)) <= CODE
    assert apart(without, player.frame(0.0)) > CODE


def test_a_sprite_can_lose_its_shadow_alone(played):
    player = played(camera=CAMERA)
    without = shown(player, Edits().show("shadow/ball", False))
    ball = {**BALL, "shadow": False}
    assert apart(without, played(camera=CAMERA, billboards=[ball]).frame(0.0)) == 0


def test_lights_change_as_if_the_file_had_them_so(played):
    player = played()
    edits = Edits().light(0, LightEdit(on=False)).light(1, LightEdit(factor=2.0, move=(0, 0.5, 0)))
    lights = [
        {**LIGHTS[0], "irradiance": [0, 0, 0]},
        {**LIGHTS[1], "radiance": [4, 8, 24], "position": [1.5, 2.0, 1]},
    ]
    assert apart(shown(player, edits), played(lights=lights).frame(0.0)) == 0


def test_changes_leave_nothing_on_the_card(played):
    player = played()
    player.frame(0.0)
    curves = [Edits().value("film.tonemap", name) for name in ("filmic", "linear")]
    for edits in curves:
        shown(player, edits)
    everything = Edits().effect(tuple(player.optional), False).show("mesh/box", False)
    kinds = [*curves, everything, Edits().light(0, LightEdit(factor=0.3))]

    def count():
        return player.targets.objects, player.programs.count, len(player._made)

    before = count()
    scene = player.scene
    for number in range(200):
        edits = kinds[number % len(kinds)]
        player.change(edits.of(scene), hidden=edits.hidden, off=edits.off)
        if number % 5 == 0:
            # Coarser and in full in turn, as a window draws
            player.targets.resize((16, 10) if number % 2 else (32, 20))
            player.draw(0.0)
    player.change(scene, hidden=(), off=())
    player.targets.resize(SIZE)
    player.draw(0.0)
    assert count() == before


def test_switches_say_what_may_go_and_why_not(played):
    player = played("fog")
    plan = {effect["name"]: effect for effect in player.plan["effects"]}
    plan["fog"] |= {"reason": "thin", "bound": 0.25, "unit": "8-bit codes"}
    found = {s.name: s for s in switches(player, player.scene, Edits())}
    assert [s.name for s in found.values()] == list(plan)
    assert found["fog"].why == "thin (bound 0.25 8-bit codes)"
    assert not found["fog"].called
    assert not found["fog"].free
    assert found["film"].on
    assert not found["film"].free
    assert found["surface"].free
    off = switches(player, player.scene, switched(player, player.scene, Edits(), "surface", False))
    assert not {s.name: s for s in off}["surface"].on


def test_only_what_may_go_goes(played):
    player = played()
    player.change(off=("film", "bloom", "lens", "occlusion"))
    assert player.off == {"bloom", "lens"}
    assert "film" not in player.optional


def test_animated_values_are_shifted_at_all_times(played):
    player = played()
    moving = Keyed(np.array([0.0, 2.0]), np.array([0.0, 1.0]))
    film = replace(player.scene.picture.film, exposure=moving)
    scene = replace(player.scene, picture=replace(player.scene.picture, film=film))
    knob = next(k for k in knobs(scene.picture, 1.0)["film"] if k.label == "exposure")
    assert knob.value == pytest.approx(0.5)
    changed = Edits().value(knob.path, knob.set(1.5)).of(scene).picture.film.exposure
    assert [changed.at(t) for t in (0.0, 1.0, 2.0)] == pytest.approx([1.0, 1.5, 2.0])


def test_particles_switched_off_are_as_if_there_were_none(played):
    emitter = {"seed": 3, "rate": 8.0, "lifetime": [1, 2], "centre": [0, 1, 1]}
    dust = {
        "name": "dust",
        "emitter": {**emitter, "half_size": [1, 0.5, 0]},
        "look": {"radius": 0.2, "radiance": [2.0, 1.0, 0.5]},
    }
    player = played(camera=CAMERA, particles=[dust])
    without = shown(player, switched(player, player.scene, Edits(), "particles", False))
    assert apart(without, played(camera=CAMERA).frame(0.0)) <= CODE
    assert apart(without, player.frame(0.0)) > CODE
