"""Photographs of one view under lights of a dome, as arrays; renders of a mesh are such a set."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bake import workers
from formats import report, seal
from formats.errors import DamagedError, InputError, MachineError
from formats.files import exr, image, light_positions

Float = NDArray[np.float32]
Space = Literal["linear", "stored"]

FORMAT = 1
KIND = "photographs"
MAX_BYTES = 8 << 30
"""Largest set in memory, as float32: 110 photographs of 6 megapixels."""
GRAZING = 0.0872  # sine of five degrees: under it harmonics hardly know where a light stands
LARGEST = 1e30  # sums of squares of many are still finite in double precision


@dataclass(frozen=True, eq=False)
class Photographs:
    """pictures : (n, h, w, 3) float32, linear or as stored (0..1), as `space` says, under a sun of
    irradiance pi. directions : (n, 3) unit, towards the light of each. notes : what a reader of the
    result should know. coverage : (h, w), 0..1; pictures are premultiplied by it; None is opaque.
    metres_per_texel, pivot : (x, y) texels from the top left to the ground point; 0 stands for a
    picture 1 m high on the middle of its lower edge. height : metres of the object. views : stacked
    along the rows, view v in rows v h / views and on.
    """

    pictures: Float
    directions: NDArray[np.float64]
    space: Space
    notes: tuple[str, ...] = ()
    coverage: Float | None = None
    metres_per_texel: float = 0.0
    pivot: tuple[float, float] = (0.0, 0.0)
    height: float = 1.0
    views: int = 1

    def __post_init__(self) -> None:
        if self.metres_per_texel <= 0 and self.pictures.ndim == 4 and self.pictures.size:
            rows, columns = self.pictures.shape[1] // self.views, self.pictures.shape[2]
            object.__setattr__(self, "metres_per_texel", self.height / rows)
            object.__setattr__(self, "pivot", (columns / 2, float(rows)))

    def save(self, folder: Path) -> None:
        """Write `photographs.exr`, a part a picture in half floats, and `report.json`.

        Values beyond +-65504 are clamped, the rest rounded by up to 1 in 2,048.
        """
        parts = {f"light{n}": picture for n, picture in enumerate(self.pictures)}
        if self.coverage is not None:
            parts["coverage"] = self.coverage[..., None]
        exr.write(folder / "photographs.exr", parts, half=True, compression="none")
        layout = {
            "directions": self.directions,
            "space": self.space,
            "covered": self.coverage is not None,
            "metres_per_texel": self.metres_per_texel,
            "pivot": list(self.pivot),
            "height": self.height,
            "views": self.views,
        }
        quality = {"notes": list(self.notes)}
        data = {"format": FORMAT, "kind": KIND, "layout": layout, "quality": quality}
        report.write(folder, data)

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Photographs:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data = report.read(folder)
        if data.get("kind") != KIND or data.get("format") != FORMAT:
            found = f"{data.get('kind')} of format {data.get('format')}"
            raise DamagedError(folder, "kind", found, f"expected format {FORMAT}: bake it again")
        layout = data["layout"]
        if seal.is_sealed(folder):
            seal.read_bytes(folder, "photographs.exr")
        parts = exr.read(folder / "photographs.exr")
        directions = np.asarray(layout["directions"], np.float64)
        pictures = np.empty((len(directions), *parts["light0"].shape), np.float32)
        for n in range(len(directions)):
            pictures[n] = parts.pop(f"light{n}")
        coverage = np.asarray(parts["coverage"][..., 0], np.float32) if layout["covered"] else None
        return cls(
            pictures=pictures,
            directions=directions,
            space=layout["space"],
            notes=tuple(data["quality"]["notes"]),
            coverage=coverage,
            metres_per_texel=float(layout["metres_per_texel"]),
            pivot=(float(layout["pivot"][0]), float(layout["pivot"][1])),
            height=float(layout["height"]),
            views=int(layout["views"]),
        )

    def checked(self, where: object = "photographs") -> Photographs:
        """Return the set with arrays of the declared types, contiguous, native byte order.

        Raises InputError for an array of wrong shape or type and for numbers that are not finite or
        out of range; `where` names it.
        """
        shape = np.shape(self.pictures)
        if len(shape) != 4 or shape[3] != 3 or not np.size(self.pictures):
            raise InputError(where, "pictures", str(shape), "give (n, h, w, 3)")
        if self.views < 1 or shape[1] % self.views:
            raise InputError(where, "views", self.views, "views share the rows evenly")
        if self.space not in ("linear", "stored"):
            raise InputError(where, "space", self.space, "choose linear or stored")
        kinds: dict[str, tuple[tuple[int, ...], float, Any]] = {
            "pictures": (shape, LARGEST, np.float32),
            "directions": ((shape[0], 3), 1.0 + 1e-6, np.float64),
        }
        if self.coverage is not None:
            kinds["coverage"] = (shape[1:3], 1.0, np.float32)
        arrays: dict[str, Any] = {}
        for name, (wanted, top, kind) in kinds.items():
            array = np.asarray(getattr(self, name))
            if array.dtype.kind != "f" or array.shape != wanted:
                found = f"{array.dtype} {array.shape}"
                raise InputError(where, name, found, f"give floats of shape {wanted}")
            low, high = float(array.min()), float(array.max())
            if not (-top <= low and high <= top) or (name == "coverage" and low < 0):
                remedy = f"give finite numbers of magnitude up to {top:g}"
                raise InputError(where, name, f"from {low:g} to {high:g}", remedy)
            arrays[name] = np.ascontiguousarray(array, kind)
        lengths = np.sqrt(np.sum(np.square(arrays["directions"]), axis=1))
        if np.abs(lengths - 1).max() > 1e-6:
            raise InputError(where, "directions", "not of length 1", "give unit vectors")
        return replace(self, **arrays)


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
        brightest[n] = picture.max()
        white = (picture[..., 0] >= 1) & (picture[..., 1] >= 1) & (picture[..., 2] >= 1)
        clipped[n] = np.count_nonzero(white) / white.size

    brightest, clipped = np.empty(count), np.empty(count)
    workers.map_tiles(fill, range(count))
    found = [*lights.notes, *_notes(brightest, clipped, lights)]
    return Photographs(pictures, lights.directions, space, tuple(found))


def _picture(path: Path, space: Space) -> Float:
    """Read a picture as (h, w, 3)."""
    picture = image.read(path, space=space)
    if picture.shape[2] in (2, 4):
        if picture[..., -1].min() < 1:
            raise InputError(path, "alpha", "not opaque", "photographs carry no alpha: flatten it")
        picture = picture[..., :-1]
    return np.broadcast_to(picture, (*picture.shape[:2], 3))


def _notes(
    brightest: NDArray[np.float64],
    clipped: NDArray[np.float64],
    lights: light_positions.LightPositions,
) -> list[str]:
    notes = []
    for n, file in enumerate(lights.files):
        if brightest[n] < 0.02:
            notes.append(f"{file.name} is black")
        if clipped[n] > 0.5:
            notes.append(f"{file.name} is overexposed: {clipped[n]:.0%} of it is white")
    if grazing := int(np.count_nonzero(lights.directions[:, 2] < GRAZING)):
        notes.append(f"{grazing} lights stand under 5 degrees, where azimuths are hard to tell")
    return notes
