"""Boxes of keys against dense sampling: no moment shows what no box shows."""

from typing import Any

import numpy as np
import pytest

from formats import lens_bounds, motion, poses, scene
from formats.keyed import Keyed
from maths import optics, transforms

SPRITES = {"name": "oak", "source": "oak.glb", "height": 2.0}


def made(camera: dict[str, Any], **parts: Any) -> scene.Scene:
    raw = {"format": 1, "camera": camera, "time": {"duration": 2.0}, **parts}
    return scene.from_dict(raw, where="a.toml", root=None)


def way(rng: np.random.Generator, values: Any) -> dict[str, Any]:
    how = str(rng.choice(["linear", "smooth", "step"]))
    loop = bool(rng.random() < 0.5)
    return {"times": [0.1, 0.7, 1.3], "values": values, "interpolation": how, "loop": loop}


def test_a_value_stays_in_the_box_of_its_span(rng: np.random.Generator) -> None:
    for _ in range(8):
        raw = way(rng, rng.uniform(-1, 1, (3, 3)).tolist())
        keyed = Keyed(
            np.array(raw["times"]), np.array(raw["values"]), raw["interpolation"], raw["loop"]
        )
        for start, end in poses.spans([keyed], 2.0):
            low, high = poses.box(keyed, start, end)
            for t in np.linspace(start, end, 7):
                # Sums in another order
                assert np.all(keyed.at(t) >= low - 1e-12)
                assert np.all(keyed.at(t) <= high + 1e-12)


def test_spans_are_few_and_cover_the_animation() -> None:
    keyed = Keyed(np.array([0.0, 1e-5]), np.array([0.0, 1.0]), loop=True)
    assert poses.spans([keyed], 3600.0) == [(0.0, 3600.0)]
    assert poses.spans([Keyed.hold(1.0)], 3600.0) == [(0.0, 0.0)]
    found = poses.spans([Keyed(np.array([1.0, 5.0]), np.array([0.0, 1.0]))], 4.0)
    assert (found[0][0], found[-1][1]) == (0.0, 4.0)
    assert {1.0} <= {start for start, _ in found}


@pytest.mark.parametrize("focus", [1.0, 4.0, 30.0])
def test_no_moment_blurs_more_than_said(focus: float, rng: np.random.Generator) -> None:
    for _ in range(2):
        camera = {
            "position": way(rng, rng.uniform([-3, 0.5, 3], [3, 4, 9], (3, 3)).tolist()),
            "target": way(rng, rng.uniform(-2, 2, (3, 3)).tolist()),
            "focal_length_mm": way(rng, [35, 50, 70]),
            "lens": {"f_number": way(rng, [2, 8, 4]), "focus_distance": way(rng, [focus, 2, 7])},
        }
        places = rng.uniform([-8, -1, -8], [8, 1, 8], (12, 3))
        found = made(camera, billboards=[{**SPRITES, "positions": places.tolist()}], ground={})
        bound = lens_bounds.of_sprites(found, {}, 1080)
        plane = lens_bounds.of_ground(found, 1080)
        worst = level = 0.0
        for t in np.linspace(0.0, 2.0, 61):
            for name, circle in seen(found, places, float(t)):
                if name == "oak":
                    worst = max(worst, circle)
                else:
                    level = max(level, circle)
        assert worst > 0.0
        assert bound is not None
        assert plane is not None
        # Sums in another order
        assert worst <= bound.pixels * (1 + 1e-9)
        assert level <= plane.pixels * (1 + 1e-9)


def seen(found: scene.Scene, places: Any, t: float) -> list[tuple[str, float]]:
    """Circles in pixels of points of the sprites and of the ground that are in a 2.39:1 picture."""
    camera = found.camera
    assert camera.lens is not None
    view = transforms.look_at(camera.position.at(t), camera.target.at(t))
    length = camera.focal_length_mm.at(t)
    points = [("oak", p + np.array([0, y, 0])) for p in places for y in (0.0, 1.0, 2.0)]
    grid = np.stack(np.meshgrid(np.linspace(-9, 9, 9), [0.0], np.linspace(-9, 9, 9)), -1)
    points += [("ground", p) for p in grid.reshape(-1, 3)]
    every = np.array([p for _, p in points]) @ view[:3, :3].T + view[:3, 3]
    slope = 12.0 / length
    inside = (
        (-every[:, 2] > scene.NEAR)
        & (np.abs(every[:, 1]) < -slope * every[:, 2])
        & (np.abs(every[:, 0]) < -2.39 * slope * every[:, 2])
    )
    circles = optics.circle_of_confusion(
        -every[inside, 2],
        length / 1000,
        camera.lens.f_number.at(t),
        camera.lens.focus_distance.at(t),
    )
    names = [name for (name, _), there in zip(points, inside, strict=True) if there]
    return list(zip(names, (circles / 0.024 * 1080).tolist(), strict=True))


def test_motion_names_what_changes() -> None:
    still = {"position": [0, 1, 5], "target": [0, 1, 0]}
    assert motion.moving(made(still)) == ()
    same = {"times": [0, 1], "values": [50, 50]}
    assert motion.moving(made({**still, "focal_length_mm": same})) == ()
    pull = {"times": [0, 1], "values": [2, 5]}
    lens = {"f_number": 2, "focus_distance": pull}
    sun = {"type": "sun", "to_light": [0, 1, 0], "irradiance": [1, 1, 1]}
    dusk = {**sun, "irradiance": {"times": [0, 1], "values": [[1, 1, 1], [0, 0, 0]]}}
    found = made({**still, "lens": lens}, lights=[sun, dusk])
    assert motion.moving(found) == ("camera.lens.focus_distance", "lights[1].irradiance")
