"""A process beside this one, for work that must not hold up a window: one piece at a time.

It starts when it is first asked and stays, so that what it imported and read serves again. It ends
with this process, however that ends, and takes no Ctrl-C of its own.
"""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from formats.errors import BakelightError

NICENESS = 5  # the window goes first
STOPPING = 2.0  # seconds for the process to end by itself

Tell = Callable[[Any], None]
Work = Callable[[Any, Tell], None]


class DroppedError(Exception):
    """Something newer was asked for: what is under way ends here."""


class Beside:
    """Does `work(request, tell)` in a process of its own; `poll` returns what `tell` is given.

    work : a function of a module; requests, never None, and messages can be pickled. A request
    drops the one under way at its next `tell`; `tell(None)` sends nothing and is only that chance.
    """

    def __init__(self, work: Work) -> None:
        self._work = work
        self._process: Any = None
        self._connection: Any = None
        self._number = 0

    def ask(self, request: Any) -> None:
        """Begin with a request, instead of the one under way."""
        self._number += 1
        for _ in range(2):
            if self._process is None:
                self._start()
            try:
                self._connection.send((self._number, request))
                return
            except OSError:  # it died idle
                self.stop()

    def drop(self) -> None:
        """Let what is under way end at its next `tell`."""
        if self._process is not None:
            self.ask(None)

    def poll(self) -> list[Any]:
        """Return the messages of the latest request since the last call; an Ended is the last."""
        found: list[Any] = []
        if self._process is None:
            return found
        try:
            while self._connection.poll():
                number, message = self._connection.recv()
                if number == self._number:
                    found.append(message)
        except (EOFError, OSError):
            code = self._process.exitcode
            self.stop()
            found.append(Ended(f"the process beside the window ended with code {code}"))
        return found

    def stop(self) -> None:
        """End the process and what it does; `ask` starts another."""
        if self._process is None:
            return
        self._connection.close()
        self._process.terminate()
        self._process.join(STOPPING)
        if self._process.exitcode is None:
            self._process.kill()
            self._process.join()
        self._process.close()
        self._process = self._connection = None

    def _start(self) -> None:
        ours, theirs = multiprocessing.Pipe()
        spawn = multiprocessing.get_context("spawn")
        self._process = spawn.Process(target=_serve, args=(theirs, self._work), daemon=True)
        self._process.start()
        theirs.close()
        self._connection = ours


class Ended:
    """The last message of a request. error : one line, None where all went well."""

    def __init__(self, error: str | None = None) -> None:
        self.error = error


def _serve(connection: Any, work: Work) -> None:
    """Do what is asked until the other end goes away."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(AttributeError, OSError):
        os.nice(NICENESS)
    asked: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(connection, asked), daemon=True).start()
    while True:
        number, request = asked.get()
        while not asked.empty():
            number, request = asked.get()
        if request is None:
            continue

        def tell(message: Any, number: int = number) -> None:
            if not asked.empty():
                raise DroppedError
            if message is not None:
                try:
                    connection.send((number, message))
                except OSError:
                    os._exit(0)

        with suppress(DroppedError):
            try:
                work(request, tell)
                tell(Ended())
            except BakelightError as error:
                tell(Ended(str(error)))
            except DroppedError:
                raise
            except Exception as error:
                tell(Ended(f"{type(error).__name__}: {error}".replace("\n", " ")))


def _listen(connection: Any, asked: queue.SimpleQueue[tuple[int, Any]]) -> None:
    try:
        while True:
            asked.put(connection.recv())
    except (EOFError, OSError):
        # The window is gone: end at once, whatever is under way
        os._exit(0)
