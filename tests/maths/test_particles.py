"""Particles: no state, the right number of them, Newton's law, and a box that holds them."""

import numpy as np
import pytest

from maths import particles

LIFE = (2.0, 5.0)


def test_any_moment_is_the_same_however_it_is_reached() -> None:
    """Particles that two moments share have the same birth and life at both, bit for bit."""
    a, b = (particles.alive(7, 300.0, LIFE, t) for t in (11.0, 12.3))
    both, at_a, at_b = np.intersect1d(a.index, b.index, return_indices=True)
    assert len(both) > 400
    np.testing.assert_array_equal(a.born[at_a], b.born[at_b])
    np.testing.assert_array_equal(a.life[at_a], b.life[at_b])
    # Those that are missing have died, or are not born yet
    gone = np.setdiff1d(a.index, b.index, assume_unique=True)
    left = np.isin(a.index, gone)
    assert np.all(a.born[left] + a.life[left] <= 12.3 + 1e-12)
    new = np.isin(b.index, np.setdiff1d(b.index, a.index))
    assert np.all(b.born[new] > 11.0)


def test_everyone_that_should_be_alive_is() -> None:
    """Against all births of a long time, looked at one by one."""
    index = np.arange(-3000, 3000)
    born = (index + particles.chance(3, index, 0)) / 40.0
    life = 0.5 + 3.0 * particles.chance(3, index, 1)
    for time in (-7.3, 0.0, 0.1, 31.0):
        expected = index[(born <= time) & (time < born + life)]
        found = particles.alive(3, 40.0, (0.5, 3.5), time)
        np.testing.assert_array_equal(found.index, expected)
        assert len(expected) <= particles.most(40.0, (0.5, 3.5))
        assert found.share.min() >= 0
        assert found.share.max() < 1


def test_as_many_live_at_the_start_as_later_rate_times_mean_life() -> None:
    counts = {
        time: [len(particles.alive(seed, 20.0, LIFE, time).index) for seed in range(400)]
        for time in (0.0, 1000.0)
    }
    for found in counts.values():
        # At most one birth in 1/rate: the spread is under that of a Poisson process, sqrt(70)
        z = (np.mean(found) - 20.0 * 3.5) / (np.std(found) / np.sqrt(len(found)))
        assert abs(z) < 4
        assert np.std(found) < np.sqrt(70)


def test_with_a_cycle_all_comes_again_after_so_many_births() -> None:
    """Whole births a period: who lives, and how old, is as a period before."""
    a, b = (particles.alive(5, 12.0, LIFE, time, cycle=24) for time in (3.3, 3.3 + 5 * 2.0))
    np.testing.assert_array_equal(a.index, b.index)
    assert 0 <= a.index.min() <= a.index.max() < 24
    # Times of 13 s are rounded by 2e-15
    np.testing.assert_allclose(a.age, b.age, atol=1e-14)
    np.testing.assert_array_equal(a.life, b.life)
    # Lives that end beyond the period: the same index twice, a period apart in age
    repeated = np.flatnonzero(a.index == a.index[-1])
    assert len(repeated) == 2
    np.testing.assert_allclose(np.diff(a.age[repeated]), -2.0, atol=1e-14)


def test_nothing_is_born_without_a_rate() -> None:
    assert len(particles.alive(1, 0.0, LIFE, 3.0).index) == 0
    assert particles.most(0.0, LIFE) == 0


def path(age: np.ndarray, index: int = 5, **more: object) -> np.ndarray:
    """Where one particle is at many ages, (n, 3)."""
    n = len(age)
    one = particles.Alive(np.full(n, index), np.zeros(n), age, np.full(n, 9.0))
    knobs = {"velocity": (1, 2, 3), "spread": (0.5, 0, 0.2), "acceleration": (0, -9.8, 0.5)}
    plain = {"drag": 0.0, "turbulence": 0.0, "turbulence_scale": 1.0, "half_size": (1, 2, 3)}
    return particles.positions(
        4, one, lambda born: np.zeros((len(born), 3)), **{**knobs, **plain, **more}
    )


@pytest.mark.parametrize("drag", [0.0, 1e-5, 0.7, 30.0])
def test_motion_obeys_newton_with_drag(drag: float) -> None:
    step = 1e-3
    age = np.arange(0, 4, step)
    found = path(age, drag=drag)
    speed = (found[2:] - found[:-2]) / (2 * step)
    gained = (found[2:] - 2 * found[1:-1] + found[:-2]) / step**2
    # Second differences of positions of some 50 m in doubles: 1e-14 * 50 / step^2 of noise; of the
    # central difference, drag^3 * speed * step^2 / 6 at the most
    limit = 1e-5 + drag**3 * 4 * step**2
    np.testing.assert_allclose(gained, np.array([0, -9.8, 0.5]) - drag * speed, atol=limit)
    first = (found[1] - found[0]) / step
    assert np.all(np.abs(first - [1, 2, 3]) <= np.array([0.5, 0, 0.2]) + (10 + drag * 4) * step)


def test_the_series_meets_the_closed_form() -> None:
    """Both sides of the change, whose terms left out are x^3 / 24 and x^3 / 120: under 5e-11."""
    t = 1.0
    for drag in (particles.SMALL * (1 - 1e-9), particles.SMALL * (1 + 1e-9)):
        e1, e2 = particles.flight(t, drag)
        exact = -np.expm1(-drag) / drag
        assert abs(e1 - exact) < 5e-11
        # Cancellation of the closed form: 1e-16 / drag^2
        assert abs(e2 - (0.5 - drag / 6 + drag**2 / 24)) < 2e-10


def test_births_fill_the_box_evenly() -> None:
    n = 4000
    index = np.arange(n)
    newborn = particles.Alive(index, np.arange(n) / 10, np.zeros(n), np.ones(n))
    moved = particles.positions(
        1,
        newborn,
        lambda born: np.stack([born, 0 * born, 0 * born], axis=-1),
        half_size=(1.0, 2.0, 0.0),
        velocity=(5, 5, 5),
        spread=(1, 1, 1),
        acceleration=(1, 1, 1),
        drag=0.3,
        turbulence=2.0,
        turbulence_scale=1.0,
    )
    # From where the centre was at their births
    off = moved - np.stack([newborn.born, 0 * newborn.born, 0 * newborn.born], axis=-1)
    assert np.all(np.abs(off) <= [1, 2, 0])
    # Evenly: the variance of [-1, 1] is 1/3, of that estimate 4/45 / n
    z = (np.mean((off[:, :2] / [1, 2]) ** 2, axis=0) - 1 / 3) / np.sqrt(4 / 45 / n)
    assert np.all(np.abs(z) < 4)


def test_the_wander_starts_at_rest_stays_small_and_is_smooth() -> None:
    age = np.linspace(0, 20, 20001)
    stray = particles.wander(2, np.full(len(age), 3), age, 0.7, 1.5)
    assert np.all(stray[0] == 0)
    assert np.abs(stray).max() <= 0.7
    assert np.abs(stray).max() > 0.2
    speed = np.diff(stray, axis=0) / np.diff(age)[:, None]
    # At most 1.5 turns a scale of amplitude .7, and the growth on top: no jumps
    assert np.abs(speed).max() < 0.7 * (2 * np.pi * 1.5 + 0.7) / 1.5
    assert np.abs(speed[0]).max() < 1e-2


def test_the_fade_is_even_and_smooth() -> None:
    assert particles.fade([0.0, 0.1, 0.5, 1.0], 0.2, 0.4).tolist() == [0.0, 0.5, 1.0, 0.0]
    assert particles.fade([0.0, 0.999], 0.0, 0.0).tolist() == [1.0, 1.0]
    share = np.linspace(0, 1, 1001)
    assert np.abs(np.diff(particles.fade(share, 0.2, 0.4))).max() < 1.5 / 0.2 * 1.01e-3


@pytest.mark.parametrize("seed", range(6))
def test_the_box_holds_every_particle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = {
        "velocity": rng.normal(size=3),
        "spread": rng.uniform(0, 1, 3),
        "acceleration": rng.normal(size=3),
        "drag": float(rng.choice([0.0, 0.4])),
        "turbulence": float(rng.uniform(0, 1)),
    }
    half = rng.uniform(0, 1, 3)
    low, high = particles.reach(-half, half, **motion, life=5.0)
    reached = []
    for time in rng.uniform(-50, 50, 20):
        found = particles.alive(seed, 200.0, (1.0, 5.0), time)
        at = particles.positions(
            seed,
            found,
            lambda born: np.zeros((len(born), 3)),
            half,
            **motion,
            turbulence_scale=1.0,
        )
        assert np.all(at >= low - 1e-12)
        assert np.all(at <= high + 1e-12)
        reached.append(at)
    # Not so large that it says nothing
    size = np.ptp(np.concatenate(reached), axis=0)
    assert np.all(size > 0.3 * (high - low))
