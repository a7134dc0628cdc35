"""The effects table: decisions against closed forms, forcing, the lens over the animation."""

from typing import Any

import numpy as np
import pytest

from formats import effects, scene
from formats.errors import InputError
from formats.lens_blur import moments
from formats.plan import FRAME, EffectPlan
from maths import optics, transforms

SPRITES = {"name": "oak", "source": "oak.glb", "height": 2.0, "positions": [[0, 0, 0]]}


def made(**changes: Any) -> scene.Scene:
    """One sprite 10 m in front of a level camera without a lens; changes go over the raw scene."""
    raw: dict[str, Any] = {
        "format": 1,
        "camera": {"position": [0, 1, 10], "target": [0, 1, 0]},
        "billboards": [SPRITES],
    }
    for key, value in changes.items():
        if key in ("lens", "position", "focal_length_mm"):
            raw["camera"][key] = value
        else:
            raw[key] = value
    return scene.from_dict(raw, where="a.toml", root=None)


def decided(found: scene.Scene, name: str, lines: int = 1080) -> EffectPlan:
    return {effect.name: effect for effect in effects.decide(found, lines=lines)}[name]


def lens(f_number: Any = 2.0, focus_distance: Any = 5.0) -> dict[str, Any]:
    return {"f_number": f_number, "focus_distance": focus_distance}


def test_the_table_is_in_frame_order() -> None:
    assert tuple(row.name for row in effects.EFFECTS) == FRAME


def test_the_least_scene_calls_only_for_sprites_and_film() -> None:
    called = [effect.name for effect in effects.decide(made()) if effect.called]
    assert called == ["billboard", "film"]


def test_every_reason_is_one_line_and_every_bound_has_a_unit() -> None:
    for found in (made(), everything()):
        for effect in effects.decide(found):
            assert effect.reason
            assert "\n" not in effect.reason
            assert (effect.bound is None) == (effect.unit == "")


LAMP = {
    "position": {"times": [0, 1], "values": [[0, 1, 0], [1, 1, 0]]},
    "radiance": [1, 1, 1],
}


def everything() -> scene.Scene:
    return made(
        lens=lens(),
        lights=[{"type": "environment", "source": "a.exr"}],
        ground={},
        voxels={"source": "a.vox", "lamps": [LAMP]},
        meshes=[
            {"name": "rock", "source": "rock.glb", "shadow": {}},
            {
                "name": "bust",
                "source": "bust.glb",
                "lighting": "transfer",
                "silhouette_width": 0.01,
            },
        ],
        particles=[
            {
                "name": "embers",
                "emitter": {"rate": 9, "lifetime": [1, 2], "centre": [0, 1, 0]},
                "look": {"radius": 0.1},
            }
        ],
        picture={
            "sky": {"zenith": [0, 0, 1], "horizon": [1, 1, 1]},
            "fog": {"extinction": 0.01, "radiance": [1, 1, 1]},
            "radial_blur": {},
            "bloom": {},
        },
    )


def test_a_whole_scene_calls_for_everything() -> None:
    # Light of cubes is either baked or gathered
    expected = tuple(name for name in FRAME if name != "lightmap")
    assert tuple(e.name for e in effects.decide(everything()) if e.called) == expected
    assert decided(everything(), "billboard").kinds == ("billboard",)
    assert decided(everything(), "environment").kinds == ("environment",)


@pytest.mark.parametrize(
    ("scale", "called", "bound"),
    [
        (0.0, False, 0.0),
        ([0, 0, 0.5], True, 0.5),
        ({"times": [0, 1], "values": [0, 0.25]}, True, 0.25),
        ({"times": [0, 1], "values": [0, 0]}, False, 0.0),
    ],
)
def test_an_environment_is_called_for_where_it_ever_shines(
    scale: Any, called: bool, bound: float
) -> None:
    lights = [{"type": "environment", "source": "a.exr", "scale": scale}]
    effect = decided(made(lights=lights), "environment")
    assert (effect.called, effect.bound) == (called, bound)


def test_sprites_are_counted() -> None:
    assert decided(made(), "billboard").bound == 1
    empty = made(billboards=[{**SPRITES, "positions": []}], lens=lens())
    assert not decided(empty, "billboard").called
    assert not decided(empty, "depth_of_field").called


# Depth of field


def test_the_circle_of_confusion_is_the_closed_form() -> None:
    effect = decided(made(lens=lens()), "depth_of_field")
    # A f |d - d_f| / (d (d_f - f)) on a sensor 24 mm high, seen by 1080 lines
    f, d, focus = 0.05, 10.0, 5.0
    expected = (f / 2.0) * f * (d - focus) / (d * (focus - f)) / 0.024 * 1080
    assert effect.called
    # The same formula in another order: a few roundings
    assert effect.bound == pytest.approx(expected, rel=1e-14)
    assert "oak at 10 m" in effect.reason


def test_the_bound_follows_the_lines_of_the_picture() -> None:
    found = made(lens=lens())
    half = decided(found, "depth_of_field", lines=540).bound
    assert decided(found, "depth_of_field", lines=1080).bound == pytest.approx(2 * half, rel=1e-14)


def test_less_than_half_a_pixel_is_left_out() -> None:
    circle = float(optics.circle_of_confusion(10.0, 0.05, 2.0, 5.0))
    lines_for_half = 0.5 * 0.024 / circle
    below, above = int(lines_for_half), int(lines_for_half) + 1
    found = made(lens=lens())
    assert not decided(found, "depth_of_field", lines=below).called
    assert decided(found, "depth_of_field", lines=above).called


def test_sprites_in_focus_need_no_lens() -> None:
    effect = decided(made(lens=lens(focus_distance=10.0)), "depth_of_field")
    assert not effect.called
    assert effect.bound == 0.0


def test_a_focus_pull_counts_at_its_worst_moment() -> None:
    pull = {"times": [0, 1, 2], "values": [10, 4, 10], "interpolation": "smooth"}
    found = made(lens=lens(focus_distance=pull), time={"duration": 2})
    expected = optics.circle_of_confusion(10.0, 0.05, 2.0, 4.0) / 0.024 * 1080
    # The key itself is sampled: only the order of the roundings differs
    assert decided(found, "depth_of_field").bound == pytest.approx(float(expected), rel=1e-14)
    # Named by the start of the span of 1/85 s that the key ends
    assert ", 0.988 s" in decided(found, "depth_of_field").reason


def test_a_key_between_frames_is_sampled() -> None:
    pull = {"times": [0.011, 0.012, 0.013], "values": [10, 4, 10]}
    found = made(lens=lens(focus_distance=pull), time={"duration": 86400})
    assert decided(found, "depth_of_field").called
    after = made(lens=lens(focus_distance=pull), time={"duration": 0.0105})
    assert not decided(after, "depth_of_field").called


def test_moments_are_few_and_include_both_ends() -> None:
    assert moments(made(lens=lens(), time={"duration": 9})).tolist() == [0.0]
    pull = {"times": [-1, 3.3, 20], "values": [4, 5, 6]}
    found = moments(made(lens=lens(focus_distance=pull), time={"duration": 9, "frame_rate": 2}))
    assert found.tolist() == sorted([*np.linspace(0, 9, 19), 3.3])
    long = moments(made(lens=lens(focus_distance=pull), time={"duration": 9000}))
    # 256 evenly, and the keys at 3.3 s and 20 s
    assert len(long) == 258


def test_what_the_camera_never_sees_does_not_count() -> None:
    behind = {**SPRITES, "positions": [[0, 0, 30]]}
    aside = {**SPRITES, "positions": [[40, 0, 0]]}
    for sprites in (behind, aside):
        effect = decided(made(billboards=[sprites], lens=lens()), "depth_of_field")
        assert not effect.called
        assert "sees no sprite" in effect.reason


def test_nothing_that_reaches_into_the_picture_is_left_out(rng: np.random.Generator) -> None:
    positions = rng.uniform([-12, -3, -20], [12, 3, 12], (400, 3))
    sprites = {**SPRITES, "positions": positions.tolist()}
    found = made(billboards=[sprites], lens=lens(focus_distance=30.0), position=[0, 2, 10])
    bound = decided(found, "depth_of_field").bound
    # The slow, obvious way: points all over each sprite, twice as wide as high, in a 2.39:1 picture
    view = transforms.look_at([0, 2, 10], [0, 1, 0])
    clip = transforms.perspective(50, 24, 2.39, scene.NEAR, np.inf) @ view
    worst = 0.0
    for p in positions:
        for up in np.linspace(0, 2, 9):
            for side in np.linspace(-2, 2, 9):
                point = clip @ [p[0] + side, p[1] + up, p[2], 1.0]
                if point[3] > scene.NEAR and np.all(np.abs(point[:2]) <= point[3]):
                    circle = optics.circle_of_confusion(point[3], 0.05, 2.0, 30.0)
                    worst = max(worst, float(circle) / 0.024 * 1080)
    assert worst > 1.0
    # Depth is linear over a sprite, so an end is worst; two ways to round the same depth
    assert bound >= worst * (1 - 1e-12)


def test_sprites_forced_off_need_no_lens() -> None:
    assert not decided(made(lens=lens(), force={"billboard": False}), "depth_of_field").called


def test_the_largest_lod_is_the_closed_form() -> None:
    found = made(lens=lens())
    # On the sprite a circle on the sensor grows by d / f: A |d - d_f| / (d_f - f)
    metres = (0.05 / 2.0) * 5.0 / (5.0 - 0.05)
    lod = effects.largest_lod(found, found.billboards[0], 200.0)
    assert lod == pytest.approx(np.log2(metres * 200.0), abs=1e-13)
    wider = effects.largest_lod(found, found.billboards[0], 200.0, lens_scale=2.0)
    assert wider == pytest.approx(lod + 1.0, abs=1e-13)
    assert effects.largest_lod(found, found.billboards[0], 1.0) == 0.0


def test_a_larger_instance_blurs_by_fewer_texels() -> None:
    sets = [{**SPRITES, "positions": [[0, 0, 0]], "scale": [s]} for s in (1.0, 2.0)]
    found = [made(billboards=[s], lens=lens()) for s in sets]
    lods = [effects.largest_lod(s, s.billboards[0], 200.0) for s in found]
    assert lods[0] - lods[1] == pytest.approx(1.0, abs=1e-13)


def test_without_a_called_lens_no_lod_is_needed() -> None:
    for found in (
        made(),
        made(lens=lens(focus_distance=10.0)),
        made(lens=lens(), force={"depth_of_field": False}),
    ):
        assert effects.largest_lod(found, found.billboards[0], 1e6) == 0.0


# Forcing


def test_an_effect_can_be_forced_off_and_on() -> None:
    off = decided(made(lens=lens(), force={"depth_of_field": False}), "depth_of_field")
    assert (off.called, off.forced) == (False, True)
    assert off.reason.startswith("forced off, although the largest circle")
    in_focus = lens(focus_distance=10.0)
    on = decided(made(lens=in_focus, force={"depth_of_field": True}), "depth_of_field")
    assert (on.called, on.forced) == (True, True)
    assert on.reason.startswith("forced on, although")
    agreed = decided(made(force={"billboard": True}), "billboard")
    assert agreed.reason.startswith("forced on, as 1 sprite")
    assert not decided(made(), "billboard").forced


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("depth_of_field", "camera.lens"),
        ("fog", "picture.fog"),
        ("sky", "picture.sky"),
        ("ground", "[ground]"),
        ("environment", 'a light of type "environment"'),
        ("billboard", "[[billboards]]"),
    ],
)
def test_what_is_not_described_cannot_be_forced(name: str, table: str) -> None:
    bare = made(billboards=[], force={name: True})
    with pytest.raises(InputError) as caught:
        effects.decide(bare)
    assert caught.value.field == f"force.{name}"
    assert caught.value.file == "a.toml"
    assert table in caught.value.remedy
    # Forcing off what is not there is no mistake
    assert not decided(made(billboards=[], force={name: False}), name).called


def test_film_cannot_be_forced_off() -> None:
    with pytest.raises(InputError, match=r"force\.film"):
        effects.decide(made(force={"film": False}))
    assert decided(made(force={"film": True}), "film").called


ROCK = {"name": "rock", "source": "rock.glb"}


def test_meshes_call_for_the_surface_pass() -> None:
    assert not decided(made(), "surface").called
    found = decided(made(meshes=[ROCK]), "surface")
    assert (found.called, found.bound, found.kinds) == (True, 1.0, ("mesh",))
    assert found.reason == "1 mesh stands in it"
    two = made(meshes=[ROCK, {**ROCK, "name": "stone"}])
    assert decided(two, "surface").reason == "2 meshes stand in it"


def test_meshes_lit_by_transfer_are_not_drawn_by_the_surface_pass() -> None:
    bust = {**ROCK, "name": "bust", "lighting": "transfer"}
    assert not decided(made(meshes=[ROCK]), "transfer").called
    one = made(meshes=[bust])
    assert decided(one, "transfer").kinds == ("transfer",)
    assert decided(one, "transfer").reason == "1 mesh lit by transfer stands in it"
    assert not decided(one, "surface").called
    assert decided(one, "surface").reason == "the scene has no mesh with direct lighting"
    both = made(meshes=[ROCK, bust])
    assert decided(both, "surface").reason == "1 mesh stands in it"
    assert decided(both, "transfer").called
    # Without them the ground blurs itself
    lensed = made(meshes=[bust], lens=lens(), ground={})
    assert decided(lensed, "defocus").called
    off = made(meshes=[bust], lens=lens(), ground={}, force={"transfer": False})
    assert not decided(off, "defocus").called


def test_transfer_takes_any_number_of_lights() -> None:
    sun = {"type": "sun", "to_light": [0, 1, 0], "irradiance": [3, 3, 3]}
    many = made(meshes=[{**ROCK, "lighting": "transfer"}], lights=[sun] * 40)
    assert decided(many, "transfer").called


def test_transfer_out_of_every_view_is_left_out_once_measured() -> None:
    far = {**ROCK, "lighting": "transfer", "position": [0, 0, 1e4]}
    report = {"transfer/rock": {"bounds": [[-1, -1, -1], [1, 1, 1]]}}
    found = {e.name: e for e in effects.decide(made(meshes=[far]), report)}
    assert not found["transfer"].called
    assert decided(made(meshes=[far]), "transfer").called


def test_more_lights_than_meshes_take_are_refused() -> None:
    sun = {"type": "sun", "to_light": [0, 1, 0], "irradiance": [1, 1, 1]}
    sky = {"type": "environment", "source": "a.exr"}
    most = [sun] * effects.MOST_LIGHTS + [sky]
    assert decided(made(meshes=[ROCK], lights=most), "surface").called
    with pytest.raises(InputError, match="lights") as refusal:
        effects.decide(made(meshes=[ROCK], lights=[*most, sun]))
    assert refusal.value.value == effects.MOST_LIGHTS + 1
    # Sprites take any number
    assert effects.decide(made(lights=[*most, sun]))


# Out of view

LAYOUT = {"metres_per_texel": 0.1, "height": 2.0, "pivot": [5, 20], "lens_scale": 1.0}


def test_sprites_and_meshes_out_of_every_view_are_left_out() -> None:
    report = {"kind": "billboard", "layout": LAYOUT, "size": [10, 24]}
    known = {"billboard/oak": report, "mesh/rock": {"bounds": [[-1, 0, -1], [1, 2, 1]]}}

    def called(z: float, **parts: Any) -> list[bool]:
        sprites = [{**SPRITES, "positions": [[0, 0, z]]}]
        found = made(billboards=sprites, meshes=[{**ROCK, "position": [0, 0, z]}], **parts)
        both = {e.name: e.called for e in effects.decide(found, known)}
        return [both["billboard"], both["surface"]]

    # The camera stands at z = 10 and looks the other way
    assert called(0.0) == [True, True]
    assert called(30.0) == [False, False]
    assert called(11.0) == [True, True]
    # Shadows reach into the view; a lens over meshes blurs what stands behind them
    assert called(30.0, ground={}) == [True, False]
    assert called(30.0, lens=lens()) == [False, True]
    # What is not baked may be of any size
    assert decided(made(meshes=[{**ROCK, "position": [0, 0, 30]}]), "surface").called


def test_the_ground_blurs_where_no_sprite_does() -> None:
    far = {**SPRITES, "positions": [[0, 0, 30]]}
    found = made(billboards=[far], lens=lens(), ground={})
    effect = decided(found, "depth_of_field")
    assert effect.called
    assert "the ground" in effect.reason
    assert not decided(made(billboards=[far], lens=lens()), "depth_of_field").called


def test_a_filter_wider_than_two_texels_calls_for_the_lens_sooner() -> None:
    circle = float(optics.circle_of_confusion(10.0, 0.05, 2.0, 5.0))
    lines = int(0.5 * 0.024 / circle)
    wide = {"billboard/oak": {"layout": {**LAYOUT, "lens_scale": 2.5}}}
    found = made(lens=lens())
    for reports, called in (({}, False), (wide, True)):
        plan = {e.name: e for e in effects.decide(found, reports, lines)}
        assert plan["depth_of_field"].called is called
