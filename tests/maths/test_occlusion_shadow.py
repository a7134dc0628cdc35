"""Lookups of a shadow's volume: what they mean at its faces and far away."""

import numpy as np

from maths.occlusion_shadow import (
    disc_distance,
    disc_share,
    occlusion_falloff,
    occlusion_place,
    outside,
)

EXTENT = np.array([2.0, 0.5, 1.0])


def directions(n):
    found = np.random.default_rng(0).normal(size=(n, 3))
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def test_points_outside_are_looked_up_on_the_ray_from_the_middle():
    d = directions(50)
    on_face = d / np.abs(d).max(axis=-1, keepdims=True)
    for times in (1.0, 1.5, 100.0):
        np.testing.assert_allclose(
            occlusion_place(on_face * times), 0.5 + 0.5 * on_face, rtol=1e-14
        )
        np.testing.assert_allclose(outside(on_face * times), times, rtol=1e-14)


def test_the_share_of_a_disc_is_that_of_its_cone():
    r, R = np.array([0.01, 1.0, 10.0]), 2.0
    half_angle = np.arctan(R / r)
    np.testing.assert_allclose(disc_share(r, R), 1 - np.cos(half_angle), rtol=1e-12)
    np.testing.assert_allclose(disc_distance(disc_share(r, R), R), r, rtol=1e-12)


def test_a_shadow_thins_from_one_at_the_faces_to_the_inverse_square():
    d = directions(50)
    on_face = d / np.abs(d).max(axis=-1, keepdims=True)
    # Halves of a 1e-9 step at the faces: nothing jumps
    near = occlusion_falloff(on_face * (1 + 1e-9), EXTENT)
    np.testing.assert_allclose(near, 1.0, atol=1e-8)
    assert np.all(occlusion_falloff(0.5 * on_face, EXTENT) == 1.0)
    steps = occlusion_falloff(on_face[:, None] * np.geomspace(1, 1e3, 60)[:, None], EXTENT)
    assert np.all(np.diff(steps, axis=1) < 0)
    # The next term of the series is 3/4 (R / r)^2, and R is at most 2.3 times the nearest face
    ratio = occlusion_falloff(1e4 * on_face, EXTENT) / occlusion_falloff(2e4 * on_face, EXTENT)
    np.testing.assert_allclose(ratio, 4.0, rtol=1e-6)
