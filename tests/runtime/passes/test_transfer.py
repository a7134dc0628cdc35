"""Meshes lit by transfer against the same sums in numpy, pixel by pixel; beside other meshes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from formats.errors import DamagedError
from formats.mesh import Material
from formats.transfer import Layout, Transfer
from maths import spherical_lights, transforms
from maths.spherical_rotation import rotate
from runtime import lighting
from runtime.camera import Camera
from runtime.player import Player
from tests.runtime.passes import test_surface as direct

pytestmark = pytest.mark.gpu
SIZE = direct.SIZE
HALF = direct.HALF


def asset_of(rng, mesh, *, depth=8, components=24, channels=3, l_max=3):
    """Random codes and a random basis on a mesh of separate triangles."""
    quads, K = -(-components // 4), (l_max + 1) ** 2
    if depth == 8:
        codes = rng.integers(1, 256, (len(mesh.vertices), 4 * quads)).astype(np.uint8)
    else:
        codes = rng.uniform(-1, 1, (len(mesh.vertices), 4 * quads)).astype(np.float16)
    scales = np.zeros(4 * quads, np.float32)
    scales[:components] = rng.uniform(0.5, 1, components)
    basis = rng.normal(size=(components, channels, K)) * 0.1
    # Bright enough that most of it is above 0
    codes[:, 0], basis[0, :, 0] = (255 if depth == 8 else 1), 3.0
    box = np.array([[-1.5, -1.1, -1.2], [1.5, 1.3, 1.0]])
    return Transfer(mesh, codes, Layout(scales, basis, box, depth))


def light_at(lights, point, l_max, maps):
    """Sum of all lights at a point, one by one (K, 3)."""
    total = np.zeros(((l_max + 1) ** 2, 3))
    for sun in lights.suns:
        total += spherical_lights.project_sun(
            sun.to_light, sun.irradiance, l_max, angular_radius=sun.radius
        )
    for ball in lights.spheres:
        place = ball.position, ball.radius, ball.radiance
        total += spherical_lights.project_sphere(point, *place, l_max)
    for disc in lights.discs:
        place = disc.position, disc.axis, disc.radius, disc.radiance
        total += spherical_lights.project_disc(point, *place, l_max, two_sided=disc.two_sided)
    for polygon in lights.polygons:
        total += spherical_lights.project_polygon(
            point, polygon.corners, polygon.radiance, l_max, two_sided=polygon.two_sided
        )
    for state in lights.environments:
        world = spherical_lights.project_environment(maps[state.index], l_max)
        total += rotate(world, transforms.rotation("y", state.rotate)) * state.factor
    return total


def shaded(scene, asset, t=0.0, maps=None):
    """Radiance (h, w, 3) of the one mesh, and the pixels it holds for."""
    placed, mesh, layout = scene.meshes[0], asset.mesh, asset.layout
    matrix = placed.world_from_mesh(t)
    points = layout.points @ matrix[:3, :3].T + matrix[:3, 3]
    lights = lighting.at(scene, t)
    world = np.stack([light_at(lights, point, layout.l_max, maps) for point in points])
    irradiance = asset.irradiance(rotate(world, np.linalg.inv(matrix[:3, :3] / placed.scale)))
    camera = Camera.of_scene(scene, t)
    corners, _ = direct.world_mesh(placed, mesh, t)
    face, weights = direct.cast(camera, corners)
    arrived = np.einsum("hwi,hwic->hwc", weights, irradiance[mesh.faces[face]])
    albedo = np.ones((*face.shape, 3))
    if mesh.colours is not None:
        albedo = np.einsum("hwi,hwic->hwc", weights, mesh.colours[mesh.faces[face]])
    emitted = np.zeros_like(albedo)
    for number, material in enumerate(mesh.materials):
        own = mesh.material[face] == number
        albedo[own] *= material.base_color
        emitted[own] = material.emissive
    radiance = albedo / np.pi * np.maximum(arrived, 0) + emitted
    return radiance, direct.away_from_edges(camera, corners)


@pytest.fixture
def played(write_scene, ctx):
    count = iter(range(10))

    def play(raw, assets, *, environment=None, t=0.0):
        name = f"scene{next(count)}"
        folder = write_scene(raw, assets, environment=environment, name=name)
        with Player(folder, size=SIZE, context=ctx) as player:
            return player.linear(t)[..., :3], player.scene

    return play


def lit(kit, places, lights, **more):
    return direct.stood(kit, {n: {"lighting": "transfer", **p} for n, p in places.items()}, lights,
                        **more)  # fmt: skip


@pytest.mark.parametrize(
    ("depth", "components", "channels"), [(8, 24, 3), (8, 3, 1), (16, 16, 1), (8, 32, 3)]
)
def test_moving_meshes_under_all_lights_shade_as_numpy_does(
    kit, played, rng, depth, components, channels
):
    turning = {"times": [0, 2], "values": [[0, 0, 0], [0, 90, 30]]}
    sliding = {"times": [0, 2], "values": [[0, 0, 0], [0.5, 0.2, -0.4]]}
    glow = Material("glow", (0.6, 0.5, 0.4), emissive=(0.1, 0.3, 0.2))
    mesh = direct.soup(kit, rng, 14, colours=rng.uniform(0.2, 1, (42, 3)))
    mesh = replace(
        mesh, materials=(Material(), glow), material=(np.arange(14) % 2).astype(np.int32)
    )
    asset = asset_of(rng, mesh, depth=depth, components=components, channels=channels)
    lights = [*direct.LIGHTS, {"type": "environment", "source": "e.hdr", "rotate": 50}]
    raw = lit(kit, {"a": {"rotation": turning, "position": sliding, "scale": 1.2}}, lights)
    radiance = rng.uniform(0, 2, (16, 32, 3)).astype(np.float16).astype(np.float32)
    found, scene = played(raw, {"a": asset}, environment=radiance, t=1.3)
    index = len(lights) - 1
    expected, held = shaded(scene, asset, 1.3, {index: radiance})
    # Half floats, rounded when drawn and when averaged, and float32 of sums that cancel
    direct.assert_agree(found, expected, held, 3 * HALF)


def test_the_same_light_everywhere_makes_all_places_alike(kit, played, rng):
    asset = asset_of(rng, direct.soup(kit, rng, 14))
    raw = lit(kit, {"a": {}}, direct.LIGHTS[:1])
    found, scene = played(raw, {"a": asset})
    far = replace(asset, layout=replace(asset.layout, box=asset.layout.box * 10))
    expected, held = shaded(scene, far)
    direct.assert_agree(found, expected, held, 2 * HALF)


def test_beside_direct_meshes_nearest_wins_and_targets_hold_both(kit, write_scene, ctx, rng):
    soup = direct.soup(kit, rng, 14)
    asset = asset_of(rng, kit.quad(Material(), half=0.8))
    raw = direct.stood(
        kit,
        {"soup": {"scale": 0.8}, "wall": {"lighting": "transfer", "position": [0, 0, -0.2]}},
        [direct.LIGHTS[0]],
    )
    folder = write_scene(raw, {"soup": soup, "wall": asset})
    with Player(folder, size=SIZE, context=ctx) as player:
        assert player.called == ("surface", "transfer", "film")
        plain = player.linear(0.0)
        player.passes["reader"] = direct.reader("id")
        np.testing.assert_array_equal(player.linear(0.0), plain)
        data = player.targets.texture("id").read(alignment=1)
        scene = player.scene
    number = np.frombuffer(data, "i4").reshape(SIZE[1], SIZE[0])[::-1]
    placed = [
        direct.world_mesh(p, m)[0] for p, m in zip(scene.meshes, (soup, asset.mesh), strict=True)
    ]
    corners, camera = np.concatenate(placed), Camera.of_scene(scene, 0.0)
    face, _ = direct.cast(camera, corners)
    held = direct.away_from_edges(camera, corners)
    owner = np.where(face < len(placed[0]), 1, 2)
    assert {1, 2} == set(owner[held])
    np.testing.assert_array_equal(number[held], owner[held])


def test_each_side_of_a_double_sided_face_has_its_own_light(kit, played, rng):
    """A quad and its twin turned round: red light in front, blue behind; seen from both sides."""
    thin = Material(base_color=(1, 1, 1), double_sided=True)
    front = kit.quad(thin)
    back = kit.flat_mesh(front.vertices[front.faces][:, ::-1], thin)
    mesh = kit.flat_mesh(np.concatenate([m.vertices[m.faces] for m in (front, back)]), thin)
    codes = np.full((12, 4), 128, np.uint8)
    codes[:6, 0], codes[6:, 1] = 255, 255
    basis = np.zeros((2, 3, 1))
    basis[0, 0], basis[1, 2] = 1, 1
    layout = Layout(np.array([1, 1, 0, 0], np.float32), basis, np.eye(2, 3), 8)
    sky = np.ones((16, 32, 3), np.float32)
    environment = [{"type": "environment", "source": "e.hdr"}]
    for turn, expected in ((0, 0), (180, 2)):
        raw = lit(kit, {"a": {"rotation": [0, turn, 0]}}, environment)
        found, _ = played(raw, {"a": Transfer(mesh, codes, layout)}, environment=sky)
        middle = found[SIZE[1] // 2, SIZE[0] // 2]
        # L00 of an even sky is 2 sqrt(pi)
        assert middle[expected] == pytest.approx(2 / np.sqrt(np.pi), rel=2e-3)
        # (255 * 128 / 255 - 128) / 127 in float32
        assert middle[[0, 2]].min() < 1e-5


def test_a_mesh_that_the_folder_lacks_is_named(kit, write_scene, ctx, rng):
    folder = write_scene(lit(kit, {"a": {}}, []), {"b": asset_of(rng, kit.quad(Material()))})
    with pytest.raises(DamagedError, match=r"assets\.transfer/a"):
        Player(folder, size=(8, 8), context=ctx)
