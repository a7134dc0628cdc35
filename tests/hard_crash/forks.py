"""Children that are forked from a process that has imported everything: a kill costs little."""

from __future__ import annotations

import importlib
import json
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from formats.errors import BakelightError

warnings.filterwarnings("ignore", category=DeprecationWarning, message=".*fork")


_write = os.write  # before a proof puts another one in its place


@dataclass
class Child:
    """A forked process and the pipe on which it tells how it ended."""

    pid: int
    pipe: int

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)

    def end(self) -> dict[str, Any]:
        """Wait; return {"value"}, {"refused", "code"} or {"fault"}; {"killed"} for a signal."""
        with open(self.pipe, "rb") as stream:
            told = stream.read()
        _, status = os.waitpid(self.pid, 0)
        if os.WIFSIGNALED(status):
            return {"killed": os.WTERMSIG(status)}
        found: dict[str, Any] = json.loads(told)
        return found


def start(function: Callable[[], Any]) -> Child:
    """Run a function in a forked child. Its value must be plain."""
    read, write = os.pipe()
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid == 0:
        os.close(read)
        told = json.dumps(_outcome(function)).encode()
        while told:
            told = told[_write(write, told) :]
        os._exit(0)
    os.close(write)
    return Child(pid, read)


def ended(function: Callable[[], Any]) -> dict[str, Any]:
    """Run a function in a forked child to its end."""
    return start(function).end()


def value(function: Callable[[], Any]) -> Any:
    """Run a function in a forked child; return its value. RuntimeError for everything else."""
    found = ended(function)
    if "value" not in found:
        raise RuntimeError(f"a child failed: {found}")
    return found["value"]


def _outcome(function: Callable[[], Any]) -> dict[str, Any]:
    try:
        return {"value": function()}
    except BakelightError as error:
        return {"refused": str(error), "code": error.exit_code}
    except BaseException:
        return {"fault": traceback.format_exc()}


def import_what(function: Callable[[], object]) -> int:
    """Import all modules that a function would, by letting a child run it; return how many.

    The parent itself must not run it: threads that libraries start do not survive a fork.
    """

    def modules() -> list[str]:
        function()
        return sorted(sys.modules)

    names = [name for name in value(modules) if name not in sys.modules]
    for name in names:
        with suppress(Exception):
            importlib.import_module(name)
    return len(names)
