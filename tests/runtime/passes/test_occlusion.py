"""The shadow pass against numpy, pixel by pixel; what it must leave alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from formats.mesh import Material
from formats.scene import NEAR
from maths import spherical_lights as sl
from runtime.camera import Camera
from runtime.passes.occlusion import LEAST, window
from runtime.player import Player
from tests.runtime.shadow_truth import ball_volume, bands_volume, seen, small_box

pytestmark = pytest.mark.gpu
SIZE = (64, 40)
CAMERA = {"position": [1.0, 3.0, 5.0], "target": [0.2, 0, -0.3], "focal_length_mm": 30}
SUN = {"type": "sun", "to_light": [-0.6, 1, 0.5], "irradiance": [3, 2, 1], "angular_diameter": 20}
BALLS = [
    {"type": "sphere", "position": [-2, 2.0, 1], "radius": 0.5, "radiance": [9, 4, 2]},
    {"type": "sphere", "position": [2, 1.5, -1], "radius": 0.4, "radiance": [2, 4, 12]},
]
PLACE = {"position": [0.2, 0.9, 0], "rotation": [30, 50, 80], "scale": 0.8}
BLACK = Material("black", (0.0, 0.0, 0.0))


def thing(name="thing", shadow=None, **more):
    return {"name": name, "source": f"meshes/{name}.glb", "shadow": shadow or {}, **PLACE, **more}


@pytest.fixture
def played(kit, write_scene, ctx):
    """Return played(raw, assets, off) -> a player; off : passes that are not called."""
    made = []

    def play(raw, assets, *off):
        called = tuple(name for name in kit.called_for(raw) if name not in off)
        folder = write_scene(raw, assets, called=called, name=f"scene{len(made)}")
        made.append(Player(folder, size=SIZE, context=ctx))
        return made[-1]

    yield play
    for player in made:
        player.close()


def described(kit, meshes, **more):
    more = {"lights": [SUN, *BALLS], "camera": CAMERA, **more}
    return kit.scene_dict(billboards=None, meshes=meshes, **more)


def seen_at(player):
    """World points (h, w, 3) of what pixels show, as the pass finds them: by one sample's depth."""
    camera = Camera.of_scene(player.scene, 0.0)
    (width, height), depth = SIZE, player.targets.texture("depth").read(alignment=1)
    z = np.frombuffer(depth, np.float32).reshape(height, width)[::-1, :, None].astype(np.float64)
    x = 2 * (np.arange(width) + 0.5) / width - 1
    y = 1 - 2 * (np.arange(height) + 0.5) / height
    screen = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1)
    rays = screen @ camera.world_from_ray(width / height).T
    return camera.position + rays * (NEAR / np.maximum(1 - z, 1e-9))


def on_ground(player):
    """World points (n, 3) of the ground in the pixels (h, w) that show it."""
    camera = Camera.of_scene(player.scene, 0.0)
    width, height = SIZE
    x = 2 * (np.arange(width) + 0.5) / width - 1
    y = 1 - 2 * (np.arange(height) + 0.5) / height
    screen = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1)
    rays = screen @ camera.world_from_ray(width / height).T
    shown = rays[..., 1] < -1e-3
    down = rays[shown]
    return camera.position + down * (-camera.position[1] / down[:, 1:2]), shown


def all_lights(player, l_max):
    lights = player.lights

    def at(point):
        (sun,) = lights.suns
        found = sl.project_sun(sun.to_light, sun.irradiance, l_max, angular_radius=sun.radius)
        for ball in lights.spheres:
            found = found + sl.project_sphere(
                point, ball.position, ball.radius, ball.radiance, l_max
            )
        return found

    return at


@pytest.mark.parametrize(
    ("shadow", "depth"),
    [
        ({}, 8),
        ({"coloured": False}, 8),
        ({"falloff": False}, 8),
        ({"falloff": False, "coloured": False}, 16),
        ({}, 16),
    ],
)
@pytest.mark.parametrize("l_max", [1, 4])
def test_the_shadow_on_the_ground_is_that_of_numpy(kit, played, shadow, depth, l_max):
    volume = ball_volume(small_box(), l_max=l_max, depth=depth, radius=0.9)
    raw = described(kit, [thing(shadow=shadow)], ground={"albedo": [0.8, 0.8, 0.8]})
    assets = {"thing": kit.quad(), "shadow-thing": volume}
    dark = played(raw, assets, "surface")
    found = dark.linear(0.0)[..., :3]
    bright = played(raw, assets, "surface", "occlusion").linear(0.0)[..., :3]
    points, shown = on_ground(dark)
    expected = seen(volume, dark.scene.meshes[0], all_lights(dark, l_max), points)
    share = found[shown] / bright[shown]
    assert expected.min() < 0.7
    # Two half floats of 2^-12 each, and what is under half a code of white where it ends
    least = 0.0 if shadow.get("falloff") is False else LEAST
    error = np.abs(share - expected)
    assert error.max() < 2 * 2.0**-11 + least
    near = expected.min(axis=1) < 1 - 2 * LEAST
    assert near.sum() > 100
    assert error[near].max() < 0.5 / 255


@pytest.mark.parametrize("shadow", [{}, {"coloured": False}, {"falloff": False}])
@pytest.mark.parametrize(("l_max", "depth"), [(2, 8), (7, 8), (3, 16)])
def test_two_grids_finer_in_the_middle_are_those_of_numpy(kit, played, shadow, l_max, depth):
    volume = bands_volume(small_box(), l_max, radius=0.9, depth=depth)
    raw = described(kit, [thing(shadow=shadow)], ground={"albedo": [0.8, 0.8, 0.8]})
    assets = {"thing": kit.quad(), "shadow-thing": volume}
    dark = played(raw, assets, "surface")
    found = dark.linear(0.0)[..., :3]
    bright = played(raw, assets, "surface", "occlusion").linear(0.0)[..., :3]
    points, shown = on_ground(dark)
    expected = seen(volume, dark.scene.meshes[0], all_lights(dark, l_max), points)
    error = np.abs(found[shown] / bright[shown] - expected)
    assert expected.min() < 0.7
    # As on one grid
    assert error.max() < 2 * 2.0**-11 + LEAST
    near = expected.min(axis=1) < 1 - 2 * LEAST
    assert near.sum() > 100
    assert error[near].max() < 0.5 / 255


@pytest.mark.parametrize("shadow", [{}, {"coloured": False}, {"falloff": False}])
@pytest.mark.parametrize("on", ["ground", "over a card", "card"])
def test_a_receiver_loses_of_what_its_normal_faces(kit, played, shadow, on):
    """The ground alone, the ground over a card that lies deep under it, a tilted card."""
    volume = ball_volume(small_box(), l_max=3, radius=0.9)
    raw = described(kit, [thing(shadow={**shadow, "receiver_normal": True})])
    turn, position = ([10, 25, 5], [0, 0, -1.5]) if on == "card" else ([-60, 20, 0], [0, -8, -3])
    card = {"name": "card", "source": "meshes/card.glb", "rotation": turn, "position": position}
    assets = {"thing": kit.quad(), "card": kit.quad(half=5), "shadow-thing": volume}
    off = ("surface",) if on == "ground" else ()
    if not off:
        raw["meshes"].append(card)
    if on != "card":
        raw["ground"] = {"albedo": [0.8, 0.8, 0.8]}
    dark, bright = played(raw, assets, *off), played(raw, assets, *off, "occlusion")
    assert dark.passes["occlusion"].reads == ("depth", *(() if off else ("id", "normal")))
    found, lit = (each.linear(0.0)[..., :3] for each in (dark, bright))
    normal, mesh = np.array([0.0, 1.0, 0.0]), np.full(SIZE[::-1], 2)
    if on == "card":
        normal = dark.scene.meshes[1].world_from_mesh(0.0)[:3, 2]
    if not off:
        mesh = numbers(dark)
        assert (mesh == 2).sum() > 300
    # Off the edges of the caster, which stands before all, and of the card where it is seen
    wanted = mesh == 2 if on == "card" else mesh != 1
    plain = minimum_filter(wanted, 3) & (lit.min(axis=-1) > 0.02)
    at = seen_at(dark)[plain]
    normals = np.repeat(normal[None], len(at), axis=0)
    placed = dark.scene.meshes[0]
    expected = seen(volume, placed, all_lights(dark, 5), at, normals=normals)
    without = seen(volume, placed, all_lights(dark, 3), at)
    assert len(at) > 1000
    assert np.abs(expected - without).max() > 0.02
    assert expected.min() < 0.85
    # Two half floats of 2^-12 each, a card's normal of as many bits over a thirtieth or more, and
    # what is left out where the shadow ends: measured .25 / 255
    assert np.abs(found[plain] / lit[plain] - expected).max() < 0.5 / 255


def test_samples_of_an_edge_are_darkened_where_they_are_no_sky(kit, played):
    """A caster all around takes all light: what is left is the sky's share of each pixel."""
    volume = ball_volume(small_box((4.0, 4.0, 4.0), (0.0, 0.0, 0.0)), l_max=0)
    volume.volumes[:] = 255
    sky = {"sky": {"zenith": [0.2, 0.4, 0.8], "horizon": [0.7, 0.7, 0.7]}}
    camera = {"position": [0, 1.0, 5.0], "target": [0, 0.8, 0], "focal_length_mm": 30}
    raw = described(
        kit,
        [thing(shadow={"falloff": False, "self": True}), thing("card", rotation=[0, 0, 20])],
        ground={},
        picture={**sky, "film": {"tonemap": "linear"}},
        camera=camera,
    )
    del raw["meshes"][1]["shadow"]
    assets = {"thing": kit.quad(), "card": kit.quad(), "shadow-thing": volume}
    volume.scales[:] = 20.0
    found = played(raw, assets).linear(0.0)
    painted = {**assets, "thing": kit.quad(BLACK), "card": kit.quad(BLACK)}
    black = {**raw, "ground": {"albedo": [0, 0, 0]}}
    expected = played(black, painted, "occlusion").linear(0.0)
    np.testing.assert_array_equal(found, expected)
    edges = (found[..., 2] > 0.01) & (found[..., 2] < 0.65)
    assert edges.sum() > 10


def test_samples_of_an_edge_take_the_shadow_of_their_own_surface(kit, played):
    """A caster takes all light but its own: what lies behind its edges is black in each sample."""
    # The wall lies outside the caster's own box
    volume = ball_volume(small_box((1.4, 1.4, 1.4), (0.0, 0.0, 0.0)), l_max=0)
    volume.volumes[:] = 255
    volume.scales[:] = 20.0
    wall = {"name": "wall", "source": "meshes/wall.glb", "position": [0, 0, -2]}
    raw = described(kit, [thing(rotation=[0, 0, 20], shadow={"falloff": False}), wall])
    assets = {"thing": kit.quad(), "wall": kit.quad(half=9), "shadow-thing": volume}
    found = played(raw, assets).linear(0.0)[..., :3]
    painted = {**assets, "wall": kit.quad(BLACK, half=9)}
    expected = played(raw, painted, "occlusion").linear(0.0)[..., :3]
    lit = expected.max()
    edges = (expected.max(axis=-1) > 0.05 * lit) & (expected.max(axis=-1) < 0.7 * lit)
    assert edges.sum() > 20
    np.testing.assert_array_equal(found, expected)


def numbers(player):
    """Numbers (h, w) of the meshes that pixels show, as the pass reads them."""
    width, height = SIZE
    data = np.frombuffer(player.targets.texture("id").read(alignment=1), np.int32)
    return data.reshape(height, width)[::-1]


def test_emission_is_not_darkened_and_the_caster_itself_is_left_out(kit, played):
    plain, glow = Material("p", (0.8, 0.7, 0.6)), np.array([0.5, 1.0, 2.0])
    glowing = Material("g", (0.8, 0.7, 0.6), emissive=tuple(glow))
    volume = ball_volume(small_box(), l_max=2)
    below = {"name": "floor", "source": "meshes/floor.glb", "rotation": [-90, 0, 0], "scale": 3}

    def player(material, own=False, *off):
        raw = described(kit, [thing(shadow={"self": own}), below])
        assets = {"thing": kit.quad(material), "floor": kit.quad(material), "shadow-thing": volume}
        return played(raw, assets, *off)

    players = player(plain, False, "occlusion"), player(plain), player(plain, True), player(glowing)
    lit, dark, own, bright = (each.linear(0.0)[..., :3] for each in players)
    mesh = numbers(players[1])
    inner, outer = minimum_filter(mesh, 3), maximum_filter(mesh, 3)
    thing_itself, floor = (inner == outer) & (mesh == 1), (inner == outer) & (mesh == 2)
    assert thing_itself.sum() > 50
    assert floor.sum() > 200
    # Two half floats of what is there
    added = np.abs(bright - dark - glow)[thing_itself | floor]
    assert added.max() < 2.0**-11 * 2 * bright.max()
    # Where no mesh is nothing changes, whatever is cast
    for each in (dark, own):
        np.testing.assert_array_equal(each[outer == 0], lit[outer == 0])
    np.testing.assert_array_equal(dark[thing_itself], lit[thing_itself])
    assert (own < 0.99 * lit).any(axis=-1)[thing_itself].mean() > 0.8
    assert (dark < 0.97 * lit)[floor].any(axis=-1).mean() > 0.05


def test_several_casters_multiply(kit, played):
    volume = ball_volume(small_box(), l_max=3)
    two = [thing(), thing("other", position=[-0.8, 1.0, 0.4])]
    assets = {"thing": kit.quad(), "other": kit.quad()}
    assets |= {"shadow-thing": volume, "shadow-other": volume}
    off = ("surface",)
    both = played(described(kit, two, ground={}), assets, *off).linear(0.0)
    raw = described(kit, two, ground={})
    bright = played(raw, assets, *off, "occlusion").linear(0.0)
    product = bright.copy()
    for each in two:
        alone = played(described(kit, [each], ground={}), assets, *off).linear(0.0)
        lit = bright > 0
        product[lit] *= alone[lit] / bright[lit]
    # Three half floats
    np.testing.assert_allclose(both, product, rtol=3 * 2.0**-11)


def test_a_moving_caster_is_drawn_again_and_a_still_one_not(kit, played):
    moving = {"times": [0, 1, 2], "values": [[0, 1, 0], [0, 1, 0], [1, 1, 0]]}
    raw = described(kit, [thing(position=moving)], ground={}, time={"duration": 2.0})
    assets = {"thing": kit.quad(), "shadow-thing": ball_volume(small_box())}
    for off in ((), ("surface",)):
        kept, fresh = played(raw, assets, *off), played(raw, assets, *off)
        fresh.reuse = False
        for time in (0.0, 0.5, 1.5, 1.75, 0.5, 0.25):
            np.testing.assert_array_equal(kept.linear(time), fresh.linear(time))
        assert "occlusion" in kept.skipped


def test_the_price_is_the_same_for_any_number_of_lights(kit, played):
    assets = {"thing": kit.quad(), "shadow-thing": ball_volume(small_box())}
    found = []
    for count in (1, 40):
        many = [{**BALLS[0], "position": [i, 4, 0]} for i in range(count)]
        player = played(described(kit, [thing()], lights=many), assets, "surface")
        player.draw(0.0)
        found.append(
            (player.profile["by_pass"]["occlusion"], player.passes["occlusion"].weights(0)[0].shape)
        )
    assert found[0] == found[1]
    assert found[0][0]["draw_calls"] == 1


def test_the_window_holds_the_ball():
    rng, whole, none = np.random.default_rng(0), 0, 0
    for _ in range(300):
        camera = Camera(rng.normal(size=3) * 4, rng.normal(size=3))
        middle, radius = rng.normal(size=3) * 3, rng.uniform(0.05, 2)
        d = rng.normal(size=(200, 3))
        points = middle + radius * d / np.linalg.norm(d, axis=1, keepdims=True)
        clip = np.column_stack([points, np.ones(200)]) @ camera.clip_from_world(1.6).T
        ahead = clip[:, 3] > 0.1
        pixels = (0.5 + 0.5 * clip[ahead, :2] / clip[ahead, 3:]) * SIZE
        shown = np.all((pixels >= 0) & (pixels <= SIZE), axis=1)
        found = window(camera, SIZE, middle, radius)
        if found is None:
            none += 1
            assert not shown.any()
            continue
        low = np.array(found[:2])
        assert np.all((pixels[shown] >= low) & (pixels[shown] <= low + found[2:]))
        whole += found == (0, 0, *SIZE)
    assert 10 < none < 200
    assert 10 < whole < 200
