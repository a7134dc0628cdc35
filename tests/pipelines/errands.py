"""Work for a process beside: functions that it can import by name."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from formats.errors import InputError


def count(request, tell):
    """Tell numbers up to the one asked for; refuse, fail, die or dawdle where asked to."""
    if isinstance(request, Path):
        raise InputError(request, "field", 3, "write 4")
    if request == "fail":
        raise ValueError("two\nlines")
    if request == "die":
        os._exit(7)
    if request == "memory":
        # Stays from request to request
        sys.bakelight_seen = getattr(sys, "bakelight_seen", 0) + 1
        tell(sys.bakelight_seen)
        return
    if isinstance(request, float):
        until = time.monotonic() + request
        while time.monotonic() < until:
            tell(None)
            time.sleep(0.01)
        tell("slept")
        return
    for number in range(request):
        tell((number, os.getpid()))
