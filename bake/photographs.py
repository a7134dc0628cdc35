"""Photographs of one view under lights of a dome, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bake import workers
from formats.errors import InputError, MachineError
from formats.files import image, light_positions

Float = NDArray[np.float32]
Space = Literal["linear", "stored"]

MAX_BYTES = 8 << 30
"""Largest set in memory, as float32: 110 photographs of 6 megapixels."""
GRAZING = 0.0872  # sine of five degrees: under it harmonics hardly know where a light stands


@dataclass(frozen=True, eq=False)
class Photographs:
    """pictures : (n, h, w, 3) float32 in 0..1, linear or as stored, as `space` says. directions :
    (n, 3) unit, towards the light of each. notes : what a reader of the result should know."""

    pictures: Float
    directions: NDArray[np.float64]
    space: Space
    notes: tuple[str, ...] = ()


def load(path: Path, *, space: Space = "linear") -> Photographs:
    """Read a `.lp` file and its photographs. InputError for sets that are none, by file."""
    lights = light_positions.read(path)
    first = _picture(lights.files[0], space)
    count = len(lights.files)
    if count * first.nbytes > MAX_BYTES:
        size = f"{count} photographs of {first.shape[1]} x {first.shape[0]}"
        raise MachineError(path, "size", size, f"shrink them: over {MAX_BYTES >> 30} GiB in memory")
    pictures = np.empty((count, *first.shape), np.float32)

    def fill(n: int) -> None:
        picture = _picture(lights.files[n], space)
        if picture.shape != first.shape:
            size, other = (f"{p.shape[1]} x {p.shape[0]}" for p in (picture, first))
            remedy = f"{lights.files[0].name} has {other}: make all one size"
            raise InputError(lights.files[n], "size", size, remedy)
        pictures[n] = picture

    workers.map_tiles(fill, range(count))
    found = [*lights.notes, *_notes(pictures, lights)]
    return Photographs(pictures, lights.directions, space, tuple(found))


def _picture(path: Path, space: Space) -> Float:
    """Read a picture as (h, w, 3)."""
    picture = image.read(path, space=space)
    if picture.shape[2] in (2, 4):
        if picture[..., -1].min() < 1:
            raise InputError(path, "alpha", "not opaque", "photographs carry no alpha: flatten it")
        picture = picture[..., :-1]
    return np.broadcast_to(picture, (*picture.shape[:2], 3))


def _notes(pictures: Float, lights: light_positions.LightPositions) -> list[str]:
    notes = []
    brightest = pictures.max(axis=(1, 2, 3))
    clipped = [float(np.mean(picture.min(axis=2) >= 1)) for picture in pictures]
    for n, file in enumerate(lights.files):
        if brightest[n] < 0.02:
            notes.append(f"{file.name} is black")
        if clipped[n] > 0.5:
            notes.append(f"{file.name} is overexposed: {clipped[n]:.0%} of it is white")
    if grazing := int(np.count_nonzero(lights.directions[:, 2] < GRAZING)):
        notes.append(f"{grazing} lights stand under 5 degrees, where azimuths are hard to tell")
    return notes
