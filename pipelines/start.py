"""How a command starts and ends: it makes much that stays until the end, and then leaves."""

from __future__ import annotations

import atexit
import gc
import os

SOME = 50_000
"""Objects made between two looks for cycles among the youngest; Python looks after 700."""


def lean() -> None:
    """Look for cycles seldom, and at the end for none: modules are full of them, all in use."""
    gc.set_threshold(SOME, 20, 20)
    atexit.register(gc.freeze)


def to_draw() -> None:
    """Leave the cores to the card's driver, which may draw on them; call before numpy is imported.

    What a picture asks of linear algebra is small, and more threads of it would wait for the next
    call by spinning.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
