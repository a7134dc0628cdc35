"""Turning nine harmonics is turning the map that they were made from."""

from __future__ import annotations

import numpy as np
import pytest

from maths import environment_irradiance, transforms
from runtime.irradiance_harmonics import turned


def test_turning_harmonics_is_turning_the_map(rng):
    radiance = rng.uniform(0, 1, (16, 32, 3))
    # Counter-clockwise from above: u grows towards +x, so the picture moves to smaller u
    moved = np.roll(radiance, -5, axis=1)
    np.testing.assert_allclose(
        turned(environment_irradiance.irradiance_harmonics(radiance), 5 / 32 * 2 * np.pi),
        environment_irradiance.irradiance_harmonics(moved),
        atol=1e-12,
    )


@pytest.mark.parametrize("angle", [0.0, 0.7, -3.0, 100.0])
def test_what_is_seen_along_a_turned_normal_is_what_was_there(rng, angle):
    harmonics = rng.normal(size=(9, 3))
    n = transforms.normalise(rng.normal(size=(50, 3)))
    basis = environment_irradiance.basis
    there = n @ transforms.rotation("y", angle).T
    np.testing.assert_allclose(
        basis(there) @ turned(harmonics, angle), basis(n) @ harmonics, atol=1e-12
    )
