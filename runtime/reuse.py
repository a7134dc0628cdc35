"""Which passes of a frame may stay as the last frame left them.

A pass says by `key(time)` all that its drawing depends on besides what it reads; None, or no such
method, means that it always draws. What is drawn depends on every pass before too, so only passes
from the first on can stay. Where a later pass draws over their colour or depth, a copy of both
brings them back: it is made once those passes came out unchanged in two frames running.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from runtime.camera import Camera

Chain = tuple[tuple[str, Hashable], ...]
COPIED = {"colour", "depth"}


@dataclass(frozen=True)
class Steps:
    """How to draw a frame: from pass number `first` on.

    restore : bring the copy back before. keep : number of the pass before which to make a copy,
    None for no copy. depth : whether the copy to bring back, or to make, holds depth too.
    """

    first: int = 0
    restore: bool = False
    keep: int | None = None
    restore_depth: bool = False
    keep_depth: bool = False


class Reuse:
    """What the targets hold, and what the copy holds."""

    def __init__(self) -> None:
        self._drawn: Chain = ()
        self._kept: Chain = ()
        self._last = 0

    def forget(self) -> None:
        """Take nothing for drawn."""
        self._drawn = self._kept = ()
        self._last = 0

    def plan(self, chain: Chain, passes: list[Any], sampled: bool) -> Steps:
        """Return how to draw `chain`, the name and key of each of `passes` in frame order.

        sampled : opaque passes draw on samples, which are not copied.
        """
        drawn, self._drawn = self._drawn, ()
        same = _common(chain, drawn)
        if same == len(chain):
            self._drawn = drawn
            return Steps(first=same)
        while same and not _can_start(passes, same, sampled):
            same -= 1
        last, self._last = self._last, same
        over = _overwritten(passes, same)
        if same and not over:
            return Steps(first=same)
        kept = len(self._kept)
        if not same or chain[:kept] != self._kept or kept > same:
            kept = 0
        # A copy that serves moves on only where the later start came twice
        moves = same > kept and (kept == 0 or same == last)
        keep = same if same and moves else None
        if keep is not None:
            # Until the frame is done there is no whole copy
            self._kept = ()
        return Steps(
            first=kept,
            restore=kept > 0,
            keep=keep,
            restore_depth="depth" in _overwritten(passes, kept),
            keep_depth="depth" in over,
        )

    def done(self, chain: Chain, steps: Steps) -> None:
        """Note that the targets hold all of `chain`, drawn by `steps`."""
        if self._drawn[: len(chain)] != chain:
            self._drawn = chain
        if steps.keep is not None:
            self._kept = chain[: steps.keep]


def frozen(value: Any) -> Hashable:
    """Return what is equal for equal numbers: arrays by their bytes, dataclasses by their fields.

    >>> frozen((1.0, np.arange(2.0))) == frozen((1.0, np.arange(2.0)))
    True
    """
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if is_dataclass(value):
        return tuple(frozen(getattr(value, f.name)) for f in fields(value))
    if isinstance(value, list | tuple):
        return tuple(map(frozen, value))
    if isinstance(value, dict):
        return tuple((name, frozen(each)) for name, each in value.items())
    return value


def camera(view: Any, lens: bool = False) -> Hashable:
    """Return what a pass depends on in a camera; lens : whether the lens matters to it."""
    if type(view) is Camera and not lens:
        view = replace(view, f_number=None, focus_distance=None)
    return type(view), frozen(view)


def key(drawn: Any, time: float) -> Hashable:
    """Return the key of a pass at `time` seconds; one that equals nothing where it has none."""
    found = drawn.key(time) if hasattr(drawn, "key") else None
    return object() if found is None else found


def _common(chain: Chain, drawn: Chain) -> int:
    same = 0
    for ours, theirs in zip(chain, drawn, strict=False):
        if ours != theirs:
            break
        same += 1
    return same


def _can_start(passes: list[Any], first: int, sampled: bool) -> bool:
    """Tell whether a frame can be taken up before pass number `first`."""
    if not any(drawn.writes for drawn in passes[:first]):
        return False
    if sampled and any(getattr(drawn, "opaque", False) for drawn in passes[first:]):
        return False
    return _overwritten(passes, first) <= COPIED


def _overwritten(passes: list[Any], first: int) -> set[str]:
    """Return the targets of what comes before pass number `first` that it or a later one writes."""
    before = COPIED.union(*(drawn.writes for drawn in passes[:first]))
    return before.intersection(*[set().union(*(drawn.writes for drawn in passes[first:]))])
