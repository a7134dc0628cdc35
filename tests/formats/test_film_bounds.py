"""Bounds on codes against a dense search over backgrounds, channel by channel."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from formats import film_bounds
from formats.keyed import Keyed
from formats.scene import Film
from maths import colour

Array = NDArray[np.float64]
# Backgrounds from black to far over white: every mixture of the channels
STEPS = np.concatenate([[0.0], np.geomspace(1e-5, 1e3, 13)])
BEHIND = np.array(list(product(STEPS, repeat=3)))


def film(tonemap: Any, exposure: float = 0.0) -> Film:
    return Film(tonemap=tonemap, exposure=Keyed.hold(exposure))


def codes(found: Film, radiance: Array) -> Array:
    exposed = radiance * 2.0 ** found.exposure.at(0.0)
    return 255.0 * colour.srgb_encode(colour.TONEMAPS[found.tonemap](exposed))


@pytest.mark.parametrize("tonemap", ["linear", "filmic"])
@pytest.mark.parametrize("exposure", [-5.0, 0.0, 4.0])
@pytest.mark.parametrize("light", [1e-7, 1e-5, 1e-3, 0.1, 10.0])
def test_added_light_moves_nothing_farther(
    tonemap: str, exposure: float, light: float, rng: np.random.Generator
) -> None:
    found = film(tonemap, exposure)
    bound = film_bounds.added(found, light)
    worst = 0.0
    # Terms of a sprite may take light off as well: any sign in any channel
    for change in (*np.array(list(product([-1, 0, 1], repeat=3))), *rng.uniform(-1, 1, (4, 3))):
        moved = np.maximum(BEHIND + light * change, 0.0)
        worst = max(worst, float(np.abs(codes(found, moved) - codes(found, BEHIND)).max()))
    # Rounding of numbers up to 255
    assert worst <= bound * (1 + 1e-9) + 1e-12
    if tonemap == "linear":
        # Attained on black
        assert worst == pytest.approx(bound, rel=1e-9)
    elif bound < 255.0:
        # Within a factor of what a search finds: a bound of 255 would be as true
        assert worst > 0.1 * bound


@pytest.mark.parametrize("tonemap", ["linear", "filmic"])
@pytest.mark.parametrize("passing", [0.0, 0.3, 0.99, 0.9999])
@pytest.mark.parametrize("radiance", [0.0, 0.01, 3.0])
def test_a_veil_moves_nothing_farther(tonemap: str, passing: float, radiance: float) -> None:
    found = film(tonemap, 1.0)
    bound = film_bounds.veiled(found, passing, radiance)
    worst = 0.0
    for tint in product([0.0, 0.5, 1.0], repeat=3):
        veiled = passing * BEHIND + (1.0 - passing) * radiance * np.array(tint)
        worst = max(worst, float(np.abs(codes(found, veiled) - codes(found, BEHIND)).max()))
    assert worst <= bound * (1 + 1e-9) + 1e-12
    if bound < 255.0:
        # The grid of backgrounds misses the worst one by at most a step
        assert worst > 0.05 * bound


def test_bounds_count_the_brightest_exposure() -> None:
    keyed = Keyed(np.array([0.0, 1.0]), np.array([-3.0, 2.0]))
    moving = Film(tonemap="filmic", exposure=keyed)
    assert film_bounds.added(moving, 1e-4) == film_bounds.added(film("filmic", 2.0), 1e-4)


def test_nothing_added_is_nothing() -> None:
    for tonemap in ("linear", "filmic"):
        assert film_bounds.added(film(tonemap), 0.0) == 0.0
        assert film_bounds.veiled(film(tonemap), 1.0, 5.0) == 0.0
        assert film_bounds.added(film(tonemap, 32.0), 1e6) == 255.0


@pytest.mark.parametrize("tonemap", ["linear", "filmic"])
def test_half_floats_round_by_less_than_said(tonemap: str) -> None:
    found = film(tonemap)
    grey = np.repeat(np.geomspace(1e-3, 60.0, 20_000)[:, None], 3, axis=1)
    rounded = grey.astype(np.float16).astype(np.float64)
    # Rounding to nearest moves half a step of 2^-10; two pictures may round apart
    moved = 2 * np.abs(codes(found, grey) - codes(found, rounded)).max()
    assert 0.5 * film_bounds.HALF_FLOAT < moved < 2 * film_bounds.HALF_FLOAT
