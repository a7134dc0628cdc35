"""Bounds on codes against a dense search over backgrounds, channel by channel."""

from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from formats import film_bounds
from formats.keyed import Keyed
from formats.scene import Bloom, Film
from maths import bloom, colour

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


# Bloom after the change: a small picture, its mean over any weights in place of the spread


def spread(picture: Array, share: Array, strength: float, threshold: float) -> Array:
    bright = bloom.bright_share(picture, threshold)[:, None] * picture
    return np.asarray(picture - strength * bright + strength * (share @ bright))


@pytest.mark.parametrize("threshold", [0.0, 0.3, 5.0])
@pytest.mark.parametrize("tonemap", ["linear", "filmic"])
def test_what_bloom_makes_of_a_change_is_within_the_bound(
    tonemap: str, threshold: float, rng: np.random.Generator
) -> None:
    found = film(tonemap)
    closest = np.zeros(2)
    for strength in (0.05, 0.5, 1.0):
        described = Bloom(strength=Keyed.hold(strength), threshold=threshold)
        for _ in range(150):
            before = np.exp(rng.uniform(-4, 3, (6, 3)))
            if rng.random() < 0.5:
                # Around the threshold, where it matters most; black beside it
                before = (threshold or 1.0) * rng.uniform(0.9, 1.1, (6, 3))
                before[0] = 0.0
            share = rng.dirichlet(np.full(6, 0.3), 6)
            glow = spread(before, share, strength, threshold)
            light = float(np.exp(rng.uniform(-9, 0)))
            moved = np.maximum(before + light * rng.choice([-1.0, 0.0, 1.0], (6, 3)), 0.0)
            passing, radiance = 1.0 - light * 0.1, float(rng.choice([0.0, 0.5, 3.0]))
            through = rng.uniform(passing, 1.0, (6, 1))
            veil = through * before + (1.0 - through) * radiance * rng.uniform(0, 1, 3)
            for i, (changed, bound) in enumerate(
                (
                    (moved, film_bounds.added(found, light, described)),
                    (veil, film_bounds.veiled(found, passing, radiance, described)),
                )
            ):
                after = spread(changed, share, strength, threshold)
                worst = float(np.abs(codes(found, after) - codes(found, glow)).max())
                assert worst <= bound * (1 + 1e-9) + 1e-9
                closest[i] = max(closest[i], worst / bound)
    # The bounds are not idle: a search comes within a factor of them
    assert (closest > 0.1).all()


def test_a_threshold_makes_more_of_small_changes_and_says_so() -> None:
    """Fog that darkens what glows a little takes more from the glow, which lies on black."""
    found, strength, threshold = film("linear"), 0.5, 1.0
    before, share = np.array([[1.1] * 3, [0.0] * 3]), np.array([[0.5, 0.5], [0.5, 0.5]])
    passing = 0.999
    glow = [spread(p, share, strength, threshold) for p in (before, passing * before)]
    change = float(np.abs(codes(found, glow[0]) - codes(found, glow[1])).max())
    described = Bloom(strength=Keyed.hold(strength), threshold=threshold)
    assert film_bounds.veiled(found, passing, 0.0) < change
    assert change <= film_bounds.veiled(found, passing, 0.0, described)
