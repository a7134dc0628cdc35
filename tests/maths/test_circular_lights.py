"""Lamps against brute force: on the ring, off it, around it and behind it."""

import numpy as np
import pytest

from maths.circular_basis import evaluate, rotate
from maths.circular_lights import (
    evaluate_direction,
    project_environment,
    project_sphere,
    project_sun,
    ring_coordinates,
    ring_direction,
)
from maths.sampling import orthonormal_basis, r2, uniform_cone
from maths.transforms import latlong_direction, latlong_solid_angles, rotation

HARMONICS = np.array([0, 1, 1, 2, 2])


def test_axes_are_those_of_the_conventions() -> None:
    e, t = 0.4, 0.9
    c, s = np.cos(t), np.sin(t)
    view = [np.cos(e) * c, np.cos(e) * s, np.sin(e)]
    up = [np.cos(e) * c, np.sin(e), -np.cos(e) * s]
    assert np.allclose(ring_direction(t, "view", e), view, rtol=1e-15)
    assert np.allclose(ring_direction(t, "up", e), up, rtol=1e-15)


@pytest.mark.parametrize("axis", ["view", "up"])
@pytest.mark.parametrize("elevation", [-0.7, 0.0, 0.5, 1.5])
def test_coordinates_invert_directions(axis: str, elevation: float) -> None:
    t = np.linspace(-3.1, 3.1, 40)
    found, s, front = ring_coordinates(ring_direction(t, axis, elevation) * 3e5, axis)
    # A ring of radius cos 1.5 magnifies the rounding of its directions 14 times
    assert np.allclose(found, t, rtol=0, atol=1e-14)
    assert np.allclose(s, np.cos(elevation), rtol=0, atol=1e-15)
    assert np.all(front == (elevation >= 0))


def test_azimuth_on_the_axis_is_zero() -> None:
    t, s, _ = ring_coordinates([[0.0, 0.0, 1.0], [-0.0, -0.0, 1.0], [-0.0, 0.0, -2.0]])
    assert np.array_equal(t, [0, 0, 0])
    assert np.array_equal(s, [0, 0, 0])


@pytest.mark.parametrize("axis", ["view", "up"])
@pytest.mark.parametrize("elevation", [-0.3, 0.0, 0.6])
def test_sun_on_the_ring_is_the_basis(axis: str, elevation: float) -> None:
    t = np.linspace(0, 6, 17)
    L = project_sun(
        ring_direction(t, axis, elevation), [2.0, 1.0, 0.5], 5, axis=axis, elevation=elevation
    )
    truth = evaluate(t, 5)[:, :, None] * [2.0, 1.0, 0.5]
    assert np.allclose(L, truth, rtol=0, atol=1e-14)


@pytest.mark.parametrize("axis", ["view", "up"])
def test_sun_off_the_ring_fades_by_powers(axis: str, rng: np.random.Generator) -> None:
    elevation = 0.7
    d = rng.normal(size=(50, 3))
    t, s, _ = ring_coordinates(d, axis)
    gain = np.minimum(1, s / np.cos(elevation))
    assert (gain < 1).any()
    assert (gain == 1).any()
    truth = evaluate(t, 5) * gain[:, None] ** HARMONICS
    found = project_sun(d, np.ones(3), 5, axis=axis, elevation=elevation)[..., 0]
    assert np.allclose(found, truth, rtol=0, atol=1e-14)


def test_sun_on_the_axis_has_only_a_constant() -> None:
    L = project_sun([0.0, 0.0, 5.0], [1.0, 1.0, 1.0], 5, elevation=0.3, one_sided=True)
    assert np.array_equal(L[1:], np.zeros((4, 3)))
    assert np.allclose(L[0], 1 / np.sqrt(2 * np.pi), rtol=1e-15)


def test_sun_sets_behind_a_one_sided_set_without_a_jump() -> None:
    z = np.linspace(-0.02, 0.2, 2201)
    d = np.stack([np.sqrt(1 - z * z), np.zeros_like(z), z], axis=-1)
    L = project_sun(d, np.ones(3), 3, elevation=0.3, one_sided=True)[:, :, 0]
    # Steps of 1e-4 in z are a thousandth of the fade
    assert np.abs(np.diff(L, axis=0)).max() < 1.1e-3 * np.abs(L).max()
    full = evaluate_direction(d, 3, elevation=0.3)
    np.testing.assert_allclose(L[z > 0.1], full[z > 0.1], rtol=1e-12)


def test_sun_behind_a_one_sided_set_is_exactly_zero(rng: np.random.Generator) -> None:
    d = rng.normal(size=(100, 3))
    L = project_sun(d, np.ones(3), 5, elevation=0.3, one_sided=True)
    assert np.array_equal(L[d[:, 2] < 0], np.zeros_like(L[d[:, 2] < 0]))
    assert np.all(L[d[:, 2] > 0, 0] > 0)
    both = project_sun(d, np.ones(3), 5, elevation=0.3)
    assert np.all(both[:, 0] > 0)


def test_turning_the_sun_turns_the_coefficients() -> None:
    d = np.array([0.3, 0.4, 0.2])
    turned = project_sun(rotation("z", 0.8) @ d, np.ones(3), 5, elevation=0.5)
    assert np.allclose(turned, rotate(project_sun(d, np.ones(3), 5, elevation=0.5), 0.8, axis=0))
    up = project_sun(rotation("y", 0.8) @ d, np.ones(3), 5, axis="up")
    assert np.allclose(up, rotate(project_sun(d, np.ones(3), 5, axis="up"), 0.8, axis=0))


@pytest.mark.parametrize("direction", [[0.0, 0.0, 0.0], [np.nan, 0, 1], [np.inf, 0, 0]])
def test_directions_that_are_none_are_refused(direction: list[float]) -> None:
    with pytest.raises(ValueError, match="direction"):
        project_sun(direction, np.ones(3), 5)


def test_rings_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="view or up"):
        ring_coordinates([0.0, 0.0, 1.0], "z")
    with pytest.raises(ValueError, match="view or up"):
        ring_direction(0.0, "z")
    with pytest.raises(ValueError, match="90 degrees"):
        evaluate_direction([0.0, 0.0, 1.0], 5, elevation=np.pi / 2)
    with pytest.raises(ValueError, match="one-sided"):
        evaluate_direction([0.0, 0.0, 1.0], 5, axis="up", one_sided=True)
    with pytest.raises(ValueError, match="one-sided"):
        project_sphere([0.0, 0.0, 3.0], 1.0, np.ones(3), 5, axis="up", one_sided=True)


def sphere_by_brute_force(position, radius, **ring):
    distance = np.linalg.norm(position)
    half_angle = np.arcsin(radius / distance)
    local = uniform_cone(r2(np.arange(60_000)), half_angle)
    a, b = orthonormal_basis(position / distance)
    d = local[:, :1] * a + local[:, 1:2] * b + local[:, 2:] * (position / distance)
    cap = 2 * np.pi * (1 - np.cos(half_angle))
    return evaluate_direction(d, 5, **ring).mean(axis=0) * cap, cap / np.sqrt(2 * np.pi)


@pytest.mark.parametrize("size", [0.02, 0.3, 0.95])
@pytest.mark.parametrize(
    "ring",
    [
        {"axis": "view", "elevation": 0.5, "one_sided": True},
        {"axis": "view", "elevation": 0.5, "one_sided": False},
        {"axis": "up", "elevation": 0.2, "one_sided": False},
    ],
)
def test_sphere_light_is_its_cap(size: float, ring: dict, rng: np.random.Generator) -> None:
    position = rng.normal(size=(6, 3))
    # Half of them set: their caps straddle the plane of the sprite
    position[::2, 2] = rng.uniform(-1, 1, 3) * size * np.linalg.norm(position[::2, :2], axis=-1)
    radius = size * np.linalg.norm(position, axis=-1)
    coarse = project_sphere(position, radius, np.ones(3), 5, **ring)[..., 0]
    fine = project_sphere(position, radius, np.ones(3), 5, **ring, nodes=(48, 32))[..., 0]
    for n in range(6):
        truth, whole = sphere_by_brute_force(position[n], radius[n], **ring)
        # Kinks (the rim, the ring) cost 8 strips up to .9 % of the light, measured over 400 lamps;
        # 48 strips 36 times less, and 60,000 points of R2 about 1e-3 on an indicator
        assert np.abs(coarse[n] - truth).max() < 0.015 * whole
        assert np.abs(fine[n] - truth).max() < 0.002 * whole


def test_small_sphere_is_a_sun() -> None:
    position, radius = np.array([300.0, 400.0, 500.0]), 0.05
    sphere = project_sphere(position, radius, [2.0, 1.0, 3.0], 5, elevation=0.3)
    E = np.pi * radius**2 / np.sum(position**2) * np.array([2.0, 1.0, 3.0])
    sun = project_sun(position, E, 5, elevation=0.3)
    # A cap of 1e-3 rad instead of 7e-5: second order in it, and 8 strips' half per cent of that
    assert np.allclose(sphere, sun, rtol=0, atol=2e-3 * E.max())


def test_sphere_behind_is_exactly_zero_and_above_whole() -> None:
    kw = {"elevation": 0.3, "one_sided": True}
    for z in (-1.0001, -2.0, -50.0):
        behind = project_sphere([0.4, 3.0, z], 1.0, np.ones(3), 5, **kw)
        assert np.array_equal(behind, np.zeros((5, 3)))
    far = project_sphere([4e4, 3.0, -0.02], 0.01, np.ones(3), 5, **kw)
    assert np.array_equal(far, np.zeros((5, 3)))
    above = project_sphere([0.4, 3.0, 1.2], 1.0, np.ones(3), 5, **kw)
    assert np.allclose(above, project_sphere([0.4, 3.0, 1.2], 1.0, np.ones(3), 5, elevation=0.3))


def test_sphere_all_around() -> None:
    for position in ([0.0, 0.0, 0.0], [0.1, 0.2, -0.3]):
        L = project_sphere(position, 1.0, np.ones(3), 3)[:, 0]
        assert np.allclose(L, [4 * np.pi / np.sqrt(2 * np.pi), 0, 0], rtol=0, atol=1e-2)
        half = project_sphere(position, 1.0, np.ones(3), 3, one_sided=True)[:, 0]
        assert np.allclose(half, [2 * np.pi / np.sqrt(2 * np.pi), 0, 0], rtol=0, atol=1e-2)


def test_setting_sphere_never_jumps() -> None:
    z = np.linspace(-0.6, 0.6, 2401)
    position = np.stack([np.ones_like(z), 0.7 * np.ones_like(z), z], axis=-1)
    L = project_sphere(position, 0.5, np.ones(3), 5, elevation=0.3, one_sided=True)[..., 0]
    chord, step = 2 * 0.5 / 1.22, 1.2 / 2400 / 1.22
    # A step uncovers at most chord * step steradians; half as much again for the nodes
    assert np.abs(np.diff(L[:, 0])).max() < 1.5 * chord * step / np.sqrt(2 * np.pi)
    assert L[0, 0] == 0
    # All of it has risen; 8 strips are half a per cent off at worst
    s = 0.5 / np.linalg.norm(position[-1])
    cap = 2 * np.pi * (1 - np.sqrt(1 - s * s))
    assert abs(L[-1, 0] * np.sqrt(2 * np.pi) / cap - 1) < 0.01


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf])
def test_spheres_that_are_none_are_refused(radius: float) -> None:
    with pytest.raises(ValueError, match="radius"):
        project_sphere([0.0, 0.0, 1.0], radius, np.ones(3), 5)


@pytest.mark.parametrize("axis", ["view", "up"])
def test_environment_is_a_light_a_texel(axis: str, rng: np.random.Generator) -> None:
    image = rng.uniform(size=(6, 12, 3))
    one_sided, yaw = axis == "view", 0.7
    slow = np.zeros((5, 3))
    for row in range(6):
        for column in range(12):
            d = latlong_direction([(column + 0.5) / 12, (row + 0.5) / 6])
            E = image[row, column] * latlong_solid_angles(6, 12)[row]
            towards = rotation("y", -yaw) @ d
            basis = evaluate_direction(towards, 5, axis=axis, elevation=0.5, one_sided=one_sided)
            slow += basis[:, None] * E
    kw = {"axis": axis, "elevation": 0.5, "one_sided": one_sided}
    assert np.allclose(project_environment(image, 5, **kw, yaw=yaw), slow, rtol=0, atol=1e-13)
    many = project_environment(image, 5, **kw, yaw=[[0.0, yaw]])
    assert many.shape == (1, 2, 5, 3)
    assert np.allclose(many[0, 1], slow, rtol=0, atol=1e-13)


def test_environment_of_one_radiance() -> None:
    L = project_environment(np.full((32, 64, 3), 2.0), 5, elevation=0.3)
    assert np.allclose(L[0], 8 * np.pi / np.sqrt(2 * np.pi), rtol=1e-13)
    assert np.allclose(L[1:3], 0, rtol=0, atol=1e-12)
    half = project_environment(np.full((32, 64, 3), 2.0), 5, elevation=0.3, one_sided=True)
    assert np.allclose(half[0], 4 * np.pi / np.sqrt(2 * np.pi), rtol=1e-13)


def test_environment_behind_is_exactly_zero() -> None:
    image = np.zeros((8, 16, 3))
    image[:, 4:12] = 1.0  # the half around the centre column, -z
    kw = {"elevation": 0.3, "one_sided": True}
    assert np.array_equal(project_environment(image, 5, **kw), np.zeros((5, 3)))
    # Turned half round, the sprite faces it
    assert np.all(project_environment(image, 5, **kw, yaw=np.pi)[0] > 0)


def test_environment_up_axis_only_rotates(rng: np.random.Generator) -> None:
    image = rng.uniform(size=(8, 16, 3))
    still = project_environment(image, 5, axis="up", elevation=0.2)
    turned = project_environment(image, 5, axis="up", elevation=0.2, yaw=0.9)
    assert np.allclose(turned, rotate(still, -0.9, axis=0), rtol=0, atol=1e-13)


@pytest.mark.parametrize("shape", [(8, 16), (8, 16, 4), (0, 16, 3)])
def test_environments_of_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="h, w, 3"):
        project_environment(np.zeros(shape), 5)
