# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""Meshes that stand in a scene as they are: opaque surfaces under the scene's lights."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from formats.keyed import Keyed
from formats.schema import item
from formats.sprites import MESHES
from maths import transforms

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PlacedMesh:
    """A mesh as it is, opaque, at a place that may move."""

    name: str = item("text", "of the mesh; letters, digits, - and _")
    source: Path = item("source", "mesh", choices=MESHES)
    position: Keyed = item(
        "keyed",
        "of the mesh's own origin",
        [0.0, 0.0, 0.0],
        unit="m",
        sizes=(3,),
        low=-1e6,
        high=1e6,
    )
    rotation: Keyed = item(
        "keyed",
        "about x, then y, then z",
        [0.0, 0.0, 0.0],
        unit="deg",
        sizes=(3,),
        low=-1e6,
        high=1e6,
    )
    scale: float = item("number", "factor on the mesh's size", 1.0, low=1e-6, high=1e6)
    lighting: Literal["direct"] = item(
        "text", "direct: every light in closed form, without shadows", "direct", choices=("direct",)
    )

    def world_from_mesh(self, t: float) -> Array:
        """Matrix (4, 4) at t seconds: scale, then turns, then position."""
        matrix = np.eye(4)
        matrix[:3, :3] = transforms.euler(np.radians(self.rotation.at(t))) * self.scale
        matrix[:3, 3] = self.position.at(t)
        return matrix

    @property
    def still(self) -> bool:
        """Whether it never moves."""
        return self.position.constant and self.rotation.constant
