"""How a command starts and ends: it makes much that stays until the end, and then leaves."""

from __future__ import annotations

import atexit
import gc
import os
import sys

SOME = 50_000
"""Objects made between two looks for cycles among the youngest; Python looks after 700."""


def lean() -> None:
    """Look for cycles seldom, and at the end for none: modules are full of them, all in use."""
    gc.set_threshold(SOME, 20, 20)
    atexit.register(gc.freeze)


def streams() -> None:
    """Put something where standard streams are closed, before a file gets their numbers, and print
    what an encoding lacks as its escape; call before anything is opened."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # The lowest number that is free
            os.open(os.devnull, os.O_RDWR)
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w", encoding="utf-8", closefd=False))
        getattr(sys, name).reconfigure(errors="backslashreplace")


def to_draw() -> None:
    """Leave the cores to the card's driver, which may draw on them; call before numpy is imported.

    What a picture asks of linear algebra is small, and more threads of it would wait for the next
    call by spinning.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def plain(text: str) -> str:
    """Return text in one line without what a terminal would obey: escapes, other line breaks.

    >>> plain("red \\x1b[31m, two\\r\\nlines")
    'red \\\\x1b[31m, two\\\\r\\\\nlines'
    """
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
