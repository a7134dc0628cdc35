"""Milliseconds of the passes over the last frames, for a graph. No OpenGL."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

FRAMES = 120


class History:
    """The last frames: for each, pass -> milliseconds of those that ran."""

    def __init__(self, frames: int = FRAMES) -> None:
        self.frames: deque[dict[str, float]] = deque(maxlen=frames)
        self._before: dict[str, float] = {}

    def add(self, milliseconds: Mapping[str, float], skipped: tuple[str, ...] = ()) -> None:
        """Add a frame by what each pass took when it last ran: an equal number did not run."""
        ran = {
            name: spent
            for name, spent in milliseconds.items()
            if self._before.get(name) != spent and name not in skipped
        }
        self._before = dict(milliseconds)
        self.frames.append(ran)

    @property
    def names(self) -> list[str]:
        """Passes that ran in any of these frames, in the order of a frame."""
        seen = {name for frame in self.frames for name in frame}
        return [name for name in self._before if name in seen]

    @property
    def usual(self) -> float:
        """Milliseconds of the median frame, 0 for none."""
        return self._quantile(0.5)

    @property
    def most(self) -> float:
        """Milliseconds that nine frames of ten stay below; 0 for none."""
        return self._quantile(0.9)

    def _quantile(self, share: float) -> float:
        spent = sorted(sum(frame.values()) for frame in self.frames)
        return spent[int(share * (len(spent) - 1))] if spent else 0.0

    @property
    def last(self) -> dict[str, float]:
        """The last frame."""
        return self.frames[-1] if self.frames else {}

    def mean(self) -> dict[str, float]:
        """Mean milliseconds a frame of each pass."""
        count = max(len(self.frames), 1)
        return {n: sum(f.get(n, 0.0) for f in self.frames) / count for n in self.names}
