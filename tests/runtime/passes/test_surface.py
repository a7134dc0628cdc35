"""Opaque meshes against the same sums in numpy, pixel by pixel; targets that later passes read."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from bake.shading import bilinear
from formats.errors import DamagedError
from formats.mesh import Material
from maths import area_lights, environment_irradiance
from maths.spherical_harmonics import evaluate
from maths.spherical_rotation import rotate
from maths.transforms import rotation
from runtime import lighting
from runtime import player as player_module
from runtime.camera import Camera
from runtime.player import Player

pytestmark = pytest.mark.gpu
HALF = 2.0**-11  # rounding to a half float
SIZE = (96, 64)
CAMERA = {"position": [0, 0.3, 4], "target": [0, 0, 0], "focal_length_mm": 40}
LIGHTS = [
    {"type": "sun", "to_light": [0.5, 0.6, 0.7], "irradiance": [3, 2, 1]},
    # As wide as it may be, low: half of it is below many a face's horizon
    {"type": "sun", "to_light": [-1, 0.2, 0.1], "irradiance": [1, 2, 3], "angular_diameter": 90},
    {"type": "sphere", "position": [0.3, 0.2, 0.8], "radius": 0.3, "radiance": [4, 3, 2]},
    {"type": "disc", "position": [-1, 1, 0], "facing": [1, -1, 0.3], "radius": 0.6,
     "radiance": [2, 4, 6]},
    {"type": "disc", "position": [0, -1, 0.5], "facing": [0, -1, 0], "radius": 0.4,
     "radiance": [5, 1, 1], "two_sided": True},
    {"type": "rectangle", "position": [1.2, 0, 0.5], "facing": [-1, 0.2, 0], "size": [1, 2],
     "radiance": [3, 3, 9]},
    {"type": "polygon", "outline": [[-1, 1.5, -1], [1, 1.5, -1], [0.5, 1.4, 1], [0, 1.37, 1.6],
                                    [-0.5, 1.4, 1]], "radiance": [2, 2, 1], "two_sided": True},
]  # fmt: skip


def world_mesh(placed, mesh, t=0.0):
    """Corners and normals (m, 3, 3) of a mesh where it stands."""
    matrix = placed.world_from_mesh(t)
    corners = mesh.vertices[mesh.faces] @ matrix[:3, :3].T + matrix[:3, 3]
    turned = mesh.normals.astype(np.float64) @ matrix[:3, :3].T
    return corners, turned / np.linalg.norm(turned, axis=-1, keepdims=True)


def cast(camera, corners, offset=(0.0, 0.0), size=SIZE):
    """Nearest triangle (h, w), -1 for none, and weights (h, w, 3), of rays through pixels."""
    width, height = size
    x = 2 * (np.arange(width) + 0.5 + offset[0]) / width - 1
    y = 1 - 2 * (np.arange(height) + 0.5 + offset[1]) / height
    screen = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1)
    rays = screen @ camera.world_from_ray(width / height).T
    nearest, face = np.full((height, width), np.inf), np.full((height, width), -1)
    weights = np.zeros((height, width, 3))
    for i, (a, b, c) in enumerate(corners):
        # Moeller, Trumbore 1997
        p = np.cross(rays, c - a)
        determinant = p @ (b - a)
        s = camera.position - a
        q = np.cross(s, b - a)
        with np.errstate(all="ignore"):
            u, v = p @ s / determinant, rays @ q / determinant
            distance = q @ (c - a) / determinant
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0.1) & (distance < nearest)
        nearest[hit], face[hit] = distance[hit], i
        weights[hit] = np.stack([1 - u - v, u, v], axis=-1)[hit]
    return face, weights


def away_from_edges(camera, corners, size=SIZE):
    """Pixels (h, w) that one triangle covers wholly, their neighbours too, by 16 rays a pixel."""
    fine, _ = cast(camera, corners, size=(4 * size[0], 4 * size[1]))
    lowest, highest = minimum_filter(fine, 12), maximum_filter(fine, 12)
    return ((lowest == highest) & (lowest >= 0))[2::4, 2::4]


def irradiance(lights, point, normal, harmonics=None):
    """Sum of all lights (..., 3): the twin of light_at in surface.frag."""
    total = np.zeros(point.shape)
    if harmonics is not None:
        total += np.maximum(evaluate(normal, 2) @ harmonics, 0)
    for sun in lights.suns:
        total += area_lights.sun_irradiance(normal, sun.to_light, sun.irradiance, sun.radius)
    for ball in lights.spheres:
        place = ball.position, ball.radius, ball.radiance
        total += area_lights.sphere_irradiance(point, normal, *place)
    for disc in lights.discs:
        place = disc.position, disc.axis, disc.radius, disc.radiance
        total += area_lights.disc_irradiance(point, normal, *place, two_sided=disc.two_sided)
    for polygon in lights.polygons:
        total += area_lights.polygon_irradiance(
            point, normal, polygon.corners, polygon.radiance, two_sided=polygon.two_sided
        )
    return total


def shaded(scene, meshes, harmonics=None, t=0.0, size=SIZE):
    """Radiance (h, w, 3) of meshes by ray casting and closed forms, and the pixels it holds for."""
    camera, lights = Camera.of_scene(scene, t), lighting.at(scene, t)
    placed = [world_mesh(p, meshes[p.name], t) for p in scene.meshes]
    corners = np.concatenate([c for c, _ in placed])
    normals = np.concatenate([n for _, n in placed])
    face, weights = cast(camera, corners, size=size)
    owner = np.repeat(np.arange(len(placed)), [len(c) for c, _ in placed])
    first = np.cumsum([0, *(len(c) for c, _ in placed)])

    def blend(values):
        return np.einsum("hwi,hwic->hwc", weights, values[face])

    point, normal = blend(corners), blend(normals)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[face]
    back = np.einsum("hwc,hwc->hw", across, point - camera.position) > 0
    normal[back] *= -1
    radiance = np.zeros(point.shape)
    for i, mesh in enumerate(meshes[p.name] for p in scene.meshes):
        mine = (face >= 0) & (owner[face] == i)
        local = face[mine] - first[i]
        for k, material in enumerate(mesh.materials):
            of_it = mesh.material[local] == k
            at = tuple(axis[of_it] for axis in np.nonzero(mine))
            w, corner = weights[at], mesh.faces[local[of_it]]
            albedo = np.tile(material.base_color, (len(w), 1))
            if mesh.colours is not None:
                albedo = albedo * np.einsum("ni,nic->nc", w, mesh.colours[corner])
            if material.texture is not None:
                uv = np.einsum("ni,nic->nc", w, mesh.uv[corner])
                albedo = albedo * bilinear(material.texture, uv)
            light = irradiance(lights, point[at], normal[at], harmonics)
            radiance[at] = albedo / np.pi * light + material.emissive
    return radiance, away_from_edges(camera, corners, size)


@pytest.fixture
def played(write_scene, ctx):
    """Return played(raw, meshes, **how) -> (linear picture (h, w, 3), scene)."""
    count = iter(range(100))

    def play(raw, meshes, *, size=SIZE, environment=None, t=0.0):
        name = f"scene{next(count)}"
        folder = write_scene(raw, dict(meshes), environment=environment, name=name)
        with Player(folder, size=size, context=ctx) as player:
            return player.linear(t)[..., :3], player.scene

    return play


def stood(kit, names, lights, **more):
    """A scene of meshes alone."""
    places = [{"name": n, "source": f"meshes/{n}.glb", **how} for n, how in names.items()]
    return kit.scene_dict(billboards=None, meshes=places, camera=CAMERA, lights=lights, **more)


def soup(kit, rng, count, **more):
    """Triangles of random place, no slivers, with random, smooth normals on their front."""
    middle = rng.uniform([-1.2, -0.8, -1], [1.2, 0.8, 1], (count, 3))[:, None]
    turns = 2 * np.pi * np.arange(3) / 3 + rng.uniform(0, 0.8, (count, 3))
    axes = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    flat = np.stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)], axis=-1)
    corners = middle + rng.uniform(0.5, 0.9, (count, 1, 1)) * (flat @ axes)
    flat = kit.flat_mesh(corners).normals
    bent = flat + rng.uniform(-0.4, 0.4, flat.shape)
    bent /= np.linalg.norm(bent, axis=-1, keepdims=True)
    return kit.flat_mesh(corners, normals=bent, **more)


def assert_agree(found, expected, held, tolerance):
    assert held.sum() > 300
    error = np.abs(found - expected)[held] / (0.05 + expected[held])
    assert error.max() < tolerance


@pytest.mark.parametrize("number", range(len(LIGHTS)))
def test_every_light_by_itself_shades_as_numpy_does(kit, played, rng, number):
    meshes = {"soup": soup(kit, rng, 14)}
    raw = stood(kit, {"soup": {}}, [LIGHTS[number]])
    found, scene = played(raw, meshes)
    expected, held = shaded(scene, meshes)
    # Half floats, rounded when drawn and when averaged, and the 1e-5 of a closed form in float32
    assert_agree(found, expected, held, 2 * HALF)


def test_all_at_once_on_meshes_that_move_shade_as_numpy_does(kit, played, rng):
    turning = {"times": [0, 2], "values": [[0, 0, 0], [0, 90, 30]]}
    sliding = {"times": [0, 2], "values": [[0, 0, 0], [0.5, 0.2, -0.4]]}
    texture = rng.uniform(0.1, 1, (4, 4, 3)).astype(np.float32)
    colours = rng.uniform(0, 1, (30, 3))
    glowing = Material("glow", (0.3, 0.2, 0.1), emissive=(0.5, 1.5, 0.1))
    painted = Material("paint", (0.9, 0.8, 0.7), texture=texture)
    uv = rng.uniform(0, 1, (30, 2)) * 0.3
    meshes = {
        "a": soup(kit, rng, 10, colours=colours),
        "b": kit.flat_mesh(soup(kit, rng, 10).vertices.reshape(-1, 3, 3), glowing, painted, uv=uv),
    }
    where = {"a": {"rotation": turning}, "b": {"position": sliding, "scale": 1.3}}
    lights = [*LIGHTS, {"type": "environment", "source": "e.hdr", "scale": 0.7, "rotate": 50}]
    radiance = rng.uniform(0, 2, (16, 32, 3)).astype(np.float16).astype(np.float32)
    raw = stood(kit, where, lights)
    for t in (0.0, 1.3):
        found, scene = played(raw, meshes, environment=radiance, t=t)
        even = environment_irradiance.irradiance_harmonics(radiance)
        turned = rotate(even, rotation("y", np.radians(50)))
        meshes["b"] = with_stored_texture(meshes["b"])
        expected, held = shaded(scene, meshes, 0.7 * turned, t)
        # As above, and 1/512 steps of the texture's coordinates between texels
        assert_agree(found, expected, held, 4e-3)


def with_stored_texture(mesh):
    """The mesh with its textures rounded to the 8-bit sRGB codes that are stored."""
    from dataclasses import replace

    from maths import colour

    def stored(material):
        if material.texture is None:
            return material
        codes = np.rint(255 * colour.srgb_encode(material.texture)) / 255
        return replace(material, texture=np.asarray(colour.srgb_decode(codes), np.float32))

    return replace(mesh, materials=tuple(stored(m) for m in mesh.materials))


def test_an_even_sky_lights_every_side_by_pi(kit, played, rng):
    meshes = {"soup": soup(kit, rng, 14)}
    raw = stood(kit, {"soup": {}}, [{"type": "environment", "source": "e.hdr"}])
    found, scene = played(raw, meshes, environment=np.ones((16, 32, 3), np.float32))
    _, held = shaded(scene, meshes)
    # Sixteen rows integrate band 2 of a constant to 1 / (4 * 16^2)
    np.testing.assert_allclose(found[held], 0.5, rtol=3e-3)


def test_what_is_nearer_hides_what_is_farther_also_behind_the_ground(kit, played):
    lights = [{"type": "sun", "to_light": [0, 0.2, 1], "irradiance": [1, 1, 1]}]
    red, blue = Material(emissive=(1, 0, 0)), Material(emissive=(0, 0, 1))
    meshes = {"near": kit.quad(red, half=0.3), "far": kit.quad(blue, half=0.6)}
    where = {"near": {"position": [0, 0, 1]}, "far": {}}
    raw = stood(kit, where, lights, ground={"height": 0.0, "albedo": [0, 0, 0]})
    found, _ = played(raw, meshes, size=(64, 64))
    at = {"middle": found[28, 32], "beside": found[28, 44], "below": found[60, 32]}
    assert at["middle"].argmax() == 0
    assert at["beside"].argmax() == 2
    # The lower halves lie under the ground, which is black
    assert at["below"].max() == 0


def test_one_mesh_at_two_places_is_on_the_card_once(kit, write_scene, ctx):
    painted = Material(texture=np.ones((4, 4, 3), np.float32))
    mesh = kit.quad(painted, uv=np.zeros((6, 2)))
    once = write_scene(stood(kit, {"a": {}}, []), {"a": mesh}, name="once")
    twice = write_scene(stood(kit, {"a": {}, "b": {}}, []), {"a": mesh, "b": mesh}, name="twice")
    manifest = (twice / "manifest.json").read_text().replace("assets/b", "assets/a")
    (twice / "manifest.json").write_text(manifest)
    from formats import seal

    (twice / "seal.json").unlink()
    seal.seal(twice)
    with Player(once, size=(8, 8), context=ctx) as a, Player(twice, size=(8, 8), context=ctx) as b:
        a.frame(0.0)
        b.frame(0.0)
        assert a.profile["textures"] == b.profile["textures"]
        assert a.profile["programs"] == b.profile["programs"]
        assert b.profile["draw_calls"] == a.profile["draw_calls"] + 1


def test_a_mesh_that_the_folder_lacks_is_named(kit, write_scene, ctx):
    folder = write_scene(stood(kit, {"a": {}}, []), {"b": kit.quad()})
    with pytest.raises(DamagedError, match=r"assets\.mesh/a"):
        Player(folder, size=(8, 8), context=ctx)


def reader(*names):
    """A pass that reads targets and draws nothing."""
    return SimpleNamespace(reads=names, writes=(), draw=lambda time: None)


@pytest.mark.parametrize("samples", [1, 4])
def test_targets_are_drawn_only_for_a_pass_that_reads_them(
    kit, write_scene, ctx, rng, monkeypatch, samples
):
    monkeypatch.setattr(player_module, "SAMPLES", samples)
    meshes = {"soup": soup(kit, rng, 14), "wall": kit.quad(Material(), half=0.8)}
    where = {"soup": {"scale": 0.8}, "wall": {"rotation": [0, 160, 0], "position": [0, 0, -1]}}
    folder = write_scene(stood(kit, where, [LIGHTS[0]]), meshes)
    with Player(folder, size=SIZE, context=ctx) as player:
        player.frame(0.0)
        before = player.profile
        plain = player.linear(0.0)
        player.passes["reader"] = reader("position", "normal", "id")
        np.testing.assert_array_equal(player.linear(0.0), plain)
        assert player.profile["programs"] == before["programs"] + 1
        assert player.profile["textures"] == before["textures"] + 3
        scene = player.scene
        position, normal, number = (
            np.frombuffer(player.targets.texture(name).read(alignment=1), dtype).reshape(
                SIZE[1], SIZE[0], -1
            )[::-1]
            for name, dtype in (("position", "f4"), ("normal", "f2"), ("id", "i4"))
        )
    camera = Camera.of_scene(scene, 0.0)
    placed = [world_mesh(p, meshes[p.name]) for p in scene.meshes]
    corners = np.concatenate([c for c, _ in placed])
    face, weights = cast(camera, corners)
    held = away_from_edges(camera, corners)
    assert held.sum() > 300
    points = np.einsum("hwi,hwic->hwc", weights, corners[face])
    # float32 of coordinates of a metre or four, through a division
    np.testing.assert_allclose(position[held][:, :3], points[held], atol=1e-5)
    owner = np.where(face < len(placed[0][0]), 1, 2)
    np.testing.assert_array_equal(number[held][:, 0], owner[held])
    np.testing.assert_array_equal(position[held][:, 3], owner[held])
    np.testing.assert_allclose(
        np.linalg.norm(normal[held][:, :3].astype(float), axis=1), 1, atol=2e-3
    )
    towards = np.einsum(
        "nc,nc->n", normal[held][:, :3].astype(float), camera.position - points[held]
    )
    assert (towards[owner[held] == 2] > 0).all()
    empty = ~np.any(
        [cast(camera, corners, (x, y))[0] >= 0 for x in (-1, 0, 1) for y in (-1, 0, 1)], 0
    )
    assert empty.sum() > 300
    assert number[empty].max() == 0


def test_edges_are_averages_of_four_samples(kit, played):
    """A bright square turned a little, on black: an edge pixel holds 0 to 4 quarters."""
    glow = Material(base_color=(0, 0, 0), emissive=(1, 1, 1))
    raw = stood(kit, {"square": {"rotation": [0, 0, 11]}}, [])
    found, _ = played(raw, {"square": kit.quad(glow, half=0.6)})
    values = np.unique(found)
    np.testing.assert_allclose(values, np.arange(5) / 4, atol=1e-3)
    # Area is kept: quarters along four edges of 30 pixels, each off by 1/8 at random
    pixels = (0.6 * 2 * 40 / 24 * SIZE[1] / np.hypot(4, 0.3)) ** 2
    assert found[..., 0].sum() == pytest.approx(pixels, rel=0.01)
