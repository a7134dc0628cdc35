"""Lookups of a shadow's volume: what they mean at its faces and far away."""

import numpy as np
import pytest

from maths.occlusion_shadow import (
    disc_distance,
    disc_share,
    occlusion_falloff,
    occlusion_place,
    occlusion_unwarp,
    occlusion_warp,
    outside,
    receiver_facing,
    receiver_lobe,
    receiver_products,
    receiver_share,
)
from maths.spherical_harmonics import evaluate, turn_zonal
from maths.spherical_projection import cap, clamped_cosine, quadrature

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


@pytest.mark.parametrize("k", [0.0, 0.5, 3.0])
def test_a_warp_keeps_both_ends_and_turns_back(k):
    place = np.linspace(0, 1, 101)
    found = occlusion_warp(place, k)
    np.testing.assert_allclose(found[[0, 50, 100]], [0, 0.5, 1], atol=1e-15)
    np.testing.assert_allclose(occlusion_unwarp(found, k), place, atol=1e-14)
    step = 1e-6
    slope = (occlusion_warp(place + step, k) - occlusion_warp(place - step, k)) / (2 * step)
    # Second derivatives of 4 k (1 + k) jump at the middle: half a step of them
    assert slope[50] == pytest.approx(1 + k, abs=8 * k * (1 + k) * step + 1e-9)
    assert slope[0] == pytest.approx(1 / (1 + k), abs=8 * k * step + 1e-9)
    assert np.all(np.diff(found) > 0)


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


def test_lobes_are_the_harmonics_of_unit_normals():
    n = directions(60)
    np.testing.assert_allclose(receiver_lobe(n), evaluate(n, 2), atol=2e-15)
    np.testing.assert_array_equal(receiver_lobe(np.zeros(3))[1:], 0)


@pytest.mark.parametrize("l_max", [0, 1, 4])
def test_products_are_sums_over_directions(l_max):
    rng = np.random.default_rng(3)
    light = rng.normal(size=(2, (l_max + 3) ** 2, 3))
    occlusion = rng.normal(size=(l_max + 1) ** 2)
    n = directions(5)
    found = np.einsum(
        "nj,ejkc,k->nec", receiver_lobe(n), receiver_products(light, l_max), occlusion
    )
    # Exact for the product of the three: 2 l_max + 4 bands
    d, area = quadrature(l_max + 2)
    cosine = evaluate(d, 2) @ clamped_cosine(n, 2).T
    values = area * (evaluate(d, l_max) @ occlusion)
    expected = np.einsum("d,dn,edc->nec", values, cosine, evaluate(d, l_max + 2) @ light)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    # What nothing hides: all of the light that the normal faces
    whole = np.einsum("nj,ejc->nec", receiver_lobe(n), receiver_facing(light))
    sums = np.einsum("d,dn,edc->nec", area, cosine, evaluate(d, l_max + 2) @ light)
    np.testing.assert_allclose(whole, sums, atol=1e-12 * np.abs(sums).max())


def test_a_cone_of_shadow_takes_the_light_that_the_normal_faces():
    """Two suns, one of them hidden: what is left is the other's share of the cosines."""
    l_max = 60
    n, suns = np.array([0.0, 1.0, 0.0]), np.array([[-0.6, 0.8, 0.0], [0.8, 0.36, 0.48]])
    light = (evaluate(suns, l_max + 2) * [[1.0], [2.0]]).sum(axis=0)[:, None]
    blocked = turn_zonal(cap(0.4, l_max), suns[0])
    lobe = receiver_lobe(n)
    hidden = lobe @ (receiver_products(light, l_max)[..., 0] @ blocked)
    facing = lobe @ receiver_facing(light)[..., 0]
    x = suns @ n
    cut = 0.25 + 0.5 * x + 5 / 32 * (3 * x * x - 1)
    # A disc's series rings: by 2 % at its own middle and 1 % at the other sun
    expected = 2 * cut[1] / (cut[0] + 2 * cut[1])
    assert receiver_share(hidden, facing) == pytest.approx(expected, abs=0.02)


def test_all_is_kept_where_no_light_is_faced():
    share = receiver_share([0.5, 0.5, -0.1, 0.02], [0.03, -0.2, 0.5, 0.04])
    np.testing.assert_allclose(share, [1, 1, 1, 0.5])
