"""Light positions (`.lp`): which photograph was taken under a light from where.

The first line is a count; then a line a photograph: its file name, which may hold spaces, and x, y,
z towards the light, x right, y up, z to the camera. Files in the wild have byte order marks, full
paths of another machine, vectors that are not of unit length and lights just under the horizon.
"""

from __future__ import annotations

from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files.reading import read_bytes

MAX_FILE_BYTES = 4 << 20
"""Largest file: 10,000 lines with paths of 400 characters."""
SHORTEST = 1e-4
"""Shortest vector that still has a direction, as in relight's reader."""
USUAL_LENGTHS = (0.5, 2.0)
"""Lengths outside may be positions in metres or degrees: the reader says so."""
LOWEST_Z = -0.05
"""Lowest z of a unit direction: three degrees below the horizon, more than a dome's sag."""


@dataclass(frozen=True)
class LightPositions:
    """Photographs and their lights, in the order of the file.

    files : n paths that exist.  directions : (n, 3) unit, towards the light.  notes : what a reader
    had to put right.
    """

    files: tuple[Path, ...]
    directions: NDArray[np.float64]
    notes: tuple[str, ...]


def read(path: Path) -> LightPositions:
    """Read a `.lp` file; photographs lie beside it, or where its relative paths say.

    Raises InputError, with the number of the line, for a count that is none or is not that of the
    lines, lines without a name and three numbers, vectors that are zero, not finite or point behind
    the object, and photographs that are not there.
    """
    path = Path(path)
    lines = [(i, line.strip()) for i, line in enumerate(_text(path).splitlines(), 1)]
    lines = [(i, line) for i, line in lines if line]
    count = _count(path, lines)
    if count != len(lines) - 1:
        value = f"{count} announced, {len(lines) - 1} lines follow"
        raise InputError(path, "count", value, "make the first line the number of photographs")
    files, vectors, beside = [], np.empty((count, 3)), _beside(path.parent)
    for n, (i, line) in enumerate(lines[1:]):
        name, vectors[n] = _entry(path, i, line)
        files.append(_found(path, i, name, beside))
    lengths = np.sqrt(np.sum(np.square(vectors), axis=1))
    directions = vectors / lengths[:, None]
    for (i, _), direction in zip(lines[1:], directions, strict=True):
        if direction[2] < LOWEST_Z:
            remedy = "z points from the object to the camera: check the axes"
            raise InputError(path, f"line {i}", f"z = {direction[2]:.3f}", remedy)
    return LightPositions(tuple(files), directions, _notes(files, lengths, directions))


def _text(path: Path) -> str:
    data = read_bytes(path, MAX_FILE_BYTES)
    try:
        return data.decode("utf-16" if data[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) else "utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _count(path: Path, lines: list[tuple[int, str]]) -> int:
    first = lines[0][1] if lines else ""
    if not (first.isascii() and first.isdigit() and 0 < int(first[:9]) < 10**8):
        raise InputError(path, "line 1", first, "begin with the number of photographs")
    return int(first[:9])


def _entry(path: Path, i: int, line: str) -> tuple[str, list[float]]:
    parts = line.rsplit(None, 3)
    remedy = "write a file name and three finite numbers, not all zero"
    try:
        vector = [float(part) for part in parts[1:]]
    except ValueError as error:
        raise InputError(path, f"line {i}", line, remedy) from error
    # The bound on top keeps squares finite
    if len(vector) != 3 or not SHORTEST < max(abs(v) for v in vector) < 1e100:
        raise InputError(path, f"line {i}", line, remedy)
    if any(v != v for v in vector):
        raise InputError(path, f"line {i}", line, remedy)
    return parts[0].strip("\"'"), vector


def _beside(folder: Path) -> dict[str, list[Path]]:
    """Return the files of a folder by their names in lower case."""
    found: dict[str, list[Path]] = {}
    with suppress(OSError):
        for file in folder.iterdir():
            found.setdefault(file.name.lower(), []).append(file)
    return found


def _found(path: Path, i: int, name: str, beside: dict[str, list[Path]]) -> Path:
    """Return the file: under its relative path, else by its last name beside the `.lp`, where one
    alone has that name but for upper and lower case."""
    # Windows paths split at both slashes
    stored = PureWindowsPath(name)
    candidates = [path.parent / stored.name]
    if not stored.anchor:
        candidates.insert(0, path.parent.joinpath(*stored.parts))
    if len(alike := beside.get(stored.name.lower(), [])) == 1:
        candidates += alike
    for candidate in candidates:
        with suppress(OSError):  # such as a name that is too long
            if candidate.is_file():
                return candidate
    raise InputError(path, f"line {i}", name, "no such photograph: put it beside the .lp file")


def _notes(
    files: list[Path], lengths: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[str, ...]:
    notes = []
    low, high = USUAL_LENGTHS
    if strange := int(np.count_nonzero((lengths < low) | (lengths > high))):
        notes.append(
            f"{strange} light vectors are {lengths.min():.3g} to {lengths.max():.3g} long: "
            "taken as directions (angles would have to be turned into x, y, z first)"
        )
    if below := int(np.count_nonzero(directions[:, 2] < 0)):
        notes.append(f"{below} lights stand below the horizon, the lowest at z = "
                     f"{directions[:, 2].min():.3g}")  # fmt: skip
    if repeated := len(files) - len(set(files)):
        notes.append(f"{repeated} photographs are named more than once")
    return tuple(notes)
