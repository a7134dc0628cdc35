"""Frames and views of sprites: where the mesh lies on its texels, from near and from far."""

from dataclasses import replace

import numpy as np
import pytest

from bake.billboard import frame_of, trace, world_from_sprite
from maths.circular_harmonics import ring_direction
from tests.bake import small_meshes, stage_battery
from tests.bake.plates import POINT, rounding, tilted_plate


@pytest.mark.parametrize("views", [2, 5])
@pytest.mark.parametrize("axis", ["view", "up"])
def test_views_turn_about_the_up_axis(views, axis):
    """View v of a plate is view 0 of the plate turned the other way."""
    normal = np.array([0.3, 0.4, 1.0]) / np.linalg.norm([0.3, 0.4, 1.0])
    params = replace(POINT, views=views, axis=axis)
    master = trace(small_meshes.plate(normal), params=params)
    assert master.terms.shape[0] == views
    for v in range(views):
        seen = world_from_sprite(v, views).T @ normal
        seen = seen if seen[2] > 0 else -seen  # its back
        found = master.terms[v][:, master.alpha[v] == 1]
        if not found.size:  # on edge
            continue
        expected = np.broadcast_to(tilted_plate(seen, params)[:, None, None], found.shape)
        np.testing.assert_allclose(found, expected, rtol=0, atol=rounding(params))


def test_the_camera_of_a_view_stands_at_its_yaw():
    for v in range(4):
        yaw = 2 * np.pi * v / 4
        expected = [np.sin(yaw), 0, np.cos(yaw)]
        np.testing.assert_allclose(world_from_sprite(v, 4)[:, 2], expected, atol=1e-15)
        # The first light of an up ring stands to the right of every view
        right = world_from_sprite(v, 4) @ ring_direction(0.0, "up", 0.0)
        np.testing.assert_allclose(right, [np.cos(yaw), 0, -np.sin(yaw)], atol=1e-15)


def test_the_frame_holds_the_mesh_and_stands_on_the_ground():
    mesh = small_meshes.box((1.0, 2.0, 0.5), (5.0, 7.0, -3.0))
    master = trace(mesh, params=replace(POINT, resolution=64))
    assert master.alpha.shape == (1, 64, 32)
    assert (master.alpha == 1).all()
    assert master.pivot == pytest.approx((16.0, 64.0), abs=1e-9)
    assert master.metres_per_texel == pytest.approx(4 / 64, rel=1e-12)
    assert master.height == pytest.approx(4.0, rel=1e-12)
    # A mesh about its own origin turns about that, not about the middle of its box
    off = trace(
        small_meshes.box((1.0, 2.0, 0.5), (0.5, 2.0, 0.0)), params=replace(POINT, resolution=64)
    )
    assert off.pivot == pytest.approx((8.0, 64.0), abs=1e-9)


def test_edges_are_anti_aliased_and_premultiplied():
    """A disc of known area: coverage is its area, and partial texels carry their share."""
    disc = small_meshes.sphere(48, 96)
    params = replace(POINT, resolution=32, samples=64, elevation=1.4)
    master = trace(disc, params=params)
    area = master.alpha.sum() * master.metres_per_texel**2
    # 64 samples in each of about 100 texels on the rim; the polygon of 96 sides lacks .07 %
    assert area == pytest.approx(np.pi, rel=3e-3)
    partial = (master.alpha[0] > 0) & (master.alpha[0] < 1)
    assert partial.sum() > 50
    brightest = master.terms[0, 0].max()
    assert (master.terms[0, 0][partial].max(axis=1) <= master.alpha[0][partial] * brightest).all()
    np.testing.assert_array_equal(master.terms[0][:, master.alpha[0] == 0], 0)


@pytest.mark.parametrize("shape", ["one texel", "a row", "a column", "on edge"])
def test_the_smallest_sprites(shape):
    half = {"one texel": (1, 1), "a row": (1, 0.05), "a column": (0.05, 1), "on edge": (0, 1)}[
        shape
    ]
    sheet = small_meshes.mesh_of(
        [
            [-half[0], -half[1], 0],
            [half[0], -half[1], 0.1],
            [half[0], half[1], 0],
            [-half[0], half[1], -0.1],
        ],
        [[0, 1, 2], [0, 2, 3]],
    )
    params = replace(POINT, resolution=1 if shape == "one texel" else 16, held_out=4)
    master = trace(sheet, params=params)
    expected = {"one texel": (1, 1), "a row": (1, 16), "a column": (16, 1), "on edge": (16, 1)}
    assert master.alpha.shape == (1, *expected[shape])
    stage_battery.require_finite(master)
    if shape != "on edge":
        assert master.alpha.max() > 0


def test_a_far_eye_sees_what_an_orthographic_one_does():
    mesh = small_meshes.joined(
        small_meshes.sphere(), small_meshes.box((1.5, 0.1, 1.5), (0, -1.1, 0))
    )
    params = replace(POINT, resolution=32)
    flat, far = (trace(mesh, params=replace(params, field_of_view=f)) for f in (0.0, 1e-4))
    assert flat.alpha.shape == far.alpha.shape
    # Rays differ by 1e-4 rad: a subsample or two on the silhouette goes the other way
    assert np.count_nonzero(flat.alpha != far.alpha) <= 4
    same = flat.alpha[0] == far.alpha[0]
    difference = np.abs(flat.terms - far.terms)[0][:, same].max(axis=(0, 2))
    assert np.median(difference) < 1e-4
    assert np.mean(difference > 0.01) < 0.02


@pytest.mark.parametrize("field_of_view", [0.3, 1.0, 2.0])
def test_the_frame_of_a_near_eye_just_holds_the_mesh(field_of_view):
    """Light ends in every side of the frame and its silhouette is that of the projected corners."""
    mesh = small_meshes.box((0.6, 1.0, 0.8), (0.0, 1.0, 0.0))
    params = replace(POINT, resolution=64, samples=16, field_of_view=field_of_view)
    master = trace(mesh, params=params)
    distance = max(1 / np.tan(field_of_view / 2), 1.05)
    # The near face is the largest: 1.2 x 2 m at z = .8, seen from height 1 at `distance`
    zoom = 1 / (1 - 0.8 / distance)
    frame = frame_of(mesh, params)
    assert frame.eye == pytest.approx((0, 1, distance))
    size = (frame.width * frame.metres_per_texel, frame.height * frame.metres_per_texel)
    slack = frame.metres_per_texel
    assert 1.2 * zoom - 1e-9 <= size[0] <= 1.2 * zoom + slack
    assert 2.0 * zoom - 1e-9 <= size[1] <= 2.0 * zoom + slack
    # Nothing but the near face is seen, and it fills the frame up to rounding to whole texels
    inner = master.alpha[0][1:-1, 1:-1]
    np.testing.assert_array_equal(inner, 1)
    constant = np.sqrt(2 * np.pi) * np.sin(params.elevation) / np.pi
    np.testing.assert_allclose(master.terms[0, 0, 1:-1, 1:-1], constant, rtol=1e-5)
