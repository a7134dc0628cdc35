"""Particles drawn: where the closed form has them, sorted among sprites, and as round as a lens."""

from __future__ import annotations

import numpy as np
import pytest

from maths import discs, particles
from runtime.player import Player

pytestmark = pytest.mark.gpu
W, H = 96, 72
LENS = {"f_number": 1.4, "focus_distance": 1.0}


def puff(name="puff", look=None, **emitter):
    born = {"seed": 3, "rate": 4.0, "lifetime": [1, 2], "centre": [0, 0, 0], **emitter}
    look = {"radius": 0.1, "fade": [0, 0], **(look or {})}
    return {"name": name, "emitter": {"half_size": [1, 0.6, 0], **born}, "look": look}


# One alone, of a rate of 0.5 and lives of 1 to 1.01 s
LONE = {"rate": 0.5, "lifetime": [1, 1.01], "half_size": [0, 0, 0]}
ALONE = next(
    t for t in np.arange(0, 9, 0.1) if len(particles.alive(3, 0.5, (1, 1.01), t).index) == 1
)


def raw(kit, *found, lens=None, **parts):
    camera = {"position": [0, 0, 4], "target": [0, 0, 0], "focal_length_mm": 40}
    camera |= {"lens": lens} if lens else {}
    base = {"camera": camera, "lights": [], "billboards": None, "time": {"duration": 9}}
    return kit.scene_dict(**{**base, "particles": list(found), **parts})


@pytest.fixture
def played(kit, write_scene, ctx):
    """Return played(raw, times, assets) -> linear pictures (n, h, w, 3)."""
    count = iter(range(100))

    def play(raw, times=(1.0,), assets=None, size=(W, H), reuse=True):
        folder = write_scene(raw, assets or {}, name=f"scene{next(count)}")
        with Player(folder, size=size, context=ctx) as player:
            player.reuse = reuse
            return np.stack([player.linear(t)[..., :3] for t in times])

    return play


def where(size=(W, H), away=4.0):
    """Metres (h, w, 2) of the plane z = 0 at the middle of each pixel."""
    tall = 0.024 / 0.04 * away
    x, y = ((np.arange(n) + 0.5) / n - 0.5 for n in size)
    return np.stack(np.meshgrid(x * tall * size[0] / size[1], -y * tall), axis=-1)


def truth(seed, time, radius=0.1, edge=0.8, blur=0.0, radiance=1.0):
    """The sum of all discs, straight from the closed forms."""
    alive = particles.alive(seed, 4.0, (1, 2), time)
    still = {"velocity": (0, 0, 0), "spread": (0, 0, 0), "acceleration": (0, 0, 0)}
    at = particles.positions(
        seed,
        alive,
        lambda born: np.zeros((len(born), 3)),
        (1, 0.6, 0),
        **still,
        drag=0,
        turbulence=0,
        turbulence_scale=1,
    )
    pixel = 0.6 * 4 / H
    mean, width, gain = discs.blurred(radius, edge, np.hypot(pixel, blur))
    r = np.linalg.norm(where()[None] - at[:, None, None, :2], axis=-1)
    return radiance * (gain * discs.profile(r, mean, width)).sum(axis=0), len(at)


def test_discs_shine_where_the_closed_form_has_them(kit, played):
    times = (0.0, 1.0, 7.25)
    found = played(raw(kit, puff(look={"radiance": [2, 1, 0.5]})), times)
    for picture, time in zip(found, times, strict=True):
        expected, count = truth(3, time)
        assert count > 2
        # Half floats, some layers of them
        np.testing.assert_allclose(picture[..., 0], 2 * expected, atol=6e-3)
        np.testing.assert_allclose(picture[..., 2], 0.5 * expected, atol=2e-3)
    assert np.abs(found[0] - found[2]).max() > 0.5


def test_a_lens_spreads_each_over_its_circle(kit, played):
    found = played(raw(kit, puff(), lens=LENS))[0, ..., 0]
    # f^2 / N / (focus - f) |1 - focus / d| on the sensor, d / f times that in the air, its half
    blur = 0.5 * 0.04**2 / 1.4 / 0.96 * 0.75 * 4 / 0.04
    expected, _ = truth(3, 1.0, blur=blur)
    np.testing.assert_allclose(found, expected, atol=4e-3)
    assert blur > 0.04


def test_seeking_is_playing_there(kit, played):
    scene = raw(
        kit,
        {
            **puff(rate=40.0),
            "motion": {"velocity": [0, 0.5, 0], "turbulence": 0.3, "drag": 0.2},
        },
    )
    playing = played(scene, [0.0, 0.5, 1.0, 1.5])
    seeking = played(scene, [1.5, 0.5, 1.0, 0.0], reuse=False)
    np.testing.assert_array_equal(playing[[3, 1, 2, 0]], seeking)
    assert np.abs(playing[0] - playing[1]).max() > 0.1


def test_a_particle_passes_behind_one_sprite_and_before_another(kit, played):
    """One disc between two opaque balls: hidden by the nearer one, over the farther one."""
    ball = kit.sphere_asset()
    one = puff(look={"radius": 0.3}, **LONE)
    sets = {
        z: [{"name": "ball", "source": "b.glb", "height": 1.0, "positions": [[0, -0.5, z]]}]
        for z in (-1, 1)
    }
    pictures = {}
    for z, billboards in sets.items():
        for lit in ([], [one]):
            scene = raw(kit, *lit, billboards=billboards)
            pictures[z, len(lit)] = played(scene, [ALONE], {"ball": ball})[0, H // 2, W // 2, 0]
    assert pictures[-1, 1] == pytest.approx(pictures[-1, 0] + 1, abs=0.01)
    assert pictures[1, 1] == pictures[1, 0]


def test_a_set_without_places_of_its_own_lends_its_sprites(kit, played):
    ball = kit.sphere_asset()
    lit = {"lights": [{"type": "sun", "to_light": [0, 0, 1], "irradiance": [3, 3, 3]}]}
    billboards = [{"name": "ball", "source": "b.glb", "height": 0.4}]
    look = {"radius": None, "billboard": "ball", "scale": 2.0}
    look = {key: value for key, value in look.items() if value is not None}
    one = puff(**LONE)
    one["look"] = {**look, "fade": [0, 0]}
    found = played(raw(kit, one, billboards=billboards, **lit), [ALONE], {"ball": ball})[0]
    fixed = [{**billboards[0], "positions": [[0, -0.4, 0]], "scale": [2.0]}]
    wanted = played(raw(kit, billboards=fixed, **lit), assets={"ball": ball})[0]
    # Its colours, in the middle of the emitter; it may be mirrored
    close = [np.abs(found - each).max() < 0.02 for each in (wanted, wanted[:, ::-1])]
    assert any(close)
    assert wanted.max() > 0.3


def test_those_behind_the_camera_or_dead_are_not_drawn(kit, played):
    assert played(raw(kit, puff(centre=[0, 0, 9]))).max() == 0
    assert played(raw(kit, puff(rate=0.0))).max() == 0


def test_soft_edges_fade_by_the_ramp_before_a_plane(kit, played):
    """A tilted plane through a wide even disc: the ramp of the gap is left at each pixel."""
    tilted = {"name": "wall", "source": "w.glb", "rotation": [0, 60, 0]}
    one = puff(**LONE)
    look = {"radius": 5.0, "edge": 0.0, "fade": [0, 0]}
    softness = 0.4
    pictures = [
        played(
            raw(kit, {**one, "look": {**look, "softness": soft}}, meshes=[tilted]),
            [ALONE],
            {"wall": kit.quad(half=9.0)},
        )[0, ..., 0]
        for soft in (0.0, softness)
    ]
    # The wall's depth along each ray: x cos + z sin = 0 of its normal (sin 60, 0, cos 60)
    slope = 0.024 / 0.04 * W / H * ((np.arange(W) + 0.5) / W - 0.5)
    depth = 4.0 / (1.0 - np.tan(np.radians(60)) * slope)
    gap = np.where(depth > 0, depth, np.inf) - 4.0
    t = np.clip(gap / softness, 0, 1)
    hard, soft = pictures
    inner = np.abs(gap) > 0.05
    shown = np.where(gap > 0, 1.0, 0.0)[None].repeat(H, 0)
    # A half float, cut off
    np.testing.assert_allclose(hard[:, inner], shown[:, inner], atol=1e-3)
    # Depth in 24 bits, one of four samples of the wall: a quarter of a pixel of a slope of .06 m
    expected = (t * t * (3 - 2 * t))[None].repeat(H, 0)
    np.testing.assert_allclose(soft, expected, atol=0.06)
    assert 0.2 < np.abs(hard - soft).max() <= 1.0


def test_softness_leaves_open_air_as_it_is(kit, played):
    look = {"softness": 0.5}
    plain, soft = (played(raw(kit, puff(look=extra))) for extra in ({}, look))
    np.testing.assert_array_equal(plain, soft)


def test_many_lit_particles_share_the_light_of_their_cell():
    from runtime.passes import billboard

    rng = np.random.default_rng(2)
    n = 3 * billboard.MOST_LIT

    class Many:
        centres = rng.normal(size=(n, 3)) * [1, 2, 3]
        flip = rng.random(n) < 0.5
        moving = True

    seen = np.arange(n)
    centres, flip, lit_as = billboard._places(Many, seen)
    assert len(centres) <= 2 * billboard.LIT_CELLS**3 < billboard.MOST_LIT
    size = np.ptp(Many.centres, axis=0) / billboard.LIT_CELLS
    assert np.all(np.abs(centres[lit_as] - Many.centres) <= size)
    np.testing.assert_array_equal(flip[lit_as], Many.flip)
    few = seen[: billboard.MOST_LIT]
    np.testing.assert_array_equal(billboard._places(Many, few)[0], Many.centres[few])
