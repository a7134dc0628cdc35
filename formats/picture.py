"""A drawn or painted sprite as the player reads it: its own light, no other."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report, seal
from formats.errors import DamagedError
from formats.files import ktx2

FORMAT = 1
KIND = "picture"
NAME = "planes.ktx2"
AGAIN = "bake it again"


@dataclass(frozen=True)
class Picture:
    """Mip levels of a picture (`planes.ktx2`), (1, h, w, 4) float16 each.

    Premultiplied and linear, borders of zero around: 8 bits of linear light would step by 13 codes
    of the display next to black, and levels of codes as the display has them would not be means of
    light. On llvmpipe half floats cost no more to read. pivot : (x, y) texels from the top left to
    the middle of the lower edge; metres_per_texel : of level 0; height : metres of the picture.
    max_lod : the coarsest level that the lens may ask for. lens_scale : the c of LOD = log2(c *
    circle of confusion in texels). brightest : no colour of a texel is more.
    """

    levels: tuple[NDArray[np.float16], ...]
    metres_per_texel: float
    pivot: tuple[float, float]
    height: float
    max_lod: float
    lens_scale: float
    brightest: float = 1.0
    quality: dict[str, Any] = field(default_factory=dict)
    planes = 1
    views = 1

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of level 0 in texels, borders included."""
        return self.levels[0].shape[2], self.levels[0].shape[1]

    @property
    def scales(self) -> NDArray[np.float32]:
        """(1, 4), what a texel's numbers count: ones."""
        return np.ones((1, 4), np.float32)

    def save(self, folder: Path) -> None:
        """Write `planes.ktx2` and `report.json` into an empty folder."""
        ktx2.write(folder / NAME, ktx2.Texture(self.levels, "array", {}))
        layout = {
            "pivot": list(self.pivot),
            "metres_per_texel": self.metres_per_texel,
            "height": self.height,
            "max_lod": self.max_lod,
            "lens_scale": self.lens_scale,
            "brightest": self.brightest,
        }
        data = {"format": FORMAT, "kind": KIND, "layout": layout, "quality": self.quality}
        report.write(folder, data)

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Picture:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data, path = report.read(folder), Path(folder) / NAME
        if data.get("kind") != KIND or data.get("format") != FORMAT:
            found = f"{data.get('kind')} of format {data.get('format')}"
            raise DamagedError(folder, "kind", found, f"expected a {KIND}: {AGAIN}")
        sealed = seal.is_sealed(folder)
        texture = ktx2.decode(seal.read_bytes(folder, NAME), str(path)) if sealed else None
        levels = (texture or ktx2.read(path)).levels
        if levels[0].dtype != np.float16 or levels[0].shape[0] != 1:
            raise DamagedError(path, "texture", str(levels[0].shape), AGAIN)
        try:
            layout = dict(data["layout"])
            pivot = (float(layout.pop("pivot")[0]), float(data["layout"]["pivot"][1]))
            numbers = {name: float(value) for name, value in layout.items()}
            return cls(levels=levels, pivot=pivot, quality=dict(data["quality"]), **numbers)
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise DamagedError(folder, "layout", str(error), AGAIN) from error
