# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""Where the sprites of a set stand: as written, or scattered by a hash of seed and index."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formats.schema import MAX_ITEMS, item
from maths import hashing

ATTEMPTS = 64  # places tried for a sprite that falls into the clearing
SEED_MAX = 2**32 - 1


@dataclass(frozen=True, eq=False)
class Instances:
    """Sprites of one set.

    positions : (n, 3) ground points, m. scale : (n,) factors on the height. yaw : (n,) turns about
    +y, radians. flip : (n,) mirrored left to right. tint : (n, 3) factors on the colour. roll :
    (n,) turns in the sprite's plane, counter-clockwise, radians.
    """

    positions: NDArray[np.float64]
    scale: NDArray[np.float64]
    yaw: NDArray[np.float64]
    flip: NDArray[np.bool_]
    tint: NDArray[np.float64]
    roll: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.positions)


def placed(
    positions: NDArray[np.float64] | None,
    scale: NDArray[np.float64] | None = None,
    yaw_degrees: NDArray[np.float64] | None = None,
    flip: NDArray[np.bool_] | None = None,
    tint: NDArray[np.float64] | None = None,
    roll_degrees: NDArray[np.float64] | None = None,
) -> Instances:
    """Sprites at given ground points (n, 3); what is absent is 1, or 0 for turns and mirrors."""
    where = np.empty((0, 3)) if positions is None else positions
    n = len(where)
    return Instances(
        where,
        np.ones(n) if scale is None else scale,
        np.zeros(n) if yaw_degrees is None else np.radians(yaw_degrees),
        np.zeros(n, dtype=bool) if flip is None else flip,
        np.ones((n, 3)) if tint is None else tint,
        np.zeros(n) if roll_degrees is None else np.radians(roll_degrees),
    )


@dataclass(frozen=True, kw_only=True)
class Clearing:
    """An ellipse on the ground, seen from above, that stays free."""

    centre: tuple[float, float] = item(
        "vector", "[x, z] of its middle", unit="m", sizes=(2,), low=-1e6, high=1e6
    )
    radius: float | tuple[float, float] = item(
        "value", "one radius, or along x and along z", unit="m", sizes=(1, 2), low=1e-3, high=1e6
    )

    def holds(self, positions: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether each of the positions (..., 3) lies in the clearing."""
        offset = (positions[..., ::2] - np.array(self.centre)) / np.array(self.radius)
        return np.asarray((offset**2).sum(axis=-1) < 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scatter:
    """Sprites evenly by chance in a box."""

    count: int = item("integer", "sprites", low=0, high=MAX_ITEMS)
    seed: int = item("integer", "another seed, another grove", 0, low=0, high=SEED_MAX)
    box: NDArray[np.float64] = item(
        "numbers", "two corners, the lower first", unit="m", sizes=(3,), low=-1e6, high=1e6
    )
    height: tuple[float, float] = item(
        "vector",
        "least and greatest factor on the height",
        [1.0, 1.0],
        sizes=(2,),
        low=1e-3,
        high=1e3,
    )
    roll: tuple[float, float] = item(
        "vector",
        "least and greatest turn of a picture in its own plane",
        [0.0, 0.0],
        unit="deg",
        sizes=(2,),
        low=-360,
        high=360,
    )
    flip: bool = item("flag", "mirror every other sprite, by chance", True)
    tint: float = item(
        "number", "amount of variation of the colour: 1 varies it by half", 0.0, low=0, high=1
    )
    clearing: Clearing | None = item("table", "an ellipse that stays free", None, table=Clearing)
    facing: tuple[float, float] | None = item(
        "vector",
        "[x, z] that every sprite turns to; absent: turned by chance",
        None,
        unit="m",
        sizes=(2,),
        low=-1e6,
        high=1e6,
    )

    def instances(self) -> Instances:
        """The sprites. Raises ValueError where the clearing leaves no room."""
        index = np.arange(self.count, dtype=np.uint32)
        positions = self._positions(index)
        low, high = self.height
        least, most = np.radians(self.roll)
        return Instances(
            positions,
            low + (high - low) * self._chance(index, 3),
            self._yaw(index, positions),
            (self._chance(index, 4) < 0.5) & self.flip,
            self._tint(index),
            least + (most - least) * self._chance(index, 8),
        )

    def _chance(self, index: NDArray[np.uint32], *keys: int) -> NDArray[np.float64]:
        """Uniform in [0, 1) per sprite; keys say for what."""
        return np.asarray(hashing.uniform(self.seed, index, *keys), dtype=np.float64)

    def _positions(self, index: NDArray[np.uint32]) -> NDArray[np.float64]:
        low, high = self.box
        positions = np.empty((self.count, 3))
        left = index
        for attempt in range(ATTEMPTS if self.clearing else 1):
            chance = np.stack([self._chance(left, axis, attempt) for axis in range(3)], axis=-1)
            positions[left] = low + (high - low) * chance
            if self.clearing is None:
                return positions
            left = left[self.clearing.holds(positions[left])]
            if not left.size:
                return positions
        raise ValueError("the clearing leaves too little room in the box of the scatter")

    def _yaw(
        self, index: NDArray[np.uint32], positions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        if self.facing is None:
            return 2.0 * np.pi * self._chance(index, 5)
        towards = np.array(self.facing) - positions[:, ::2]
        return np.arctan2(towards[:, 0], towards[:, 1])

    def _tint(self, index: NDArray[np.uint32]) -> NDArray[np.float64]:
        # Half of the variation is brightness, half is hue
        brightness = self._chance(index, 6)[:, None]
        hue = np.stack([self._chance(index, 7, channel) for channel in range(3)], axis=-1)
        return 1.0 + self.tint * (0.5 * brightness + 0.5 * hue - 0.5)
