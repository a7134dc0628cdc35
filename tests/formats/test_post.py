"""When bloom and radial blur are called for: bounds on what is brightest, and on streaks."""

from typing import Any

import numpy as np
import pytest

from formats import effects, film_bounds, post, scene
from formats.errors import InputError
from formats.plan import EffectPlan

SUN = {"type": "sun", "to_light": [0, 1, 0], "irradiance": [3.0, 2.0, 1.0]}
GROUND = {"albedo": [0.5, 0.5, 0.5], "accent": [0.1, 0.2, 0.8]}
ROCK = {"name": "rock", "source": "rock.glb"}
# Ground of at most 0.8 / pi of 3 W/m2, and a sky
LIT = 0.8 * 3.0 / np.pi
SKY = {"zenith": [0.1, 0.2, 0.5], "horizon": [0.6, 0.5, 0.4]}


def made(bloom: Any = None, blur: Any = None, **more: Any) -> scene.Scene:
    picture = {"sky": SKY, **more.pop("picture", {})}
    if bloom is not None:
        picture["bloom"] = bloom
    if blur is not None:
        picture["radial_blur"] = blur
    raw = {
        "format": 1,
        "camera": {"position": [0, 1, 10], "target": [0, 1, 0]},
        "lights": [SUN],
        "ground": GROUND,
        "picture": picture,
        **more,
    }
    return scene.from_dict(raw, where="a.toml", root=None)


def decided(found: scene.Scene, name: str, lines: int = 1080, reports: Any = None) -> EffectPlan:
    return {each.name: each for each in effects.decide(found, reports, lines)}[name]


def test_a_scene_without_them_calls_for_neither() -> None:
    for name in ("bloom", "radial_blur"):
        effect = decided(made(), name)
        assert (effect.called, effect.codes) == (False, 0.0)
        assert effect.reason == f"the scene has no picture.{name}"


def test_the_brightest_is_the_sum_of_light_sky_and_fog() -> None:
    most = post.ROUNDING * (LIT + 0.6)
    assert post.brightest(made(), {}) == pytest.approx(most, rel=1e-12)
    fog = {"extinction": 0.1, "radiance": [0.2, 0.9, 0.1]}
    foggy = made(picture={"fog": fog})
    assert post.brightest(foggy, {}) == pytest.approx(most + post.ROUNDING * 0.9, rel=1e-12)
    glowing = made(picture={"sky": {**SKY, "glow": [1.0, 0.5, 0.1]}})
    assert post.brightest(glowing, {}) == pytest.approx(most + post.ROUNDING * 3.0, rel=1e-12)


def test_bloom_is_called_for_only_where_something_may_exceed_its_threshold() -> None:
    most = post.brightest(made(), {})
    assert most is not None
    under, over = made({"threshold": most * 1.001}), made({"threshold": most * 0.7})
    assert not decided(under, "bloom").called
    assert decided(under, "bloom").codes == 0.0
    assert "nothing is brighter than" in decided(under, "bloom").reason
    effect = decided(over, "bloom")
    assert effect.called
    expected = film_bounds.added(over.picture.film, 0.1 * most * 0.3)
    assert effect.bound == effect.codes == pytest.approx(expected, rel=1e-9)
    assert decided(made({}), "bloom").called


def test_light_over_the_threshold_counts_only_where_it_makes_half_a_code() -> None:
    most = post.brightest(made(), {})
    assert most is not None
    faint = decided(made({"strength": 1e-5}), "bloom")
    assert not faint.called
    assert 0.0 < faint.codes < 0.5
    assert not decided(made({"strength": 1.0, "threshold": most - 1e-6}), "bloom").called
    # Seen by 12 stops more it is not faint
    bright = made({"strength": 1e-5}, picture={"film": {"exposure": 12.0}})
    assert decided(bright, "bloom").called


@pytest.mark.parametrize("strength", [0.0, {"times": [0, 1], "values": [0, 0]}])
def test_strength_nought_calls_for_neither(strength: Any) -> None:
    found = made({"strength": strength}, {"strength": strength})
    assert not decided(found, "bloom").called
    assert not decided(found, "radial_blur").called
    # Not even of a scene of which nothing is known
    cubes = made({"strength": strength}, voxels={"source": "a.vox"})
    assert not decided(cubes, "bloom").called


def test_what_is_not_known_may_be_of_any_brightness() -> None:
    high = {"threshold": 1e4}
    reports = {"mesh/rock": {"bounds": [[-1, -1, -1], [1, 1, 1]], "emissive": False}}
    glows = {"mesh/rock": {**reports["mesh/rock"], "emissive": True}}
    rock = made(high, meshes=[ROCK])
    assert decided(rock, "bloom").called
    assert decided(rock, "bloom", reports=glows).called
    assert decided(rock, "bloom", reports=glows).reason == "no bound is known on what is brightest"
    assert not decided(rock, "bloom", reports=reports).called
    assert not decided(made(high, meshes=[ROCK], force={"surface": False}), "bloom").called
    # Cubes; maps and sprites before they are baked; parts that are not counted
    assert decided(made(high, voxels={"source": "a.vox"}), "bloom").called
    sky = {"type": "environment", "source": "a.exr"}
    assert decided(made(high, lights=[SUN, sky]), "bloom").called
    oak = {"name": "oak", "source": "oak.glb", "height": 2.0, "positions": [[0, 0, 0]]}
    assert decided(made(high, billboards=[oak]), "bloom").called
    other = made(high)
    other.raw["smoke"] = []
    assert decided(other, "bloom").called


def test_the_longest_streak_is_that_of_the_farthest_corner() -> None:
    blur = {"strength": 0.2, "centre": [0.5, 0.5]}
    effect = decided(made(blur=blur), "radial_blur", lines=100)
    # Half of a picture 2.4 wide, half of its height
    assert effect.bound == pytest.approx(0.2 * 100 * np.hypot(1.2, 0.5), rel=1e-12)
    assert (effect.called, effect.unit) == (True, "px")
    aside = decided(made(blur={**blur, "centre": [0.0, 1.0]}), "radial_blur", lines=100)
    assert aside.bound == pytest.approx(0.2 * 100 * np.hypot(2.4, 1.0), rel=1e-12)


def test_streaks_under_half_a_pixel_are_left_out() -> None:
    longest = np.hypot(1.2, 0.5)
    for pixels, called in ((0.499, False), (0.501, True)):
        effect = decided(made(blur={"strength": pixels / 1000 / longest}), "radial_blur", 1000)
        assert effect.called is called
        if not called:
            assert effect.codes == 0.0


@pytest.mark.parametrize("name", ["bloom", "radial_blur"])
def test_what_is_not_described_cannot_be_forced(name: str) -> None:
    with pytest.raises(InputError, match=rf"force\.{name}") as caught:
        effects.decide(made(force={name: True}))
    assert f"picture.{name}" in caught.value.remedy


@pytest.mark.parametrize(
    ("table", "field"),
    [
        ({"bloom": {"strenght": 0.1}}, "picture.bloom.strenght"),
        ({"bloom": {"strength": 1.5}}, "picture.bloom.strength"),
        ({"bloom": {"radius": 0.0}}, "picture.bloom.radius"),
        ({"radial_blur": {"samples": 1}}, "picture.radial_blur.samples"),
        ({"radial_blur": {"centre": [0.5, 1.5]}}, "picture.radial_blur.centre"),
        ({"film": {"grain": 17}}, "picture.film.grain"),
    ],
)
def test_wrong_values_are_named(table: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError) as caught:
        made(picture=table)
    assert caught.value.field.startswith(field)
