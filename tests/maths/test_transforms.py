"""Cameras, rotations and the lat-long map against scipy and by hand."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from maths import transforms as tr


def test_euler_is_about_x_then_y_then_z(rng: np.random.Generator) -> None:
    for angles in rng.uniform(-4, 4, (20, 3)):
        truth = Rotation.from_euler("xyz", angles).as_matrix()
        assert np.allclose(tr.euler(angles), truth, rtol=0, atol=1e-14)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_rotation_is_right_handed(axis: str) -> None:
    vector = np.eye(3)["xyz".index(axis)]
    truth = Rotation.from_rotvec(0.8 * vector).as_matrix()
    assert np.allclose(tr.rotation(axis, 0.8), truth, rtol=0, atol=1e-15)
    with pytest.raises(ValueError, match="x, y or z"):
        tr.rotation("w", 0.1)


def test_look_at_is_rigid_and_looks_along_minus_z(rng: np.random.Generator) -> None:
    for _ in range(20):
        eye, target = rng.normal(size=(2, 3)) * 1e3
        view = tr.look_at(eye, target)
        assert np.allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3), rtol=0, atol=1e-14)
        assert np.linalg.det(view[:3, :3]) > 0
        # Metres of 1e3 have a rounding of 1e-13
        assert np.allclose(view @ [*eye, 1], [0, 0, 0, 1], rtol=0, atol=1e-12)
        seen = view @ [*target, 1]
        assert np.allclose(seen[:2], 0, rtol=0, atol=1e-12)
        assert seen[2] < 0
        assert (view @ [0, 1, 0, 0])[1] >= 0


@pytest.mark.parametrize("target", [[0, -5, 0], [0, 5, 0], [1e-9, -5, 0]])
def test_look_straight_up_and_down(target: list[float]) -> None:
    view = tr.look_at([0, 0, 0], target)
    assert np.allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3), rtol=0, atol=1e-14)
    assert np.allclose(view @ [*target, 1], [0, 0, -5, 1], rtol=0, atol=1e-8)
    # Looking down -z is on top, as on a map with north at -z; looking up it is at the bottom
    assert (view @ [0, 0, -1, 0])[1] * -target[1] > 4


def test_look_nowhere_is_refused() -> None:
    with pytest.raises(ValueError, match="camera"):
        tr.look_at([1, 2, 3], [1, 2, 3])


def test_perspective_maps_near_and_far() -> None:
    clip = tr.perspective(0.05, 0.024, 1.5, 0.1, 100.0)
    for depth, ndc in ((0.1, -1), (100.0, 1)):
        p = clip @ [0.3 * depth, 0.1 * depth, -depth, 1]
        assert np.isclose(p[2] / p[3], ndc, rtol=1e-12)
        assert np.isclose(p[0] / p[3], 0.3 * 0.05 / 0.012 / 1.5, rtol=1e-14)
        assert np.isclose(p[1] / p[3], 0.1 * 0.05 / 0.012, rtol=1e-14)
    infinite = tr.perspective(0.05, 0.024, 1.5, 0.1, np.inf) @ [0, 0, -1e12, 1]
    assert np.isclose(infinite[2] / infinite[3], 1)


@pytest.mark.parametrize(
    "bad", [(0, 1, 1, 1, 2), (1, 1, 1, 0, 2), (1, 1, 1, 2, 1), (1, np.nan, 1, 1, 2)]
)
def test_perspectives_that_are_none_are_refused(bad: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="perspective"):
        tr.perspective(*bad)


def test_orthographic_maps_its_box() -> None:
    clip = tr.orthographic(4.0, 2.0, -1.0, 3.0)
    assert np.allclose(clip @ [2, 1, 1, 1], [1, 1, -1, 1], rtol=1e-15)
    assert np.allclose(clip @ [-2, -1, -3, 1], [-1, -1, 1, 1], rtol=1e-15)
    with pytest.raises(ValueError, match="box"):
        tr.orthographic(0.0, 1.0, 0.0, 1.0)


def test_affine_scales_turns_moves() -> None:
    m = tr.affine(tr.rotation("z", np.pi / 2), [1, 2, 3], 2.0)
    assert np.allclose(m @ [1, 0, 0, 1], [1, 4, 3, 1], rtol=0, atol=1e-15)


def test_latlong_round_trip_and_landmarks() -> None:
    u, v = np.meshgrid((np.arange(16) + 0.5) / 16, (np.arange(8) + 0.5) / 8)
    uv = np.stack([u, v], -1)
    assert np.allclose(tr.latlong_uv(7 * tr.latlong_direction(uv)), uv, rtol=0, atol=1e-15)
    marks = {(0, 0, -1): 0.5, (1, 0, 0): 0.75, (-1, 0, 0): 0.25}
    for d, where in marks.items():
        assert np.allclose(tr.latlong_uv(d), [where, 0.5], rtol=0, atol=1e-15)
    assert tr.latlong_uv([0, 1, 0]).tolist() == [0.5, 0]
    assert tr.latlong_uv([-0.0, -1, -0.0]).tolist() == [0.5, 1]


def test_latlong_solid_angles_are_exact() -> None:
    # A cap of 30 degrees is the top row of six
    top = tr.latlong_solid_angles(6, 12)[0] * 12
    assert np.isclose(top, 2 * np.pi * (1 - np.cos(np.pi / 6)), rtol=1e-14)
    assert np.isclose(tr.latlong_solid_angles(512, 1024).sum() * 1024, 4 * np.pi, rtol=1e-13)
    with pytest.raises(ValueError, match="texel"):
        tr.latlong_solid_angles(0, 4)


@pytest.mark.parametrize("length", [1e-300, 1e-6, 1.0, 1e6, 1e300])
def test_normalise_at_any_length(length: float) -> None:
    found = tr.normalise(np.array([0.6, 0.0, -0.8]) * length)
    assert np.allclose(found, [0.6, 0, -0.8], rtol=1e-15)


@pytest.mark.parametrize("bad", [[0, 0, 0], [np.nan, 1, 0], [np.inf, 0, 0], [1, -np.inf, np.nan]])
def test_vectors_without_direction_are_refused(bad: list[float]) -> None:
    with pytest.raises(ValueError, match="direction"):
        tr.normalise([[1, 0, 0], bad])


def test_lengths_far_from_one_leave_a_warning() -> None:
    assert tr.unit_directions([[0.5, 0, 0], [0, 2, 0]])[1] == ()
    assert len(tr.unit_directions([[0.49, 0, 0], [0, 1, 0]])[1]) == 1
    assert len(tr.unit_directions([[0, 45, 30]])[1]) == 1
    with pytest.raises(ValueError, match="direction"):
        tr.unit_directions([0.0, 0.0, 0.0])
