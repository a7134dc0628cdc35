"""Light of a world of cubes in which something changes, gathered as it plays; no draw.

A picture of a moment by itself is gathered until the light has settled to the scene's error; from
frame to frame of an animation, a few rays a texel follow what changes. Reads and writes no target.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np

from runtime import cubes
from runtime.gather import Gather, Knobs

MOST = 4096
"""Passes of a picture by itself, at most."""
AT_ONCE = 64
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
            adopt=player.targets.adopt,
        )
        self.cubes.light = self.gather.lightmap()
        self._time: float | None = None
        self._state: Hashable = None

    def key(self, time: float) -> Hashable:
        """All that the light of `time` seconds depends on; None while it has not settled."""
        state = self._state_at(time)
        if state != self._state or not self._settled:
            return None
        # What stays is the light of this moment too
        self._time = time
        return state

    @property
    def _settled(self) -> bool:
        """Whether passes have ended: asked for where they would, for it reads the sums back."""
        return self.gather.since % AT_ONCE == 0 and self.gather.converged

    def _state_at(self, time: float) -> Hashable:
        sky = self.cubes.sky(self._player.lights)
        return self.cubes.state(time), None if sky is None else sky.tobytes()

    def draw(self, time: float) -> None:
        """Take over what changed, and gather."""
        frame = 1.0 / self._player.scene.time.frame_rate
        cut = self._time is None or abs(time - self._time) > CUT * frame
        state, self._time = self._state_at(time), time
        if state != self._state:
            self._state = state
            self._follow(time)
        if cut and self._player.patient:
            done = 0
            while not self._settled:
                done += self.gather.step(AT_ONCE - self.gather.since % AT_ONCE)
        else:
            done = self.gather.step(self._player.scene.voxels.passes)
        self.cubes.lit += done > 0

    def release(self) -> None:
        """Free what the gather made on the card."""
        self.gather.release()

    def _follow(self, time: float) -> None:
        changes = self.cubes.at(time)
        if changes:
            self.gather.changed(changes)
        self.gather.set_free(self.cubes.free_lamps(time))
        sky = self.cubes.sky(self._player.lights)
        if sky is not None and not np.array_equal(sky, self._sky):
            self._sky = sky
            self.gather.set_environment(sky)
