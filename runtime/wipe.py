"""The picture on the other side of the divider: traced, kept, or without an effect.

Nothing here knows a window; `runtime.window` shows `Wipe.picture` left of the divider.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from runtime import reuse
from runtime.truth import Traced, Tracing, Truth

Picture = NDArray[np.uint8]
MODES = ("off", "truth", "kept", "effect")


class Wipe:
    """What the live picture is compared with.

    truth : None where nothing can trace. at : the divider, share of the picture's width. effect :
    the one that the other picture goes without.
    """

    def __init__(self, truth: Truth | None = None) -> None:
        self._truth = truth
        self.mode, self.at, self.effect = "off", 0.5, ""
        self.kept: Picture | None = None
        self._tracing: Tracing | None = None
        self._traced: Traced | None = None
        self._of: Any = None

    @property
    def modes(self) -> tuple[str, ...]:
        """Those that there is something for."""
        there = {"truth": self._truth, "kept": self.kept is not None, "effect": self.effect}
        return tuple(mode for mode in MODES if there.get(mode, True))

    def choose(self, mode: str) -> None:
        """Compare with something else."""
        if mode != "truth":
            self.stop()
        self.mode = mode

    def next(self) -> None:
        """Go on to the next mode."""
        modes = self.modes
        at = modes.index(self.mode) if self.mode in modes else 0
        self.choose(modes[(at + 1) % len(modes)])

    def keep(self, picture: Picture) -> None:
        """Keep a picture (h, w, 3 or 4) to compare with."""
        self.kept = picture[..., :3].copy()
        self.choose("kept")

    def follow(self, player: Any, time: float, edits: Any, still: bool) -> bool:
        """Trace what is seen now; True where there is a newer picture or word about it.

        A tracing ends when what is seen differs from what it began with; another begins where the
        view holds still. edits : what else the picture depends on, equal where it is the same.
        """
        if self.mode != "truth" or self._truth is None:
            return False
        camera = reuse.camera(player.view, lens=True)
        of = id(player), time, player.targets.size, camera, player.sun_turn, edits
        if self._of is not None and of != self._of:
            self.stop()
            return True
        if self._of is None:
            if still:
                self._of, self._tracing = of, self._truth(player, time)
            return still
        said = self.label
        newer = self._tracing.poll() if self._tracing else None
        self._traced = newer or self._traced
        return newer is not None or said != self.label

    def stop(self) -> None:
        """End a tracing and forget its picture."""
        if self._tracing is not None:
            self._tracing.close()
        self._tracing = self._traced = self._of = None

    @property
    def waiting(self) -> bool:
        """Whether a picture is to come."""
        if self.mode != "truth":
            return False
        return self._tracing is None or self._tracing.busy is not None

    @property
    def picture(self) -> Picture | None:
        """The other picture (h, w, 3), row 0 on top, where it is known without drawing it."""
        if self.mode == "truth":
            return self._traced.picture if self._traced else None
        return self.kept if self.mode == "kept" else None

    @property
    def label(self) -> str:
        """What the other picture is."""
        if self.mode == "truth":
            return self._said()
        return {"kept": "kept", "effect": "without " + self.effect.replace("_", " ")}[self.mode]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the other picture leaves out."""
        return self._traced.notes if self._traced else ()

    def _said(self) -> str:
        if self._tracing is None:
            return "truth: hold still"
        if self._tracing.error is not None:
            return self._tracing.error
        if self._traced is None:
            return self._tracing.busy or "tracing"
        paths = self._traced.samples
        if paths < 1:
            return "traced, coarse as yet"
        return f"traced, {paths:.0f} path{'s' * (paths > 1)} a pixel"
