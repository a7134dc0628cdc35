"""Light on the faces of a world of cubes (`lightmap.ktx2`, RGBA16F), and where they lie in it.

A texel holds irradiance, W/m^2, of what reaches its face; a surface there sends out its emission
and albedo / pi of it. Gutters are filled; alpha is 1 where a texel has light, gutters too, else 0.
`error.ktx2` is its standard error; `faces.npz` the rectangles.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report, seal
from formats.errors import DamagedError, InputError
from formats.files import atomic, ktx2
from formats.files.reading import read_bytes, refusing
from formats.lightmap_faces import Faces
from formats.lightmap_rectangles import RECTANGLE

__all__ = ["Faces", "Lightmap"]

FORMAT = 1
KIND = "lightmap"
NAME, ERROR_NAME, FACES_NAME = "lightmap.ktx2", "error.ktx2", "faces.npz"
LARGEST = 65504.0
"""Largest half float: light above it is clamped, and the report says where."""
MAX_BYTES = 1 << 30
MAX_CELLS = 1 << 27
AGAIN = "bake it again"

Float = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Lightmap:
    """Light on all faces.

    irradiance, error : (h, w, 3) float32, W/m^2 and its standard error, scene-linear Rec. 709; 0
    where no face is. Texels that `faces.source` leaves at -1, and gutters, count for nothing.
    """

    irradiance: Float
    error: Float
    faces: Faces
    quality: dict[str, Any] = field(default_factory=dict)

    def padded(self) -> Float:
        """Return irradiance and alpha (h, w, 4) with gutters filled."""
        source = self.faces.source()
        alpha = (source[..., 0] >= 0).astype(np.float32)
        shown = self.irradiance[np.maximum(source[..., 1], 0), np.maximum(source[..., 0], 0)]
        return np.concatenate([shown * alpha[..., None], alpha[..., None]], axis=2)

    def save(self, folder: Path) -> None:
        """Write the textures, the rectangles and `report.json` into an existing folder.

        Raises InputError for light of wrong shape, negative or not finite.
        """
        folder, (w, h) = Path(folder), self.faces.size
        for name in ("irradiance", "error"):
            values = getattr(self, name)
            if values.shape != (h, w, 3) or values.dtype != np.float32:
                value = f"{values.dtype} {values.shape}"
                raise InputError(folder, name, value, f"give float32 of shape {(h, w, 3)}")
            if not np.all(values >= 0) or not np.all(np.isfinite(values)):
                raise InputError(folder, name, "negative or not finite", "repair the light")
        ktx2.write(folder / NAME, _texture(self.padded()))
        error = np.concatenate([self.error, np.ones_like(self.error[..., :1])], axis=2)
        ktx2.write(folder / ERROR_NAME, _texture(error))
        buffer = io.BytesIO()
        np.savez_compressed(buffer, rectangles=self.faces.rectangles)
        atomic.write_bytes(folder / FACES_NAME, buffer.getvalue())
        layout = {
            "texels": self.faces.texels,
            "size": list(self.faces.size),
            "grid": list(self.faces.grid),
            "cell_size": self.faces.cell_size,
            "origin": list(self.faces.origin),
            "rectangles": len(self.faces.rectangles),
            "clamped": int(np.count_nonzero(self.irradiance > LARGEST)),
        }
        data = {"format": FORMAT, "kind": KIND, "layout": layout, "quality": self.quality}
        report.write(folder, data)

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Lightmap:
        """Read a folder that `save` wrote, verified where it is sealed; gutters come back filled.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data = report.read(folder)
        if data.get("kind") != KIND or data.get("format") != FORMAT:
            found = f"{data.get('kind')} of format {data.get('format')}"
            raise DamagedError(folder, "kind", found, AGAIN)
        faces = _faces(folder, data["layout"])
        irradiance, error = (_read(folder, name, faces) for name in (NAME, ERROR_NAME))
        return cls(irradiance, error, faces, data["quality"])


def _texture(values: Float) -> ktx2.Texture:
    return ktx2.Texture((np.minimum(values, LARGEST).astype(np.float16)[None],), "array")


def _read(folder: Path, name: str, faces: Faces) -> Float:
    path = Path(folder) / name
    level = ktx2.decode(_bytes(folder, name), str(path)).levels[0]
    w, h = faces.size
    if level.shape != (1, h, w, 4) or level.dtype != np.float16:
        raise DamagedError(path, "texture", f"{level.dtype} {level.shape}", AGAIN)
    return level[0, :, :, :3].astype(np.float32)


def _faces(folder: Path, layout: dict[str, Any]) -> Faces:
    path = Path(folder) / FACES_NAME
    with refusing(str(path), "list of rectangles"):
        stored = np.load(io.BytesIO(_bytes(folder, FACES_NAME)), allow_pickle=False)
        rectangles = np.asarray(stored["rectangles"])
    size, grid, origin = layout["size"], layout["grid"], layout["origin"]
    found = Faces(
        texels=layout["texels"],
        size=(size[0], size[1]),
        grid=(grid[0], grid[1], grid[2]),
        cell_size=layout["cell_size"],
        origin=(origin[0], origin[1], origin[2]),
        rectangles=rectangles,
    )
    wrong = _fault(found)
    if wrong:
        raise DamagedError(path, "rectangles", wrong, AGAIN)
    return found


def _fault(faces: Faces) -> str:
    """Tell what is wrong with rectangles that come from a file; nothing where all is well."""
    stored, n = faces.rectangles, faces.texels
    if stored.dtype != RECTANGLE or stored.ndim != 1 or not len(stored):
        return f"{stored.dtype} {stored.shape}"
    if min(faces.grid) < 1 or np.prod(faces.grid, dtype=np.float64) > MAX_CELLS:
        return f"a grid of {faces.grid}"
    # Sums of 32 bits would wrap round
    r = {name: stored[name].astype(np.int64) for name in RECTANGLE.names or ()}
    if r["axis"].min() < 0 or r["axis"].max() > 2 or np.any(np.abs(r["sign"]) != 1):
        return "axis or sign out of range"
    sides = np.array(faces.grid)
    depth = r["plane"] - (r["sign"] > 0)
    low = np.stack([depth, r["u"], r["v"]])
    high = np.stack([depth + 1, r["u"] + r["width"], r["v"] + r["height"]])
    ends = np.stack([sides[(r["axis"] + i) % 3] for i in range(3)])
    if np.any(low < 0) or np.any(high > ends) or min(r["width"].min(), r["height"].min()) < 1:
        return "outside of the grid"
    w, h = faces.size
    right, bottom = r["x"] + r["width"] * n, r["y"] + r["height"] * n
    if n < 1 or min(r["x"].min(), r["y"].min()) < 1 or right.max() >= w or bottom.max() >= h:
        return "outside of the atlas"
    return ""


def _bytes(folder: Path, name: str) -> bytes:
    if seal.is_sealed(folder):
        return seal.read_bytes(folder, name)
    return read_bytes(Path(folder) / name, MAX_BYTES)
