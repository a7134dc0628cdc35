"""Surfaces under one light: Lambert, thin sheets and gloss against their formulas."""

from dataclasses import replace

import numpy as np
import pytest

from bake.gather import one_light
from bake.rays import RayScene
from bake.shading import Surface, bilinear, ggx
from formats.mesh import Material
from maths.sampling import cosine_hemisphere, r2
from tests.bake import small_meshes

UP = np.array([[0.0, 0.0, 1.0]], np.float32)
# Products and sums of a few float32 numbers of at most 1
ROUNDING = 8 * 2.0**-24


def lit(mesh, towards, *, transmission=0.0, gloss=0.0, count=50):
    """Radiance (n, 3) of points of `mesh` seen from +z, under unit irradiance from `towards`."""
    scene = RayScene(mesh.vertices, mesh.faces)
    surface = Surface(mesh, scene, transmission, gloss)
    xy = 1.6 * r2(np.arange(count)) - 0.8
    origins = np.concatenate([xy, np.full((count, 1), 3.0)], axis=1)
    hits = scene.intersect(scene.to_unit(origins), -UP)
    shading = surface.at(hits, UP)
    channels = [np.zeros(count, np.float32) for _ in shading.colours]
    light = np.asarray(towards, np.float32) / np.float32(np.linalg.norm(towards))
    one_light(scene, shading, slice(None), light, channels)
    return sum(v[:, None] * c for v, c in zip(channels, shading.colours, strict=True)), shading


@pytest.mark.parametrize("towards", [(0, 0, 1), (3, 1, 2), (-1, 5, 0.2)])
@pytest.mark.parametrize("normal", [(0, 0, 1), (1, -1, 2)])
def test_lambert_plate(towards, normal):
    albedo = np.array([0.25, 0.5, 0.75])
    sheet = small_meshes.plate(normal, half=4.0, material=Material(base_color=tuple(albedo)))
    n, light = (np.asarray(v) / np.linalg.norm(v) for v in (normal, towards))
    expected = albedo / np.pi * max(0.0, n @ light)
    found, _ = lit(sheet, towards)
    np.testing.assert_allclose(found, np.tile(expected, (50, 1)), rtol=0, atol=ROUNDING)


def test_a_light_behind_a_solid_plate_gives_nothing():
    found, shading = lit(small_meshes.plate(half=4.0), (0.3, 0.2, -1), transmission=0.5)
    assert shading.through is None
    np.testing.assert_array_equal(found, 0)


@pytest.mark.parametrize("side", [1, -1])
def test_leaf(side):
    """A leaf lit from behind passes tau albedo / pi |n.l|, from the front it sends the rest back,
    whichever side of it looks at the viewer."""
    leaf = Material(base_color=(0.2, 0.6, 0.1), double_sided=True)
    sheet = small_meshes.plate((0, 0, side), half=4.0, material=leaf)
    towards = np.array([0.4, -0.3, 0.7])
    cosine = 0.7 / np.linalg.norm(towards)
    front, _ = lit(sheet, towards, transmission=0.35)
    behind, _ = lit(sheet, towards * [1, 1, -1], transmission=0.35)
    full = np.tile(np.array(leaf.base_color) / np.pi * cosine, (50, 1))
    np.testing.assert_allclose(front, 0.65 * full, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(behind, 0.35 * full, rtol=0, atol=ROUNDING)


def test_one_leaf_shades_another():
    leaf = Material(base_color=(0.5, 0.5, 0.5), double_sided=True)
    pair = small_meshes.joined(
        small_meshes.plate(half=4.0, material=leaf),
        small_meshes.plate(centre=(0, 0, -1), half=9.0, material=leaf),
    )
    alone, _ = lit(small_meshes.plate(half=4.0, material=leaf), (0, 0, -1), transmission=0.35)
    shaded, _ = lit(pair, (0, 0, -1), transmission=0.35)
    assert alone.min() > 0.05
    np.testing.assert_array_equal(shaded, 0)


def test_misses_are_never_lit():
    mesh = small_meshes.plate(half=0.1, material=Material(double_sided=True))
    found, shading = lit(mesh, (0, 0, 1), transmission=0.5, gloss=1.0)
    missed = (shading.normal == 0).all(axis=1)
    assert 0 < np.count_nonzero(~missed) < 10
    np.testing.assert_array_equal(found[missed], 0)
    assert (found[~missed] > 0).all()


def test_normals_are_interpolated_and_turned_to_the_viewer():
    mesh = small_meshes.sphere(32, 64)
    _, shading = lit(mesh, (0, 0, 1))
    xy = 1.6 * r2(np.arange(50)) - 0.8
    inner = (xy**2).sum(axis=1) < 0.5
    z = np.sqrt(1 - (xy[inner] ** 2).sum(axis=1, keepdims=True))
    # Facets of 2 pi / 64 rad lie up to an eighth of its square under the sphere, and the normal of
    # the sphere turns by 1 / z of that; their own normals are off by half a facet, 40 times more
    bound = (2 * np.pi / 64) ** 2 / 8 / np.sqrt(0.5) * 2
    error = np.abs(shading.normal[inner] - np.concatenate([xy[inner], z], axis=1)).max()
    assert error < bound
    assert (shading.normal[(shading.normal != 0).any(axis=1), 2] > 0).all()


def test_metals_show_without_gloss_and_keep_no_diffuse_with_it():
    metal = Material(base_color=(0.9, 0.6, 0.3), metallic=1.0)
    sheet = small_meshes.plate(half=4.0, material=metal)
    plain, _ = lit(sheet, (0, 0, 1))
    np.testing.assert_allclose(plain[0], np.array(metal.base_color) / np.pi, atol=ROUNDING)
    _, shading = lit(sheet, (0, 0, 1), gloss=1.0)
    np.testing.assert_array_equal(shading.diffuse, 0)
    # Exact in float32: the lobe of a metal has the metal's own colour
    np.testing.assert_allclose(shading.gloss[0], metal.base_color, rtol=2.0**-22)


def albedo_of_gloss(tilt, alpha, count=1500):
    """Share of unit radiance from all around that the lobe sends to a viewer at `tilt`, F = 1."""
    # Sample half vectors by the lobe's own density D n.h, so that sharp lobes converge too
    u = r2(np.arange(count))
    cosine = np.sqrt((1 - u[:, 0]) / (1 + (alpha**2 - 1) * u[:, 0]))
    sine, phi = np.sqrt(1 - cosine**2), 2 * np.pi * u[:, 1]
    half = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)
    view = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    light = 2 * (half @ view)[:, None] * half - view
    front = (light[:, 2] > 0) & (half @ view > 0)
    light, half, cosine = light[front].astype(np.float32), half[front], cosine[front]
    density = alpha**2 / (np.pi * (cosine**2 * (alpha**2 - 1) + 1) ** 2) * cosine
    eye, a, one = view[None].astype(np.float32), np.float32([alpha]), np.float32([1])
    lobe = np.array([ggx(UP, eye, d, d[2:], a, one)[0] for d in light])
    return float(np.sum(lobe * 4 * (half @ view) / density)) / count


@pytest.mark.parametrize("alpha", [0.15**2, 0.25])
@pytest.mark.parametrize("tilt", [0.0, 0.8, 1.4])
def test_gloss_returns_no_more_than_it_gets(alpha, tilt):
    """White furnace: an energy-conserving lobe without Fresnel loss keeps 1 or a little less."""
    # 1,500 low-discrepancy samples of weights from 0 to 1: the mean is good to 1 %
    total = albedo_of_gloss(tilt, alpha)
    assert total <= 1.01
    assert total > 0.75


@pytest.mark.parametrize("tilt", [0.0, 0.8, 1.4])
def test_the_roughest_gloss_in_closed_form(tilt):
    """alpha = 1: D = 1 / pi and G = 2 nl nv / (nl + nv), so that it sends 1 - v ln((1 + v) / v)."""
    v = np.cos(tilt)
    # Low discrepancy in two dimensions: 3 log^2(N) / N of weights up to 2
    assert albedo_of_gloss(tilt, 1.0) == pytest.approx(1 - v * np.log((1 + v) / v), abs=0.01)


def test_gloss_is_reciprocal(rng):
    a, b = (cosine_hemisphere(rng.random((200, 2))).astype(np.float32) for _ in range(2))
    alpha, f0 = rng.uniform(0.05, 1, 200), rng.uniform(0.04, 1, 200)
    for view, light, al, f in zip(a, b, alpha, f0, strict=True):
        shared = np.array([al], np.float32), np.array([f], np.float32)
        there = ggx(UP, view[None], light, light[2:], *shared) / light[2]
        back = ggx(UP, light[None], view, view[2:], *shared) / view[2]
        # float32, sharp lobes: D changes by 4 / alpha^2 for each unit of rounding of n.h
        np.testing.assert_allclose(there, back, rtol=2.0**-23 * (16 + 16 / al**2))


def test_gloss_adds_a_highlight_where_it_belongs():
    shiny = Material(base_color=(0.0, 0.0, 0.0), roughness=0.3)
    sheet = small_meshes.plate(half=4.0, material=shiny)
    mirror, _ = lit(sheet, (0, 0, 1), gloss=1.0)
    aside, _ = lit(sheet, (1, 0, 0.5), gloss=1.0)
    # D(0) = 1 / (pi alpha^2), G = 1, F = .04, n.l = 1: D F / 4
    expected = 0.04 / (4 * np.pi * 0.09**2)
    np.testing.assert_allclose(mirror, expected, rtol=1e-5)  # a dozen float32 operations
    assert aside.max() < expected / 100


def slow_bilinear(texture, u, v):
    height, width = texture.shape[:2]
    x, y = (u % 1) * width - 0.5, (1 - v % 1) * height - 0.5
    total = np.zeros(3)
    for row in (int(np.floor(y)), int(np.floor(y)) + 1):
        for column in (int(np.floor(x)), int(np.floor(x)) + 1):
            weight = (1 - abs(x - column)) * (1 - abs(y - row))
            total += weight * texture[row % height, column % width]
    return total


def test_bilinear_against_the_slow_version(rng):
    texture = rng.random((5, 7, 3)).astype(np.float32)
    uv = rng.uniform(-3, 3, (300, 2)).astype(np.float32)
    expected = [slow_bilinear(texture, *np.asarray(p, np.float64)) for p in uv]
    # uv of up to 3 in float32 places a texel of 1/7 to 7 * 3 * 2^-24
    np.testing.assert_allclose(bilinear(texture, uv), expected, rtol=0, atol=21 * 2.0**-23)


def test_texel_centres_are_exact_and_row_0_is_on_top(rng):
    texture = rng.random((4, 8, 3)).astype(np.float32)
    u, v = np.meshgrid((np.arange(8) + 0.5) / 8, 1 - (np.arange(4) + 0.5) / 4)
    uv = np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float32)
    np.testing.assert_array_equal(bilinear(texture, uv), texture.reshape(-1, 3))


def test_texture_and_vertex_colours_multiply_the_base():
    texture = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32)
    sheet = small_meshes.plate(material=Material(base_color=(0.5, 0.5, 0.5), texture=texture))
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    colours = np.linspace(0, 1, 12).reshape(4, 3).astype(np.float32)
    sheet = replace(sheet, uv=corners, colours=colours)
    scene = RayScene(sheet.vertices, sheet.faces)
    surface = Surface(sheet, scene, 0.0, 0.0)
    xy = np.array([[-0.5, 0.5], [0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])
    origins = np.concatenate([xy, np.ones((4, 1))], axis=1)
    hits = scene.intersect(scene.to_unit(origins), -UP)
    # Linear in the face: by hand from the corners at (-1,-1), (1,-1), (1,1) and (-1,1)
    x, y = (xy.T + 1) / 2
    lower = x >= y
    a, b, c, d = colours
    shade = np.where(
        lower[:, None],
        a + x[:, None] * (b - a) + y[:, None] * (c - b),
        a + y[:, None] * (d - a) + x[:, None] * (c - d),
    )
    expected = 0.5 * texture.reshape(-1, 3) * shade
    np.testing.assert_allclose(surface.albedo(hits), expected, rtol=0, atol=4 * ROUNDING)


def test_chosen_texels_keep_their_own_shading():
    _, shading = lit(small_meshes.sphere(), (0, 0, 1), gloss=0.5, count=60)
    chosen = np.array([1, 4])
    picked = shading.select(chosen, samples=3)
    rows = [s * 20 + t for s in range(3) for t in chosen]
    np.testing.assert_array_equal(picked.front, shading.front[rows])
    np.testing.assert_array_equal(picked.alpha, shading.alpha[rows])
    np.testing.assert_array_equal(picked.view, shading.view)
    assert picked.through is None
