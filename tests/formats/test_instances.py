"""Scattered sprites: deterministic, even, clear of the clearing."""

from typing import Any

import numpy as np

from formats.instances import Clearing, Scatter


def scatter(**changes: Any) -> Scatter:
    plain: dict[str, Any] = {"count": 4000, "box": np.array([[-4.0, 0.0, -8.0], [4.0, 1.0, 0.0]])}
    return Scatter(**{**plain, **changes})


def test_scattering_is_the_same_every_time_and_another_for_another_seed() -> None:
    first, again, other = (scatter(seed=s).instances() for s in (7, 7, 8))
    assert np.array_equal(first.positions, again.positions)
    assert np.array_equal(first.tint, again.tint)
    assert not np.any(first.positions[:, 0] == other.positions[:, 0])


def test_scattering_does_not_depend_on_the_count() -> None:
    few, many = scatter(count=10).instances(), scatter(count=100).instances()
    assert np.array_equal(few.positions, many.positions[:10])
    assert np.array_equal(few.yaw, many.yaw[:10])


def test_scattering_fills_its_box_evenly() -> None:
    found = scatter(height=(0.5, 2.0), tint=1.0).instances()
    low, high = np.array([-4.0, 0.0, -8.0]), np.array([4.0, 1.0, 0.0])
    unit = (found.positions - low) / (high - low)
    unit = np.column_stack([unit, (found.scale - 0.5) / 1.5, found.yaw / (2 * np.pi)])
    assert unit.min() >= 0.0
    assert unit.max() < 1.0
    # Means of 4,000 uniform numbers: 4 standard errors of 1 / sqrt(12 n)
    assert np.abs(unit.mean(axis=0) - 0.5).max() < 4 / np.sqrt(12 * 4000)
    # Correlations of independent numbers: 4 standard errors of 1 / sqrt(n)
    correlation = np.corrcoef(unit.T) - np.eye(unit.shape[1])
    assert np.abs(correlation).max() < 4 / np.sqrt(4000)
    # A fair coin: 4 standard errors of 1 / (2 sqrt(n))
    assert abs(found.flip.mean() - 0.5) < 4 / (2 * np.sqrt(4000))


def test_tint_varies_within_its_amount() -> None:
    assert np.all(scatter().instances().tint == 1.0)
    tint = scatter(tint=0.4).instances().tint
    assert tint.min() >= 0.8
    assert tint.max() <= 1.2
    assert np.abs(tint[:, 0] - tint[:, 1]).max() > 0.1
    # Shared brightness: channels correlate by 1 / 2; 4 standard errors of at most 1 / sqrt(n)
    assert abs(np.corrcoef(tint.T)[0, 1] - 0.5) < 4 / np.sqrt(4000)


def test_a_clearing_stays_free_and_moves_nothing_else() -> None:
    free = scatter(clearing=Clearing(centre=(0.0, -4.0), radius=(3.0, 2.0))).instances()
    plain = scatter().instances()
    inside = ((plain.positions[:, 0] / 3) ** 2 + ((plain.positions[:, 2] + 4) / 2) ** 2) < 1
    # The ellipse covers 6 pi / 64 of the box: 4 standard errors of a share
    share = 6 * np.pi / 64
    assert abs(inside.mean() - share) < 4 * np.sqrt(share * (1 - share) / 4000)
    now = ((free.positions[:, 0] / 3) ** 2 + ((free.positions[:, 2] + 4) / 2) ** 2) < 1
    assert not now.any()
    assert np.array_equal(free.positions[~inside], plain.positions[~inside])


def test_facing_turns_the_front_to_a_point() -> None:
    found = scatter(facing=(10.0, -2.0)).instances()
    front = np.column_stack([np.sin(found.yaw), np.cos(found.yaw)])
    towards = np.array([10.0, -2.0]) - found.positions[:, ::2]
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    # Sine and cosine of a rounded angle: a few ulp
    assert np.allclose(front, towards, rtol=0, atol=8 * np.finfo(float).eps)


def test_an_empty_scatter_and_a_flat_box_are_fine() -> None:
    assert len(scatter(count=0).instances()) == 0
    flat = scatter(box=np.zeros((2, 3))).instances()
    assert np.all(flat.positions == 0.0)


def test_mirroring_can_be_switched_off() -> None:
    assert not scatter(flip=False).instances().flip.any()
