# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""A scene's world of cubes: where its cells come from, what of it moves, and what glows."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from formats.keyed import Keyed
from formats.lights import RGB
from formats.schema import Where, is_colour, item
from formats.sprites import MESHES

VOXELS = (".vox", ".xraw")
"""File name endings of worlds of cells."""
MOST_LAMPS = 16
MODES = ("exact", "sphere", "march", "talk")
Vector = tuple[float, float, float]
SLACK = 1e-6  # frames: times are sums of rounded numbers


@dataclass(frozen=True, kw_only=True)
class VoxelLamp:
    """A glowing cube that moves freely, not from cell to cell."""

    position: Keyed = item(
        "keyed",
        "of its middle, snapped to cells where light is baked",
        unit="m",
        sizes=(3,),
        low=-1e6,
        high=1e6,
    )
    radiance: Keyed = item("keyed", "that every side sends out", unit="W/(m2 sr)", **RGB)
    side: int = item("integer", "cells along a side", 1, low=1, high=8)


@dataclass(frozen=True, kw_only=True)
class VoxelBody:
    """A part of the world that moves, from cell to cell."""

    name: str = item("text", "of the part; letters, digits, - and _")
    source: Path = item("source", "its cells", choices=VOXELS)
    position: Keyed = item(
        "keyed",
        "of the middle of its underside, snapped to cells and frames",
        unit="m",
        sizes=(3,),
        low=-1e6,
        high=1e6,
    )


@dataclass(frozen=True, kw_only=True)
class VoxelWorld:
    """A world of cubes, lit by what glows in it, by the environment, and by light from cell to
    cell."""

    source: Path = item("source", "cells, or a mesh to make cells of", choices=(*VOXELS, *MESHES))
    cell_size: float = item("number", "side of a cell", 0.25, unit="m", low=1e-3, high=1e3)
    grid: int = item("integer", "cells along the longest side of a mesh", 64, low=4, high=512)
    position: tuple[float, float, float] = item(
        "vector",
        "of the middle of its underside",
        [0.0, 0.0, 0.0],
        unit="m",
        sizes=(3,),
        low=-1e6,
        high=1e6,
    )
    texels: int = item("integer", "of the lightmap along the side of a cell", 2, low=1, high=8)
    bounces: int = item("integer", "of light from cell to cell", 3, low=0, high=64)
    mode: Literal["exact", "sphere", "march", "talk"] = item(
        "text",
        "how rays are followed where something moves: exact, from cell to cell; sphere, the same "
        "by way of a field of distances; march, by fixed steps, which may miss thin walls; talk, "
        "as in the talk",
        "exact",
        choices=MODES,
    )
    error: float = item(
        "number",
        "at which light has settled, RMS, as a share",
        None,
        low=1e-3,
        high=1.0,
        by_quality=(0.05, 0.02, 0.01, 0.004),
    )
    passes: int = item("integer", "rays a texel and frame while light changes", 8, low=1, high=1024)
    emissive: dict[str, tuple[float, float, float]] = item(
        "radiances",
        "what glows: a palette index as editors show it, 1 to 255, a colour as #rrggbb, or a "
        "mesh's material, and its radiance",
        {},
        unit="W/(m2 sr)",
        low=0,
        high=1e6,
    )
    lamps: tuple[VoxelLamp, ...] = item(
        "tables", "glowing cubes that move", [], tables={"": VoxelLamp}
    )
    bodies: tuple[VoxelBody, ...] = item("tables", "parts that move", [], tables={"": VoxelBody})

    def positions(self, time: float) -> tuple[Vector, ...]:
        """Of each part, metres, at `time` seconds."""
        return tuple(_three(body.position.at(time)) for body in self.bodies)

    @property
    def reaches(self) -> tuple[tuple[Vector, Vector, int], ...]:
        """Lowest and highest place of each lamp's middle, metres, and its cells along a side."""
        return tuple(
            (_three(lamp.position.extremes[0]), _three(lamp.position.extremes[1]), lamp.side)
            for lamp in self.lamps
        )

    @property
    def moving(self) -> bool:
        """Whether its cells or what they send out ever change."""
        keyed = [value for lamp in self.lamps for value in (lamp.position, lamp.radiance)]
        keyed += [body.position for body in self.bodies]
        return not all(value.constant for value in keyed)


def _three(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def last_frame(duration: float, frame_rate: float) -> int:
    """Number of the last frame of an animation of `duration` seconds; the first is 0."""
    return int(duration * frame_rate + SLACK)


def frame_of(time: float, duration: float, frame_rate: float) -> float:
    """Time of the frame that shows at `time` seconds: parts stand where they do then.

    >>> frame_of(0.99, 4.0, 4.0), frame_of(9.0, 4.0, 4.0), frame_of(-1.0, 4.0, 4.0)
    (0.75, 4.0, 0.0)
    """
    last = last_frame(duration, frame_rate)
    return min(max(int(time * frame_rate + SLACK), 0), last) / frame_rate


def check(world: VoxelWorld, where: Where) -> None:
    """Refuse what only several fields together show to be wrong."""
    if world.source.suffix.lower() in VOXELS:
        for key in world.emissive:
            if not is_colour(key):
                place = where.at("emissive").at(key)
                place.refuse("unknown key", "name an index from 1 to 255, or #rrggbb")
    if len(world.lamps) > MOST_LAMPS:
        remedy = (
            f"every ray looks at each: use at most {MOST_LAMPS}, and let cells glow for the rest"
        )
        where.at("lamps").refuse(f"{len(world.lamps)} lamps", remedy)
    names = [body.name for body in world.bodies]
    for i, body in enumerate(world.bodies):
        place = where.at("bodies").item(i).at("name")
        if body.name == "world":
            place.refuse(body.name, "give it another name: this one is the whole world's")
        if body.name in names[:i]:
            place.refuse(body.name, "give each part another name")
