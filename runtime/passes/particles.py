"""Particles: fills sets of sprites for the moment, which the billboard pass sorts and draws.

Reads and writes no target.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

from runtime import particles


class Pass:
    """Adds a set of sprites for each of the scene's particles."""

    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def __init__(self, player: Any) -> None:
        self._player = player
        named = {sprites.name: sprites for sprites in player.sprites}
        self._sets: list[Any] = []
        self._filled: Any = None
        if "billboard" not in player.called:
            # Sprites are forced off
            return
        for found in player.scene.particles:
            own = found.look.billboard
            made = particles.of_set(found, named[own]) if own else particles.disc_set(found)
            self._sets.append(made)
        player.sprites += self._sets

    def key(self, time: float) -> Hashable:
        """The moment, and what is described."""
        return time, tuple(map(id, self._player.scene.particles))

    def draw(self, time: float) -> None:
        """Fill the sets."""
        self.fill(time)

    def fill(self, time: float) -> None:
        """Put the sets where they are at `time` seconds, if they are not there yet."""
        scene = self._player.scene
        if not self._sets or self._filled == (time, scene):
            return
        described = {each.name: each for each in scene.billboards}
        for sprites, found in zip(self._sets, scene.particles, strict=True):
            billboards = described[found.look.billboard] if found.look.billboard else found.disc()
            particles.fill(sprites, found, billboards, time)
        self._filled = time, scene
