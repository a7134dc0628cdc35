"""A relit sprite as the player reads it; its float master is in formats/coefficients.py."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report, seal
from formats.errors import DamagedError
from formats.files import ktx2

FORMAT = 1


@dataclass(frozen=True)
class Ring:
    """The circle of light directions on which a sprite was lit.

    axis : "view" (+z of the sprite) or "up" (+y). elevation : radians above the ring's plane.
    terms : odd K = 2 H + 1. one_sided : lights behind the sprite's plane give nothing.
    lights : directions that were rendered.
    """

    axis: str = "view"
    elevation: float = np.pi / 6
    terms: int = 5
    one_sided: bool = True
    lights: int = 64


@dataclass(frozen=True)
class Billboard:
    """A sprite as the graphics card reads it (`planes.ktx2`).

    levels : mip levels, each (V * P, h, w, 4) uint8 or float16, layer = view * P + plane; see
    maths.sprite_packing for the codes. scales : (P, 4). packing : "twelve" or "full"; unpack :
    "chroma" or "talk". max_lod : the coarsest level that the lens may ask for. lens_scale : the c
    of LOD = log2(c * circle of confusion in texels). pivot, metres_per_texel : of level 0.
    """

    levels: tuple[NDArray[Any], ...]
    scales: NDArray[np.float32]
    packing: str
    unpack: str
    ring: Ring
    views: int
    metres_per_texel: float
    pivot: tuple[float, float]
    height: float
    max_lod: float
    lens_scale: float
    quality: dict[str, Any] = field(default_factory=dict)

    @property
    def planes(self) -> int:
        """Number of RGBA planes a view."""
        return len(self.scales)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of level 0 in texels, borders included."""
        return self.levels[0].shape[2], self.levels[0].shape[1]

    def save(self, folder: Path) -> None:
        """Write `planes.ktx2` and `report.json` into an empty folder."""
        ktx2.write(folder / "planes.ktx2", ktx2.Texture(self.levels, "array", {}))
        layout = {
            "scales": [[float(s) for s in plane] for plane in self.scales],
            "packing": self.packing,
            "unpack": self.unpack,
            "ring": asdict(self.ring),
            "views": self.views,
            "metres_per_texel": self.metres_per_texel,
            "pivot": list(self.pivot),
            "height": self.height,
            "max_lod": self.max_lod,
            "lens_scale": self.lens_scale,
        }
        report.write(folder, description("billboard", layout, self.quality))

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Billboard:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data = read_layout(folder, "billboard")
        layout, path = dict(data["layout"]), folder / "planes.ktx2"
        sealed = seal.is_sealed(folder)
        texture = (
            ktx2.decode(seal.read_bytes(folder, path.name), str(path))
            if sealed
            else ktx2.read(path)
        )
        layout["scales"] = np.asarray(layout["scales"], np.float32)
        layout["ring"] = Ring(**layout["ring"])
        layout["pivot"] = (layout["pivot"][0], layout["pivot"][1])
        return cls(levels=texture.levels, quality=data["quality"], **layout)


def description(kind: str, layout: dict[str, Any], quality: dict[str, Any]) -> dict[str, Any]:
    """Return what report.json says of a sprite: what a reader needs, and how good it is."""
    return {"format": FORMAT, "kind": kind, "layout": layout, "quality": quality}


def read_layout(folder: Path, kind: str) -> dict[str, Any]:
    """Read report.json; DamagedError where it is of another kind or format."""
    data = report.read(folder)
    if data.get("kind") != kind or data.get("format") != FORMAT:
        found = f"{data.get('kind')} format {data.get('format')}"
        raise DamagedError(
            folder, "kind", found, f"expected a {kind} of format {FORMAT}; bake it again"
        )
    return data
