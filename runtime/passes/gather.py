"""Light of a world of cubes in which something changes, gathered as it plays; no draw.

A picture of a moment by itself is gathered until the light has settled to the scene's error; from
frame to frame of an animation, a few rays a texel follow what changes; in a window, as many of them
as leave the hands free. Reads and writes no target.
"""

from __future__ import annotations

import time as clocks
from collections.abc import Hashable
from typing import Any

import numpy as np

from runtime import cubes, light_sights, reuse
from runtime.gather import Gather, Knobs

MOST = 4096
"""Passes of a picture by itself, at most."""
AT_ONCE = 64
FIRST = 8
"""Passes of the first frame of a window, which shows at once and settles from there."""
CUT = 2.5
"""Frames between two times that are no animation any more."""


class Pass:
    """Gathers the light that `voxels` shows."""

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def __init__(self, player: Any) -> None:
        self._player = player
        self.cubes = cubes.of(player)
        world = player.scene.voxels
        knobs = Knobs(mode=world.mode, bounces=world.bounces, error=world.error, most=MOST)
        self._sky = self.cubes.sky(player.lights)
        self.gather = Gather(
            player.ctx,
            player.programs,
            self.cubes.volume,
            self.cubes.faces,
            knobs=knobs,
            environment=self._sky,
            free=self.cubes.free_lamps(0.0),
            lights=self._lights(),
            adopt=player.targets.adopt,
        )
        self.cubes.light = self.gather.lightmap()
        self._time: float | None = None
        self._state: Hashable = None
        self._view: Hashable = None
        self._saved = self._cost = 0.0

    def key(self, time: float) -> Hashable:
        """All that the light of `time` seconds depends on; None while it has not settled."""
        state = self._state_at(time)
        if state != self._state or not self.settled:
            return None
        # What stays is the light of this moment too
        self._time = time
        return state

    @property
    def settled(self) -> bool:
        """Whether passes have ended: asked for where they would, for it reads the sums back."""
        return self.gather.since % AT_ONCE == 0 and self.gather.converged

    def _state_at(self, time: float) -> Hashable:
        sky = self.cubes.sky(self._player.lights)
        lights = reuse.frozen(self._player.lights)
        return self.cubes.state(time), lights, None if sky is None else sky.tobytes()

    def _lights(self) -> Any:
        """The scene's lights as they are, in cells; None where it has none but environments."""
        volume = self.cubes.volume
        if not light_sights.count(self._player.scene):
            return None
        return light_sights.in_cells(self._player.lights, volume.origin, volume.cell_size)

    def draw(self, time: float) -> None:
        """Take over what changed, and gather."""
        frame = 1.0 / self._player.scene.time.frame_rate
        first = self._time is None
        cut = first or abs(time - self._time) > CUT * frame
        state, self._time = self._state_at(time), time
        changed = state != self._state
        if changed:
            self._state = state
            self._follow(time)
        if cut and self._player.patient:
            done = 0
            while not self.settled:
                done += self.gather.step(AT_ONCE - self.gather.since % AT_ONCE)
        else:
            passes = self._player.scene.voxels.passes
            done = self._step(min(passes, FIRST) if first else passes, changed)
        self.cubes.lit += done > 0

    def settle(self) -> None:
        """Add passes for the moment that was drawn last."""
        if not self.settled:
            self.cubes.lit += self._step(self._player.scene.voxels.passes, True) > 0

    def _step(self, passes: int, changed: bool) -> int:
        """Add passes, no longer than the player's haste; returns how many.

        Where even a pair takes longer, a camera that moves saves up for it.
        """
        if (haste := self._player.haste) is None:
            return self.gather.step(passes)
        view = reuse.camera(self._player.view)
        still, self._view = view == self._view, view
        self._saved = min(self._saved + haste, max(haste, self._cost))
        if changed or still:
            self._saved = max(self._saved, self._cost)
        done, added = 0, 1
        while done < passes and added and self._saved >= self._cost:
            start = clocks.perf_counter()
            added = self.gather.step(2)
            self._player.ctx.finish()
            self._cost = clocks.perf_counter() - start
            self._saved = min(self._saved - self._cost, haste)
            done += added
        return done

    def release(self) -> None:
        """Free what the gather made on the card."""
        self.gather.release()

    def _follow(self, time: float) -> None:
        changes = self.cubes.at(time)
        if changes:
            self.gather.changed(changes)
        self.gather.set_free(self.cubes.free_lamps(time))
        self.gather.set_lights(self._lights())
        sky = self.cubes.sky(self._player.lights)
        if sky is not None and not np.array_equal(sky, self._sky):
            self._sky = sky
            self.gather.set_environment(sky)
