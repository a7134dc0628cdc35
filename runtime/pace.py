"""How coarse to draw while hands or time move, so that a slow machine keeps up. No OpenGL."""

from __future__ import annotations

AIM = 50.0  # milliseconds a frame
COARSEST = 4


class Pace:
    """Chooses by what frames took. factor : pixels of the screen along a side of one drawn."""

    def __init__(self) -> None:
        self.factor = 1

    def size(self, full: tuple[int, int], moving: bool) -> tuple[int, int]:
        """Return the size (width, height) to draw a picture of `full` pixels in."""
        factor = self.factor if moving else 1
        return max(1, full[0] // factor), max(1, full[1] // factor)

    def took(self, milliseconds: float, moving: bool = True) -> None:
        """Note what a frame took, drawn as `size` said."""
        drawn = self.factor if moving else 1
        # Cost by pixels: the finest that would keep the aim
        wanted = next(
            (f for f in range(1, COARSEST) if milliseconds * (drawn / f) ** 2 <= AIM), COARSEST
        )
        # Back a step at a time, so that it does not swing
        self.factor = wanted if wanted >= drawn else drawn - 1
