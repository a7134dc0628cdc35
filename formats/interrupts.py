"""Ctrl-C, kept back for a moment."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class Held:
    """Whether Ctrl-C was asked for while it is kept back."""

    asked = False


@contextmanager
def held() -> Iterator[Held]:
    """Keep Ctrl-C back until the block ends, then raise the KeyboardInterrupt that was asked for.

    For code that swallows exceptions it does not know, such as a window's callbacks, and for code
    that takes locks: Python's own are left locked, or released twice, by an exception out of a
    signal. In other threads than the main one, which never get the signal, and where the signal
    means something else, nothing is done.
    """
    told = Held()
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield told
        return

    def note(number: int, frame: object) -> None:
        told.asked = True

    signal.signal(signal.SIGINT, note)
    try:
        yield told
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if told.asked:
        raise KeyboardInterrupt
