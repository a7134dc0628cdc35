"""The study of played against traced shadows: its steps by closed forms, its data by hand."""

from typing import Any

import numpy as np
import pytest

from bake import sources
from formats import scene as scenes
from formats.meshes import Shadow
from formats.occlusion import Box
from pipelines.studies import shadow_steps, shadow_truth
from pipelines.studies.subjects import Setting


def test_volumes_are_changed_and_nothing_else() -> None:
    raw: dict[str, Any] = {
        "meshes": [{"name": "a", "shadow": {"l_max": 8}}, {"name": "b"}],
        "format": 1,
    }
    found = shadow_truth.with_volume(raw, {"l_max": 3, "components": 16})
    assert found["meshes"] == [
        {"name": "a", "shadow": {"l_max": 3, "components": 16}},
        {"name": "b"},
    ]
    assert shadow_truth.with_volume(raw, "none")["meshes"] == [{"name": "a"}, {"name": "b"}]
    assert shadow_truth.with_volume(raw, "as it is") == raw
    assert raw["meshes"][0] == {"name": "a", "shadow": {"l_max": 8}}


def test_errors_of_equal_and_of_opposite_pictures() -> None:
    black, white = (np.full((32, 32, 3), code, np.uint8) for code in (0, 255))
    assert shadow_truth.errors(white, white)["psnr"] == np.inf
    assert shadow_truth.errors(black, white, "_x")["psnr_x"] == pytest.approx(0)


def test_flip_is_nothing_for_equal_pictures_and_near_one_for_opposite_ones() -> None:
    pytest.importorskip("flip_evaluator")
    black, white = (np.full((32, 32, 3), code, np.uint8) for code in (0, 255))
    assert shadow_truth.errors(white, white)["flip"] == 0
    # Andersson et al. 2020: 1 is the largest error, of black on white .97
    assert shadow_truth.errors(black, white)["flip"] == pytest.approx(0.97, abs=0.01)


def test_volume_thins_outside_and_only_there(rng: np.random.Generator) -> None:
    box = Box((0.1, 0.2, 0.3), (0.5, 1.0, 0.7))
    terms = rng.normal(size=(3, 4)).astype(np.float32)
    p = np.array([[0.0, 0.0, 0.0], [-0.9, 1.0, 0.5], [3.0, 0.0, 0.0]])
    found = shadow_steps.thinned(terms, box, p)
    np.testing.assert_array_equal(found[:2], terms[:2])
    factor = found[2] / terms[2]
    assert np.ptp(factor) < 1e-6
    assert 0 < factor[0] < 0.5


def test_costs_are_those_of_all_casters() -> None:
    one = shadow_truth.Played({}, bytes=640 * 1024, lookups=25)
    assert one.costs == {"kib": 640.0, "lookups": 25}


def test_more_bands_come_nearer_to_the_truth() -> None:
    scene = scenes.load(shadow_truth.SCENE)
    caster = scene.meshes[0]
    mesh, where = sources.load(caster.source), shadow_steps.receivers(scene, 0.0, (16, 9))
    error = []
    few = Shadow(l_max=1, components=4, grid=4)
    for shadow in (few, Shadow(l_max=6, components=16, encoding="bands", size=16, grid=4)):
        shares = shadow_steps.shares(
            scene, caster, mesh, 0.0, shadow=shadow, samples=24, where=where
        )
        assert list(shares)[1:] == list(shadow_steps.STEPS)
        assert all(np.all((share >= 0) & (share <= 1)) for share in shares.values())
        error.append(float(np.sqrt(np.mean((shares["ends"] - shares["truth"]) ** 2))))
    # On more points .117 was measured at l_max = 2, .058 at 6
    assert error[1] < 0.7 * error[0]


def small_scene(**more: Any) -> scenes.Scene:
    """A plinth that casts a shadow on the ground, and what else is given."""
    data = {
        "format": 1,
        "time": {"duration": 1.0},
        "camera": {"position": [0, 3, 3.0], "target": [0, 0, 0]},
        "lights": [{"type": "sun", "to_light": [0, 1, 0], "irradiance": [1, 1, 1]}],
        "ground": {},
        "meshes": [
            {"name": "plinth", "source": "meshes/plinth.glb", "shadow": {"grid": 4, "rays": 32}}
        ],
    }
    root = shadow_truth.SCENE.parents[1]
    return scenes.from_dict({**data, **more}, where="small.json", root=root)


def test_receivers_are_ground_and_cubes_but_no_casters_sprites_and_lamps() -> None:
    plain = shadow_steps.receivers(small_scene(), 0.0, (24, 14))
    assert len(plain.point) > 200
    assert np.abs(plain.point[:, 1]).max() < 1e-3
    sprites = {
        "name": "lantern",
        "source": "meshes/lantern.glb",
        "height": 0.8,
        "positions": [[-0.8, 0, 0.5], [0.8, 0, 0.5]],
    }
    lamp = {"position": [0.7, 0.4, -0.4], "radiance": [1, 1, 1]}
    door = {"source": "voxels/door.vox", "cell_size": 0.1, "lamps": [lamp]}
    found = shadow_steps.receivers(
        small_scene(billboards=[sprites], voxels=door, lights=[]), 0.0, (24, 14)
    )
    above = found.point[found.point[:, 1] > 0.01]
    # Of what stands above the ground only the door, a wall one cell thick and 1.5 m high
    assert len(above) > 5
    assert np.ptp(above[:, 0]) < 0.2 or np.ptp(above[:, 2]) < 0.2
    assert len(found.point) < len(plain.point)


def test_a_scene_without_a_lamp_has_no_steps() -> None:
    scene = small_scene(lights=[])
    setting = Setting(quick=True)
    assert shadow_truth.explained(scene, (0.0,), setting) == []


def test_among_cubes_light_that_bounces_is_what_the_title_tells() -> None:
    table = [
        {"shadow": name, "kib": 1.0, "psnr": a, "psnr_direct": b}
        for name, a, b in (("one", 30.0, 20.0), ("two", 25.0, 40.0))
    ]
    assert '"one" comes nearest: 30.0 dB' in shadow_truth._pictures(table, "psnr").title
    assert '"two" comes nearest: 40.0 dB' in shadow_truth._pictures(table, "psnr_direct").title
