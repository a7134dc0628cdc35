"""Fog against closed forms at the farthest thing seen, and what a still camera never looks at."""

from typing import Any

import numpy as np
import pytest

from formats import effects, scene
from formats.plan import EffectPlan
from maths import colour, transforms

SPRITES = {"name": "oak", "source": "oak.glb", "height": 2.0, "positions": [[0, 0, 0]]}
ROCK = {"name": "rock", "source": "rock.glb"}


def made(**changes: Any) -> scene.Scene:
    """One sprite 10 m in front of a level camera."""
    camera = {"position": [0, 1, 10], "target": [0, 1, 0]}
    raw: dict[str, Any] = {"format": 1, "camera": camera, "billboards": [SPRITES], **changes}
    return scene.from_dict(raw, where="a.toml", root=None)


def decided(found: scene.Scene, name: str) -> EffectPlan:
    return {effect.name: effect for effect in effects.decide(found)}[name]


def fog(extinction: Any, radiance: Any = (1.0, 1.0, 1.0), **more: Any) -> dict[str, Any]:
    return {"fog": {"extinction": extinction, "radiance": list(radiance), **more}}


def test_fog_without_extinction_is_left_out() -> None:
    effect = decided(made(picture=fog(0.0)), "fog")
    assert (effect.called, effect.bound) == (False, 0.0)


def above(**changes: Any) -> scene.Scene:
    """A camera 10 m over the ground that looks almost straight down: nothing is infinitely far."""
    camera = {"position": [0, 10, 0.1], "target": [0, 0, 0]}
    return scene.from_dict(
        {"format": 1, "camera": camera, "ground": {}, **changes}, where="a.toml", root=None
    )


def corner() -> float:
    """Metres from that camera to the farthest corner of its picture, 2.4 times as wide as high."""
    ray = np.array([-2.4 * 0.24, 0.24, -1.0])
    down = transforms.look_at([0, 10, 0.1], [0, 0, 0])[:3, :3].T @ ray
    return float(10.0 / -down[1] * np.linalg.norm(ray))


def test_fog_is_measured_at_the_farthest_ground_in_codes() -> None:
    # Behind thin fog of radiance 1, black changes most: to 1 - transmittance
    picture = {**fog(1e-3), "film": {"tonemap": "linear"}}
    effect = decided(above(picture=picture), "fog")
    expected = 255 * colour.srgb_encode(1 - np.exp(-1e-3 * corner()))
    assert effect.called
    assert effect.bound == pytest.approx(float(expected), rel=1e-12)
    assert "the ground at 12 m" in effect.reason


@pytest.mark.parametrize(("codes", "called"), [(0.49, False), (0.51, True)])
def test_fog_of_less_than_half_a_code_is_left_out(codes: float, called: bool) -> None:
    share = float(colour.srgb_decode(codes / 255))
    extinction = -np.log1p(-share) / corner()
    picture = {**fog(extinction), "film": {"tonemap": "linear"}}
    effect = decided(above(picture=picture), "fog")
    assert effect.called is called
    assert effect.bound == effect.codes == pytest.approx(codes, rel=1e-9)


def test_exposure_counts() -> None:
    dim = {**fog(1e-6, (1e-3,) * 3), "film": {"tonemap": "linear", "exposure": 0}}
    bright = {
        **dim,
        "film": {"tonemap": "linear", "exposure": {"times": [0, 1], "values": [0, 20]}},
    }
    assert not decided(above(picture=dim), "fog").called
    assert decided(above(picture=bright), "fog").called


def test_dark_fog_hides_what_is_bright() -> None:
    picture = {**fog(0.05, (0, 0, 0)), "film": {"tonemap": "linear"}}
    assert decided(above(picture=picture), "fog").called


def test_any_fog_drowns_what_is_infinitely_far() -> None:
    for found in (made(picture=fog(1e-9)), made(billboards=[], picture=fog(1e-9), ground={})):
        effect = decided(found, "fog")
        assert effect.called
        assert "the horizon" in effect.reason
    # A ground that is not drawn hides no horizon
    assert decided(above(picture=fog(1e-9), force={"ground": False}), "fog").called


def test_fog_that_thins_with_height_counts_where_it_is_thickest() -> None:
    low = {"height": -10.0}
    thin = decided(above(ground=low, picture=fog(1e-6)), "fog").bound
    thick = decided(above(ground=low, picture=fog(1e-6, falloff=0.5)), "fog").bound
    same = decided(above(ground=low, picture=fog(1e-6 * np.exp(5.0))), "fog").bound
    assert thick > thin
    assert thick == pytest.approx(same, rel=1e-12)


def test_extreme_fog_is_finite() -> None:
    far = [{**SPRITES, "positions": [[0, -1e6, 0]]}]
    picture = {**fog(1e3, (1e6,) * 3, falloff=1e3), "film": {"exposure": 32}}
    assert decided(made(billboards=far, picture=picture), "fog").bound == pytest.approx(255.0)


def test_fog_veils_meshes_as_far_as_they_reach() -> None:
    picture = fog(1e-7)
    alone = above(meshes=[ROCK], picture=picture)
    small = {"mesh/rock": {"bounds": [[-1, 0, -1], [1, 2, 1]]}}
    known = {e.name: e for e in effects.decide(alone, small)}["fog"]
    # Nothing says how large the mesh is: it counts as large
    unknown = decided(alone, "fog")
    assert known.bound is not None
    assert unknown.bound is not None
    assert 0 < known.bound < unknown.bound


# Out of view

SKY = {"sky": {"zenith": [0, 0, 1], "horizon": [1, 1, 1]}}


def looking(up: float, height: float = 2.0, **parts: Any) -> scene.Scene:
    """A still camera over a ground that looks up or down by an angle, degrees; 27 degrees high."""
    rise = float(np.tan(np.radians(up)))
    camera = {"position": [0, height, 0], "target": [0, height + rise, -1]}
    raw = {"format": 1, "camera": camera, "ground": {}, "picture": SKY, **parts}
    return scene.from_dict(raw, where="a.toml", root=None)


@pytest.mark.parametrize(
    ("up", "ground", "sky"),
    [(-13.6, True, False), (-13.3, True, True), (13.3, True, True), (13.6, False, True)],
)
def test_what_lies_beyond_the_horizon_is_left_out(up: float, ground: bool, sky: bool) -> None:
    # Half the field of view is atan(12 / 50) = 13.496 degrees
    found = looking(up)
    assert decided(found, "ground").called is ground
    assert decided(found, "sky").called is sky
    for name in ("ground", "sky"):
        effect = decided(found, name)
        assert effect.codes == (255.0 if effect.called else 0.0)
    # From below it is the other way round
    under = looking(-up, height=-2.0)
    assert decided(under, "ground").called is ground
    assert decided(under, "sky").called is sky


def test_a_camera_that_moves_may_see_anything() -> None:
    turn = {"times": [0, 1], "values": [[0, 1, -1], [0, 1.1, -1]]}
    moving = looking(-40.0, camera={"position": [0, 2, 0], "target": turn})
    assert decided(moving, "sky").called
    assert decided(looking(-40.0, force={"ground": False}), "sky").called
