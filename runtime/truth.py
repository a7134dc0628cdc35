"""What a window is told of the traced truth, which a process beside it traces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Traced:
    """A traced picture through the scene's own film, as good as it is so far.

    picture : (h, w, 3) uint8, row 0 on top, of the size asked for; the first ones are coarse and
    enlarged. samples : paths a pixel, below 1 while it is coarse. error : mean standard error of
    radiance, share of the mean radiance. done : it gets no better. notes : what it leaves out.
    """

    picture: NDArray[np.uint8]
    samples: float
    error: float
    done: bool = False
    notes: tuple[str, ...] = ()


class Tracing(Protocol):
    """A truth under way. busy : such as "tracing 16 paths a pixel, 40 %", None when it has ended.
    error : one line, where it cannot be traced."""

    busy: str | None
    error: str | None

    def poll(self) -> Traced | None:
        """Return the newest picture where there is one since the last call; never waits."""

    def close(self) -> None:
        """Stop it; a truth asked for later stops the one before by itself."""


Truth = Callable[[Any, float], Tracing]
"""truth(player, time) begins to trace what a player shows at `time` seconds: its scene as changed,
its camera, sun and size, without what is hidden and what is switched off."""
