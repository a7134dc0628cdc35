"""OpenEXR files that people bring, decoded in a process of their own: what crashes, hangs, prints
or takes all memory there harms nothing here.

OpenEXR is the one decoder here that is written in C++ for a rich format: 84 of its faults have had
numbers, and it prints to standard error by itself. A process costs .25 s a file, on a bake that
finds nothing in its store; pixels come back through a pipe. What the store holds is sealed, and
read by `formats.files.exr` without this. Pictures of other kinds are read in this process: see
docs/hard-cases.md for what was counted.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from formats.errors import BakelightError, DamagedError, InputError, MachineError
from formats.files.reading import check_readable

KIND = "OpenEXR picture"
MAX_FILE_BYTES = 1 << 31
"""Largest file, as of formats.files.exr."""
MEMORY = 8 << 30
"""Bytes of addresses that decoding may take: three times the largest picture, and 2 GiB."""
SECONDS = 60.0
"""Longest time for any file; a sound one of 100 MB takes 2 s."""
BYTES_A_SECOND = 1 << 22
"""Every so many bytes of a file give it a second more."""

_ERRORS = {kind.__name__: kind for kind in (InputError, MachineError, DamagedError)}
_PROGRAM = "import sys; from formats.files import apart; apart.serve(*sys.argv[1:])"


def read_exr(path: Path, *, program: str = _PROGRAM) -> dict[str, NDArray[np.float32]]:
    """Pictures of an OpenEXR file, and errors, as `formats.files.exr.read` gives them.

    InputError, too, where the decoder crashes or takes more than SECONDS and the time for its size.
    program : what is run, given the path and the seconds.
    """
    check_readable(path, MAX_FILE_BYTES)
    seconds = SECONDS + os.stat(path).st_size / BYTES_A_SECOND
    command = [sys.executable, "-P", "-c", program, str(path), str(seconds)]
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        # Ctrl-C is for this process, which then ends the other
        start_new_session=True,
    ) as process:
        late = threading.Event()

        def stop() -> None:
            late.set()
            process.kill()

        watch = threading.Timer(seconds, stop)
        watch.daemon = True
        watch.start()
        try:
            found = _received(process.stdout)
            if found is None:
                process.wait()
        finally:
            watch.cancel()
            process.kill()
    if found is not None:
        return found
    remedy = f"the file is damaged or not an {KIND}: export it again"
    what = f"took over {seconds:.0f} s" if late.is_set() else _ended(process.returncode)
    raise InputError(path, KIND, f"the decoder {what}", remedy)


def _received(stream: Any) -> dict[str, NDArray[np.float32]] | None:
    """Read what `serve` sent: pictures, or an error, which is raised; None where it broke off."""
    try:
        told = json.loads(stream.readline())
    except ValueError:
        return None
    if "error" in told:
        raise _ERRORS[told["error"]](*told["of"])
    found = {}
    for name, shape in told["pictures"]:
        picture = np.empty(shape, np.float32)
        if stream.readinto(picture.data.cast("B")) != picture.nbytes:
            return None
        found[name] = picture
    return found


def _ended(code: int) -> str:
    try:
        return f"crashed ({signal.Signals(-code).name})"
    except ValueError:
        return f"ended with {code}"


def serve(path: str, seconds: str) -> None:
    """Decode a file with limits, and send the pictures, or the error, to standard output."""
    # What libraries print must not come between
    with os.fdopen(os.dup(1), "wb") as stream:
        os.dup2(2, 1)
        _limit(float(seconds))
        from formats.files import exr

        try:
            pictures = exr.read(Path(path))
        except BakelightError as error:
            value = error.value if isinstance(error.value, str) else repr(error.value)
            of = (error.file, error.field, value, error.remedy)
            _send(stream, {"error": type(error).__name__, "of": of})
            return
        _send(stream, {"pictures": [(name, p.shape) for name, p in pictures.items()]})
        for picture in pictures.values():
            stream.write(picture.data.cast("B"))


def _send(stream: BinaryIO, told: dict[str, Any]) -> None:
    stream.write(json.dumps(told).encode() + b"\n")


def _limit(seconds: float) -> None:
    """Bound memory and processor time, should nobody be left to watch; not on Windows."""
    try:
        import resource
    except ImportError:
        return
    for kind, most in ((resource.RLIMIT_AS, MEMORY), (resource.RLIMIT_CPU, int(seconds) + 1)):
        hard = resource.getrlimit(kind)[1]
        if hard == resource.RLIM_INFINITY or hard > most:
            resource.setrlimit(kind, (most, hard))
