# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""Meshes that stand in a scene as they are: opaque surfaces under the scene's lights."""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from formats import schema
from formats.keyed import Keyed
from formats.schema import Where, item
from formats.sprites import MESHES
from maths import transforms

Array = NDArray[np.float64]
MAX_VALUES = 1 << 27
"""Most voxels times harmonics of a volume."""
KINDS = {"direct": "mesh", "transfer": "transfer"}
"""Asset that each lighting of a mesh needs."""
EFFECTS = {"direct": "surface", "transfer": "transfer"}
"""Effect that draws it."""
LEAST_EDGE = 1e-4
"""Of a mesh's longest side: shorter edges would make too many faces of any mesh."""


@dataclass(frozen=True, kw_only=True)
class Shadow:
    """The soft shadow that a mesh casts on what is opaque: a volume of what it hides."""

    grid: int = item("integer", "voxels a side of the volume", 32, low=2, high=128)
    l_max: int = item(
        "integer",
        "highest band of spherical harmonics; bands: 7 for 512 KiB, 5 for 128",
        None,
        low=0,
        high=8,
        by_quality=(4, 4, 5, 8),
    )
    components: int = item(
        "integer",
        "numbers a voxel of talk, four a texture",
        None,
        low=1,
        high=48,
        by_quality=(16, 16, 32, 48),
    )
    encoding: Literal["talk", "bands"] = item(
        "text",
        "talk: the main components of each voxel; bands: every harmonic, on two coarser grids",
        "talk",
        choices=("talk", "bands"),
    )
    size: int = item("integer", "of bands, at most", 512, unit="KiB", low=1, high=65536)
    rays: int = item(
        "integer",
        "rays of a voxel beside the mesh, at least one a harmonic; far ones get fewer",
        None,
        low=16,
        high=65536,
        by_quality=(128, 256, 512, 1024),
    )
    coloured: bool = item("flag", "each channel by its own light; false: by luminance", True)
    falloff: bool = item("flag", "thins beyond the volume; false: as at its edge", True)
    self: bool = item("flag", "it falls on the mesh itself too", False)
    receiver_normal: bool = item(
        "flag",
        "light counts by its angle to the surface that it falls on; false: alike from all around",
        False,
    )

    @property
    def harmonics(self) -> int:
        """Number K of spherical harmonics."""
        return (self.l_max + 1) ** 2

    @property
    def bytes(self) -> int:
        """Bytes of the volume's textures, at most."""
        if self.encoding == "bands":
            return 1024 * self.size
        return self.grid**3 * 4 * -(-self.components // 4)


@dataclass(frozen=True, kw_only=True)
class TransferKnobs:
    """What each vertex makes of light from every direction, where `lighting` is transfer."""

    l_max: int = item(
        "integer",
        "highest band of spherical harmonics",
        None,
        low=0,
        high=8,
        by_quality=(4, 6, 6, 8),
    )
    rays: int = item(
        "integer", "rays of a vertex", None, low=2, high=65536, by_quality=(64, 256, 512, 1024)
    )
    bounces: int = item("integer", "of light from the mesh to itself", 2, low=0, high=64)
    edge: float = item(
        "number",
        "longest edge, as a share of the mesh's longest side; longer ones are halved, 0: none is",
        0.03125,
        low=0,
        high=1,
    )
    components: int = item(
        "integer",
        "numbers a vertex, in fours",
        None,
        low=1,
        high=32,
        by_quality=(24, 24, 32, 32),
    )


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
    lighting: Literal["direct", "transfer"] = item(
        "text",
        "direct: every light in closed form, without shadows; transfer: shadowed by itself and lit "
        "by light from itself, softly, by any number of lights",
        "direct",
        choices=("direct", "transfer"),
    )
    transfer: TransferKnobs = item("table", "of lighting by transfer", {}, table=TransferKnobs)
    shadow: Shadow | None = item("table", "calls for its soft shadow", None, table=Shadow)
    silhouette_width: float = item(
        "number",
        "farthest that fins stand out which make a coarse outline round; 0: none do",
        0.0,
        unit="m",
        low=0,
        high=1e6,
    )
    silhouette_softness: float = item(
        "number", "way on which fins fade beyond that, in widths; 0: crisp", 0.0, low=0, high=8
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


def shown(scene: Any) -> tuple[PlacedMesh, ...]:
    """The meshes of a scene that [force] leaves in the picture."""
    found: tuple[PlacedMesh, ...] = scene.meshes
    return tuple(m for m in found if scene.force.get(EFFECTS[m.lighting]) is not False)


def complete(mesh: PlacedMesh, quality: int) -> PlacedMesh:
    """Fill what shadow and transfer leave open with the numbers of the quality."""
    transfer = schema.completed(mesh.transfer, quality)
    shadow = None if mesh.shadow is None else _complete(mesh.shadow, quality)
    return dataclasses.replace(mesh, transfer=transfer, shadow=shadow)


def _complete(shadow: Shadow, quality: int) -> Shadow:
    """Fill what a shadow leaves open: bands that its rays and its grid have room for."""
    full = schema.completed(shadow, quality)
    if shadow.l_max is None:
        room = min(full.rays, MAX_VALUES // full.grid**3)
        full = dataclasses.replace(full, l_max=max(0, min(full.l_max, math.isqrt(room) - 1)))
    return full


def check(mesh: PlacedMesh, where: Where) -> None:
    """Refuse what only several fields of a mesh together show to be wrong."""
    if 0 < mesh.transfer.edge < LEAST_EDGE:
        place = where.at("transfer").at("edge")
        place.refuse(mesh.transfer.edge, f"write 0, or at least {LEAST_EDGE:g}")
    shadow = mesh.shadow
    if shadow is None:
        return
    place = where.at("shadow")
    if shadow.rays is not None and shadow.rays < shadow.harmonics:
        place.at("rays").refuse(shadow.rays, f"write at least {shadow.harmonics}, one a harmonic")
    if shadow.grid**3 * shadow.harmonics > MAX_VALUES:
        remedy = f"voxels times harmonics are at most {MAX_VALUES:,}: lower grid or l_max"
        place.at("grid").refuse(shadow.grid, remedy)
