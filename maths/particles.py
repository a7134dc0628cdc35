"""Particles as a closed form of (seed, index, time): no state, so that any moment can be asked for.

Particle i is born at (i + u_i) / rate for every integer i, those before time 0 too, and lives for a
time of its own: at time 0 as many are alive as later, rate times the mean lifetime on average. All
that is by chance is a hash of seed, i and what it is for. Without the wander it moves by Newton's
law with drag, dv/dt = a - k v.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths import hashing

Array = NDArray[np.float64]
Pair = tuple[float, float]
SMALL = 1e-3  # of k t, under which the series is nearer than the closed form
WAVES = 2  # sines an axis of the wander


@dataclass(frozen=True, eq=False)
class Alive:
    """Particles alive at one moment, oldest first.

    index : (n,) int64. born : (n,) seconds. age : (n,) seconds. life : (n,) seconds, age < life.
    """

    index: NDArray[np.int64]
    born: Array
    age: Array
    life: Array

    @property
    def share(self) -> Array:
        """Of its life that each has had (n,), 0 to 1."""
        return self.age / self.life


def most(rate: float, lifetime: Pair) -> int:
    """No more are alive at any moment.

    >>> most(30.0, (2.0, 5.0))
    152
    """
    return int(np.ceil(rate * lifetime[1])) + 2 if rate > 0.0 else 0


def alive(seed: int, rate: float, lifetime: Pair, time: float, cycle: int = 0) -> Alive:
    """Return who is alive at `time` seconds: born then or before, and not yet at its end.

    rate : births a second, >= 0. lifetime : seconds, least and most, evenly by chance. cycle :
    after so many births the same are born again, with the same index; 0 : never.
    """
    first = np.floor((time - lifetime[1]) * rate) - 1
    count = np.arange(first, np.floor(time * rate) + 1).astype(np.int64) if rate > 0.0 else _NONE
    index = count % cycle if cycle else count
    born = (count + chance(seed, index, 0)) / max(rate, 1e-30)
    life = between(lifetime, chance(seed, index, 1))
    age = time - born
    lives = (age >= 0.0) & (age < life)
    return Alive(index[lives], born[lives], age[lives], life[lives])


_NONE = np.empty(0, np.int64)


def chance(seed: int, index: ArrayLike, *keys: int) -> Array:
    """Uniform in [0, 1) per particle; keys say for what."""
    return np.asarray(hashing.uniform(seed, index, *keys), np.float64)


def chances(seed: int, index: ArrayLike, size: int, key: int) -> Array:
    """Uniform in [-1, 1), (n, size) per particle."""
    columns = [chance(seed, index, key, axis) for axis in range(size)]
    return 2.0 * np.stack(columns, axis=-1) - 1.0


def between(ends: Pair, share: Array) -> Array:
    """From the first at 0 to the second at 1."""
    return ends[0] + (ends[1] - ends[0]) * share


def flight(age: ArrayLike, drag: float) -> tuple[Array, Array]:
    """Return (e1, e2), (...): a particle moves by v e1 + a e2 in `age` seconds.

    drag : k in 1/s of dv/dt = a - k v; v its velocity at birth, a its acceleration.
    e1 = (1 - exp(-k t)) / k, e2 = (t - e1) / k; t and t^2 / 2 without drag.

    >>> [float(e.round(9)) for e in flight(2.0, 0.0)]
    [2.0, 2.0]
    """
    t = np.asarray(age, np.float64)
    x = drag * t
    near = x < SMALL
    k = max(drag, 1e-300)
    e1 = np.where(near, t * (1 - x / 2 + x * x / 6), -np.expm1(-x) / k)
    far = (np.where(near, 0.0, x) + np.expm1(-np.where(near, 0.0, x))) / k / k if drag else 0.0 * t
    return e1, np.where(near, t * t * (0.5 - x / 6 + x * x / 24), far)


def wander(seed: int, index: ArrayLike, age: ArrayLike, metres: float, scale: float) -> Array:
    """Return the smooth way (n, 3) by which particles stray: 0 at birth, under `metres` an axis.

    A sum of sines of about one turn in `scale` seconds, another for each particle and axis; it
    grows with t^2 at first and is full after a few times `scale`.
    """
    if metres == 0.0:
        return np.zeros((*np.shape(age), 3))
    t = np.asarray(age, np.float64)[..., None] / scale
    total = np.zeros((*np.shape(age), 3))
    for wave in range(WAVES):
        pace = 2.0 * np.pi * (1.0 + 0.5 * chances(seed, index, 3, 20 + 2 * wave)) * 2.0**-wave
        phase = np.pi * chances(seed, index, 3, 21 + 2 * wave)
        total += np.sin(pace * t + phase) / WAVES
    return metres * (t * t / (1.0 + t * t)) * total


def fade(share: ArrayLike, appear: float, vanish: float) -> Array:
    """Return how much of a particle shows (...), 0 to 1: smooth ramps at both ends of its life.

    appear, vanish : shares of its life.
    """
    s = np.asarray(share, np.float64)
    found = np.ones_like(s)
    for length, left in ((appear, s), (vanish, 1.0 - s)):
        if length > 0.0:
            found *= smooth(left / length)
    return found


def smooth(t: ArrayLike) -> Array:
    """3 t^2 - 2 t^3, held at 0 and 1."""
    x = np.clip(np.asarray(t, np.float64), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


Centre = Callable[[Array], Array]  # seconds (n,) -> metres (n, 3)


def positions(
    seed: int,
    found: Alive,
    centre: Centre,
    half_size: ArrayLike,
    velocity: ArrayLike,
    spread: ArrayLike,
    acceleration: ArrayLike,
    drag: float,
    turbulence: float,
    turbulence_scale: float,
) -> Array:
    """Return where particles are (n, 3), metres.

    centre : of the box at their births. half_size, spread : (3,) by which the place of birth and
    the velocity differ at most, evenly by chance.
    """
    index = found.index
    e1, e2 = flight(found.age, drag)
    start = centre(found.born) + np.asarray(half_size) * chances(seed, index, 3, 2)
    first = np.asarray(velocity) + np.asarray(spread) * chances(seed, index, 3, 3)
    moved = first * e1[:, None] + np.asarray(acceleration) * e2[:, None]
    return np.asarray(start + moved + wander(seed, index, found.age, turbulence, turbulence_scale))


def reach(
    low: ArrayLike,
    high: ArrayLike,
    velocity: ArrayLike,
    spread: ArrayLike,
    acceleration: ArrayLike,
    drag: float,
    turbulence: float,
    life: float,
) -> tuple[Array, Array]:
    """Return the corners (3,), (3,) of a box that holds every particle at every moment.

    low, high : of all places of birth. life : the longest, seconds. Each part of the way is taken
    for itself, so the box may be larger than it must be, never smaller.
    """
    e1, e2 = (float(e) for e in flight(life, drag))
    first, wide = np.asarray(velocity), np.asarray(spread)
    pull = np.asarray(acceleration) * e2
    least = np.minimum((first - wide) * e1, 0.0) + np.minimum(pull, 0.0) - turbulence
    largest = np.maximum((first + wide) * e1, 0.0) + np.maximum(pull, 0.0) + turbulence
    return np.asarray(low + least), np.asarray(high + largest)
