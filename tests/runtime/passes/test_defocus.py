"""The lens on opaque things against the same scene added up over the points of the aperture."""

from __future__ import annotations

import numpy as np
import pytest

from formats.mesh import Material
from maths import colour, optics
from runtime.camera import Camera
from runtime.player import Player
from tests.runtime import lens_truth

pytestmark = pytest.mark.gpu
SIZE = (160, 90)
POINTS = 64  # of the aperture: 256 move no PSNR below by more than .3 dB, measured
RED, GREY = (0.8, 0.05, 0.05), (0.3, 0.3, 0.3)
FILM = {"film": {"tonemap": "linear"}}
SUN = [{"type": "sun", "to_light": [0.3, 0.6, 0.7], "irradiance": [3, 3, 3]}]
GROUND = {"height": 0.0, "albedo": [0.35, 0.3, 0.2], "accent": [0.1, 0.2, 0.05], "scale": 0.3}
SKY = {"zenith": [0.2, 0.4, 0.9], "horizon": [0.8, 0.8, 0.9]}


def camera(focus, f_number, *, focal=85, **more):
    lens = {"f_number": f_number, "focus_distance": focus}
    level = {"position": [0, 1.2, 0], "target": [0, 1.2, -1], "focal_length_mm": focal}
    return {**level, "lens": lens, **more}


def placed(name, position, rotation=(0, 0, 20), scale=1.0):
    place = {"position": list(position), "rotation": list(rotation), "scale": scale}
    return {"name": name, "source": f"meshes/{name}.glb", **place}


def checks(kit, count, half):
    """A board of light and dark squares."""
    e = np.linspace(-half, half, count + 1)
    i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
    i, j = i.ravel(), j.ravel()
    a, b, c, d = (
        np.stack([e[i + di], e[j + dj], 0 * e[i]], axis=-1)
        for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    triangles = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3, 3)
    light = np.where((i + j) % 2, 0.8, 0.1)
    colours = np.broadcast_to(np.repeat(light, 2)[:, None, None], triangles.shape)
    return kit.flat_mesh(triangles, colours=colours)


def scenes(kit):
    """name -> (camera, meshes, sprites, assets, with a ground)."""
    red = kit.quad(Material(base_color=RED), half=0.3)
    blue = kit.quad(Material(base_color=(0.05, 0.1, 0.8)), half=0.3)
    near, sharp = placed("red", (-0.1, 1.2, -1.3), scale=0.4), placed("blue", (0.2, 1.2, -2.5))
    board = placed("board", (0, 1.2, -9), (0, 0, 0))
    low = camera(3.0, 0.7, focal=50, position=[0, 0.8, 0], target=[0, 0.55, -2])
    stand = placed("red", (-0.15, 0.5, -1.0), scale=0.35)
    upright = placed("blue", (0.55, 0.3, -3.0), (0, 40, 0))
    balls = [[-0.4, 0, -3.0], [0.15, 0, -3.0], [-0.05, 0, -1.5]]
    return {
        "sharp over blurred": (
            camera(2.5, 0.75),
            [placed("blue", (0.2, 1.2, -2.5)), board],
            None,
            {"blue": blue, "board": checks(kit, 16, 3)},
            False,
        ),
        "blurred over sharp": (
            camera(4.0, 0.75),
            [near, placed("board", (0, 1.2, -4), (0, 0, 0))],
            None,
            {"red": red, "board": checks(kit, 16, 1.6)},
            False,
        ),
        "both": (
            camera(2.5, 0.75),
            [near, sharp, board],
            None,
            {"red": red, "blue": blue, "board": checks(kit, 16, 3)},
            False,
        ),
        "ground": (low, [stand, upright], None, {"red": red, "blue": blue}, True),
        "sprites": (
            low,
            [stand, upright],
            balls,
            {"red": red, "blue": blue, "ball": kit.sphere_asset()},
            True,
        ),
        "sprites behind what is blurred behind": (
            camera(0.8, 0.7, focal=50, position=[0, 0.8, 0], target=[0, 0.55, -2]),
            [placed("blue", (0.05, 0.55, -2.0))],
            [[-0.5, 0.05, -4.5], [0.2, 0.4, -4.4], [0.8, 0.05, -4.5]],
            {"blue": blue, "ball": kit.sphere_asset()},
            True,
        ),
    }


@pytest.fixture
def shown(kit, write_scene, ctx):
    """Return shown(camera, meshes, balls, assets, ground) -> (ours, sharp, truth, depth)."""
    count = iter(range(100))

    def show(view, meshes, balls, assets, ground, truth=True):
        raw = {"format": 1, "camera": view, "lights": SUN, "meshes": meshes, "picture": dict(FILM)}
        if balls:
            ball = {"name": "ball", "source": "meshes/ball.glb", "height": 0.5, "positions": balls}
            raw["billboards"] = [ball]
        if ground:
            raw |= {"ground": GROUND, "picture": FILM | {"sky": SKY}}
        called = kit.called_for(raw)
        with Player(write_scene(raw, assets, name=f"a{next(count)}"), size=SIZE, context=ctx) as p:
            ours = p.linear(0.0)[..., :3].astype(np.float64)
        plain = [name for name in called if name not in ("defocus", "depth_of_field")]
        folder = write_scene(raw, assets, called=plain, name=f"b{next(count)}")
        with Player(folder, size=SIZE, context=ctx) as p:
            sharp = p.linear(0.0)[..., :3].astype(np.float64)
            found = np.frombuffer(p.targets.texture("depth").read(alignment=1), np.float32)
            depth = found.reshape(SIZE[::-1])[::-1].astype(np.float64)
            added = lens_truth.accumulate(p, POINTS) if truth else None
        return ours, sharp, added, depth

    return show


def psnr(picture, truth):
    codes = [255 * colour.srgb_encode(np.clip(x, 0, 1)) for x in (picture, truth)]
    return 10 * np.log10(255**2 / np.mean((codes[0] - codes[1]) ** 2))


def plain_gather(sharp, depth, view):
    """What a gather makes that takes each pixel's own circle and asks nothing else."""
    lens = view["focal_length_mm"] / 1e3, view["lens"]["f_number"], view["lens"]["focus_distance"]
    distance = 0.1 / np.maximum(1 - depth, 1e-9)
    circle = optics.pixels(optics.circle_of_confusion(distance, *lens), SIZE[1], 0.024)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    total = np.zeros_like(sharp)
    for across, down in lens_truth.points(64):
        rows = np.clip(np.rint(y + down * circle / 2), 0, SIZE[1] - 1).astype(int)
        total += sharp[rows, np.clip(np.rint(x + across * circle / 2), 0, SIZE[0] - 1).astype(int)]
    return total / 64


@pytest.mark.parametrize(
    ("name", "least", "over_plain"),
    # Measured, less half a decibel; what is missing is what hides, or stands beyond the border
    [
        ("sharp over blurred", 33.3, 2.0),
        ("blurred over sharp", 32.5, 5.0),
        ("both", 31.3, 2.5),
        ("ground", 36.8, 1.5),
        ("sprites", 36.3, 2.0),
        ("sprites behind what is blurred behind", 37.3, 0.3),
    ],
)
def test_it_is_close_to_the_lens(kit, shown, name, least, over_plain):
    described = scenes(kit)[name]
    ours, sharp, truth, depth = shown(*described)
    assert psnr(ours, truth) > least
    assert psnr(ours, truth) > psnr(sharp, truth) + 5
    assert psnr(ours, truth) > psnr(plain_gather(sharp, depth, described[0]), truth) + over_plain


def test_circles_of_half_a_pixel_change_no_byte(kit, shown):
    described = list(scenes(kit)["sprites"])
    # c at infinity, A f / (d_f - f) in pixels, is the largest but for the red one at 1 m
    described[0] = camera(3.0, 1.0, focal=50, position=[0, 0.8, 0], target=[0, 0.55, -2])
    lens = 0.05, 1.0, 3.0
    largest = optics.pixels(optics.circle_of_confusion([0.85, 1e9], *lens), SIZE[1], 0.024).max()
    described[0]["lens"]["f_number"] = float(largest / 0.49)
    described[2] = None
    ours, sharp, _, _ = shown(*described, truth=False)
    np.testing.assert_array_equal(ours, sharp)
    described[0]["lens"]["f_number"] = float(largest / 2)
    ours, sharp, _, _ = shown(*described, truth=False)
    assert np.abs(ours - sharp).max() > 0.01


def test_neither_side_of_an_edge_bleeds(kit, shown):
    """A red square in focus before grey far behind it, then the other way round."""
    red = kit.quad(Material(base_color=RED), half=0.3)
    grey = kit.quad(Material(base_color=GREY), half=9)
    assets = {"red": red, "grey": grey}
    back = placed("grey", (0, 1.2, -12), (0, 0, 0))
    view = camera(2.0, 0.75)
    ours, sharp, _, _ = shown(view, [placed("red", (0, 1.2, -2)), back], None, assets, False, False)
    is_red = sharp[..., 0] > 1.5 * sharp[..., 1]
    clean = np.ones_like(is_red)
    clean[2:-2, 2:-2] = False
    pad = np.pad(is_red, 2, mode="edge")
    h, w = is_red.shape
    around = np.stack([pad[y : y + h, x : x + w] for y in range(5) for x in range(5)])
    # Two pixels off the edge there is no red in the grey and no grey in the red: the half floats
    # of colour, layers, sums and weights round by 2^-11 each
    for where in (around.any(axis=0) == 0, around.all(axis=0)):
        assert where.sum() > 500
        np.testing.assert_allclose(ours[where], sharp[where], rtol=5 * 2.0**-11)

    # Before focus the red reaches out by its own radius, and no farther
    view = camera(4.0, 0.9)
    back = placed("grey", (0, 1.2, -4), (0, 0, 0))
    red_near = placed("red", (0, 1.2, -1.6), scale=0.5)
    ours, sharp, _, _ = shown(view, [red_near, back], None, assets, False, False)
    lens = 0.085, 0.9, 4.0
    radius = float(optics.pixels(optics.circle_of_confusion(1.6, *lens), SIZE[1], 0.024)) / 2
    assert radius > 5
    is_red = sharp[..., 0] > 1.5 * sharp[..., 1]
    y, x = np.nonzero(is_red)
    py, px = np.mgrid[:h, :w]
    away = np.sqrt(((py[..., None] - y) ** 2 + (px[..., None] - x) ** 2).min(axis=-1))
    # Half-size texels and their ramp end within three pixels more
    beyond = away > radius + 3
    assert beyond.sum() > 500
    np.testing.assert_array_equal(ours[beyond], sharp[beyond])
    redness = ours[..., 0] - ours[..., 1]
    just_outside = (away > 0) & (away < radius - 2)
    assert redness[just_outside].min() > 0.01

    # What the red gives away around it, it lacks inside: light is kept
    share = redness / np.median(redness[is_red & (redness > 0.9 * redness.max())])
    assert share.sum() == pytest.approx(is_red.sum(), rel=0.02)


@pytest.mark.parametrize("radius", [0.4, 0.8, 1.5])
def test_a_front_that_hardly_blurs_hides_a_bright_background(kit, shown, radius):
    red = kit.quad(Material(base_color=RED), half=0.3)
    bright = kit.quad(Material(base_color=GREY, emissive=(50.0, 50.0, 50.0)), half=9)
    # c (1 - d_f / d) = -radius at 2 m, in front of focus at 2.2 m
    lens = 0.085, 1.0, 2.2
    wide = optics.pixels(optics.circle_of_confusion(2.0, *lens), SIZE[1], 0.024) / 2
    back = placed("bright", (0, 1.2, -12), (0, 0, 0))
    view = camera(2.2, float(wide / radius))
    assets = {"red": red, "bright": bright}
    ours, sharp, _, _ = shown(view, [placed("red", (0, 1.2, -2)), back], None, assets, False, False)
    pad = np.pad(sharp[..., 0] < 2, 5)
    h, w = sharp.shape[:2]
    inside = np.all([pad[y : y + h, x : x + w] for y in range(11) for x in range(11)], axis=0)
    assert inside.sum() > 300
    # Half floats of colour, layers and sums round by 2^-11 each; one hundredth of the light behind
    # would double the red
    np.testing.assert_allclose(ours[inside], sharp[inside], rtol=5 * 2.0**-11)


def test_it_has_five_programs_and_follows_the_size(kit, write_scene, ctx):
    view, meshes, _, assets, _ = scenes(kit)["blurred over sharp"]
    raw = {"format": 1, "camera": view, "lights": SUN, "meshes": meshes, "picture": FILM}
    counts = {}
    for called in (("surface", "film"), ("surface", "defocus", "film")):
        folder = write_scene(raw, assets, called=called, name="-".join(called))
        with Player(folder, size=SIZE, context=ctx) as player:
            first = player.frame(0.0)
            counts[called] = player.programs.count
            textures = player.targets.texture_count
            player.targets.resize((203, 77))
            other = player.frame(0.0)
            assert other.shape == (77, 203, 4)
            player.targets.resize(SIZE)
            np.testing.assert_array_equal(player.frame(0.0), first)
            assert player.targets.texture_count == textures
    assert counts["surface", "defocus", "film"] - counts["surface", "film"] == 5


def test_the_truth_keeps_what_is_in_focus_where_it_is():
    view = Camera(np.array([0.0, 1, 0]), np.array([0.3, 1.2, -1]), f_number=1.0, focus_distance=3.0)
    off = lens_truth.PointOfLens(**vars(view), off=(0.02, -0.01))
    rays = np.array([[0.2, -0.4, 1.0], [-0.9, 0.7, 1.0]]).T
    for distance, same in ((3.0, True), (1.5, False)):
        start = off.position + 0.02 * off.right - 0.01 * off.view_from_world[1, :3]
        seen = start[:, None] + distance * off.world_from_ray(16 / 9) @ rays
        expected = view.position[:, None] + distance * view.world_from_ray(16 / 9) @ rays
        assert np.allclose(seen, expected, atol=1e-12) == same
        clip = off.clip_from_world(16 / 9) @ np.vstack([seen, np.ones(2)])
        np.testing.assert_allclose(clip[:2] / clip[3], rays[:2], atol=1e-12)
