# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""Sets of sprites in a scene: what is baked, under which lights, and where the sprites stand."""

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from formats import photograph_files, picture_files, schema
from formats.instances import Instances, Scatter, placed
from formats.schema import Where, item

QUALITIES = ("draft", "balanced", "fine", "reference")
MESHES = (".obj", ".ply", ".stl", ".glb")
SOURCES = (*MESHES, photograph_files.SUFFIX, *picture_files.SUFFIXES)
TERMS = 5
"""Of a ring where nothing has room for more: the talk's."""


@dataclass(frozen=True, kw_only=True)
class Ring:
    """The circle of lights under which a sprite is baked."""

    axis: Literal["view", "up"] = item(
        "text", "axis of the ring: view = +z of the sprite, up = +y", "view", choices=("view", "up")
    )
    elevation: float = item(
        "number", "of the lights above the plane of the ring", 30.0, unit="deg", low=-85, high=85
    )
    terms: int = item(
        "integer",
        "circular harmonics, odd; photographs: 5",
        None,
        low=1,
        high=31,
        by_quality=(5, 5, 9, 13),
    )
    lights: int = item(
        "integer",
        "lights on the ring, at least 3 a term",
        None,
        low=3,
        high=4096,
        by_quality=(24, 32, 48, 64),
    )
    tolerance: float = item(
        "number",
        "how far from the elevation photographs still count as on the ring",
        10.0,
        unit="deg",
        low=0.1,
        high=90,
    )


@dataclass(frozen=True, kw_only=True)
class Dome:
    """The hemisphere of lights under which a sprite is baked: harmonics, then a few numbers."""

    bands: int = item(
        "integer", "of hemispherical harmonics; 0 chooses by held-out error", 0, low=0, high=8
    )
    penalty: float = item(
        "number", "smoothness of the fit; 0 chooses by held-out error", 0.0, low=0, high=100
    )
    channels: int = item(
        "integer",
        "numbers a pixel, one of them coverage",
        None,
        low=2,
        high=64,
        by_quality=(8, 16, 24, 32),
    )
    lights: int = item(
        "integer",
        "lights of a mesh; photographs have their own",
        None,
        low=6,
        high=1024,
        by_quality=(32, 64, 96, 128),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Billboards:
    """One mesh or photographed thing, relit, or a picture as it is, and where its sprites stand."""

    name: str = item("text", "of the set; letters, digits, - and _")
    source: Path = item(
        "source", "mesh, light positions of photographs, or a picture", choices=SOURCES
    )
    height: float = item("number", "of the object or picture", unit="m", low=1e-3, high=1e4)
    radiance: tuple[float, float, float] = item(
        "vector",
        "of a picture's white",
        [1.0, 1.0, 1.0],
        unit="W/(m2 sr)",
        sizes=(3,),
        low=0,
        high=1e6,
    )
    opacity: float = item(
        "number", "of a picture, a factor on its alpha; 0 only adds light", 1.0, low=0, high=1
    )
    facing: Literal["upright", "camera"] = item(
        "text",
        'a picture stands on its lower edge, or "camera": floats about its middle, facing it',
        "upright",
        choices=("upright", "camera"),
    )
    ring: Ring | None = item(
        "table", "a circle of lights; what a mesh gets without either", None, table=Ring
    )
    dome: Dome | None = item(
        "table", "a hemisphere of lights; what photographs get without either", None, table=Dome
    )
    packing: Literal["chroma", "talk", "full"] = item(
        "text", "how terms share textures", "chroma", choices=("chroma", "talk", "full")
    )
    views: int = item("integer", "sides from which it is baked, evenly about +y", 1, low=1, high=16)
    resolution: int = item(
        "integer",
        "texels of the longer side of the object; a picture is only shrunk to it, if it is written",
        None,
        low=8,
        high=4096,
        by_quality=(128, 256, 512, 1024),
    )
    samples: int = item("integer", "rays a texel", None, low=1, high=4096, by_quality=(4, 8, 8, 36))
    transmission: float = item(
        "number", "share of light that passes through double-sided faces", 0.35, low=0, high=1
    )
    gloss: float = item("number", "strength of the gloss of its materials", 0.0, low=0, high=1)
    sky_fill: float = item(
        "number", "light of an even sky, a share of the sun's", 0.0, low=0, high=10
    )
    sun_diameter: float = item(
        "number", "angular, of each light of the ring", 0.53, unit="deg", low=0, high=90
    )
    positions: NDArray[np.float64] | None = item(
        "numbers",
        "ground points; either these or scatter",
        None,
        unit="m",
        sizes=(3,),
        low=-1e6,
        high=1e6,
    )
    scale: NDArray[np.float64] | None = item(
        "numbers", "factor on the height, one a position", None, low=1e-3, high=1e3
    )
    yaw: NDArray[np.float64] | None = item(
        "numbers", "turn about +y, one a position", None, unit="deg", low=-360, high=360
    )
    roll: NDArray[np.float64] | None = item(
        "numbers",
        "turn of a picture in its own plane, counter-clockwise, one a position",
        None,
        unit="deg",
        low=-360,
        high=360,
    )
    flip: NDArray[np.bool_] | None = item("flags", "mirrored, one a position", None)
    tint: NDArray[np.float64] | None = item(
        "numbers", "factor on the colour, one a position", None, sizes=(3,), low=0, high=10
    )
    scatter: Scatter | None = item("table", "places by chance", None, table=Scatter)
    softness: float = item(
        "number", "over which it fades before what is opaque", 0.0, unit="m", low=0, high=100
    )
    shadow: bool = item("flag", "a shadow on the ground where they stand; not of pictures", True)

    @property
    def photographed(self) -> bool:
        """Whether photographs are its source."""
        return photograph_files.is_photographed(self.source)

    @property
    def pictured(self) -> bool:
        """Whether a picture is its source, which is shown as it is, in no light but its own."""
        return picture_files.is_picture(self.source)

    @property
    def stands(self) -> bool:
        """Whether its sprites stand on their ground points, and not float about them."""
        return self.facing == "upright"

    def instances(self) -> Instances:
        """Every sprite of the set; the same for the same scene on every machine."""
        return self._instances

    @cached_property
    def _instances(self) -> Instances:
        if self.scatter is not None:
            return self.scatter.instances()
        return placed(self.positions, self.scale, self.yaw, self.flip, self.tint, self.roll)


def complete(billboards: Billboards, quality: int) -> Billboards:
    """Fill what the set leaves open with the numbers of the quality."""
    if billboards.pictured:
        # As many texels as it has, and no shadow: it is light, not a body
        return dataclasses.replace(billboards, resolution=billboards.resolution or 0, shadow=False)
    ring, dome = billboards.ring, billboards.dome
    if ring is None and dome is None:
        ring, dome = (None, Dome()) if billboards.photographed else (Ring(), None)
    ring = None if ring is None else _complete(ring, billboards, quality)
    dome = None if dome is None else schema.completed(dome, quality)
    return dataclasses.replace(schema.completed(billboards, quality), ring=ring, dome=dome)


def _complete(ring: Ring, billboards: Billboards, quality: int) -> Ring:
    """Fill what a ring leaves open: terms that its lights and its packing have room for."""
    full = schema.completed(ring, quality)
    if ring.terms is None:
        # Five where the photographs or the talk's own program settle it
        fixed = billboards.photographed or billboards.packing == "talk"
        room = max(TERMS, (full.lights // 3 - 1) // 2 * 2 + 1)
        full = dataclasses.replace(full, terms=TERMS if fixed else min(full.terms, room))
    if ring.lights is None:
        full = dataclasses.replace(full, lights=max(full.lights, 3 * full.terms))
    return full


# What a bake of a mesh is told and photographs have settled
OF_MESHES = ("resolution", "samples", "transmission", "gloss", "sky_fill", "sun_diameter", "views")
OF_LIT = ("ring", "dome", "packing", *OF_MESHES[1:])
OF_PICTURES = ("radiance", "opacity", "facing", "roll")


def check_source(billboards: Billboards, where: Where) -> None:
    """Refuse fields that do not suit the source, before `complete` fills what is left open.

    Photographs are looked up where there is a root, and become sources of the scene too.
    """
    if billboards.pictured:
        _refuse(billboards, OF_LIT, "a picture is shown as it is, in no light but its own", where)
        if where.root is not None:
            picture_files.baked_size(billboards.source, billboards.resolution or 0)
        return
    _refuse(billboards, OF_PICTURES, "only a picture (.png, .exr) has it", where)
    scatter = billboards.scatter
    if scatter is not None and scatter.roll != (0.0, 0.0):
        place = where.at("scatter").at("roll")
        place.refuse(list(scatter.roll), "remove this line: only a picture (.png, .exr) has it")
    ring = billboards.ring
    if ring is not None and billboards.dome is not None:
        where.at("dome").refuse("both ring and dome", "write one of them: how the set is lit")
    is_dome = billboards.dome is not None or (billboards.photographed and ring is None)
    if is_dome and billboards.packing != "chroma":
        where.at("packing").refuse(billboards.packing, "remove this line: a dome has its own")
    if not billboards.photographed:
        if ring is not None and ring.tolerance != schema.specs(Ring)["tolerance"].default:
            remedy = "remove this line: the lights of a mesh stand on the ring"
            where.at("ring").at("tolerance").refuse(ring.tolerance, remedy)
        return
    _refuse(billboards, OF_MESHES, "photographs are as they were taken", where)
    if billboards.dome is not None and billboards.dome.lights is not None:
        remedy = "remove this line: photographs have their own lights"
        where.at("dome").at("lights").refuse(billboards.dome.lights, remedy)
    if ring is not None:
        _check_photographed(ring, where.at("ring"))
    if where.root is not None:
        for file in photograph_files.require_inside(billboards.source, where.root)[1:]:
            where.sources[file.resolve().relative_to(where.root.resolve()).as_posix()] = file


def _refuse(billboards: Billboards, keys: tuple[str, ...], why: str, where: Where) -> None:
    """Refuse the first of the fields that is not as where it is absent."""
    for key in keys:
        given = getattr(billboards, key)
        default = schema.specs(Billboards)[key].default
        if given is not default and not np.array_equal(given, default):
            shown = "a table" if dataclasses.is_dataclass(given) else given
            shown = shown.tolist() if isinstance(shown, np.ndarray) else shown
            where.at(key).refuse(shown, f"remove this line: {why}")


def _check_photographed(ring: Ring, where: Where) -> None:
    if ring.axis != "view":
        where.at("axis").refuse(ring.axis, 'write "view": lights of photographs stand about it')
    if ring.elevation < 0:
        where.at("elevation").refuse(ring.elevation, "write 0 or more: towards the camera")
    if ring.lights is not None:
        where.at("lights").refuse(ring.lights, "remove this line: photographs have their own")


def _check_ring(billboards: Billboards, ring: Ring, where: Where) -> None:
    place = where.at("ring")
    if ring.terms % 2 == 0:
        place.at("terms").refuse(ring.terms, "write an odd number: 1 and a sine and a cosine each")
    if ring.lights < 3 * ring.terms:
        place.at("lights").refuse(ring.lights, f"write at least {3 * ring.terms}, 3 a term")
    if billboards.packing != "full" and ring.terms < 5:
        where.at("packing").refuse(billboards.packing, 'write "full", or at least 5 terms')
    if billboards.packing == "talk" and ring.terms != 5:
        where.at("packing").refuse("talk", "write 5 terms: that program has exactly five")


def check(billboards: Billboards, where: Where, *, used: bool = False) -> None:
    """Refuse what only several fields of a set together show to be wrong.

    used : by particles; it may then have no places of its own.
    """
    if billboards.ring is not None:
        _check_ring(billboards, billboards.ring, where)
    placed_once = (billboards.positions is None) != (billboards.scatter is None)
    nowhere = billboards.positions is None and billboards.scatter is None
    if not placed_once and not (used and nowhere):
        given = "neither" if billboards.positions is None else "both"
        where.at("positions").refuse(given, "write either positions or scatter")
    n = 0 if billboards.positions is None else len(billboards.positions)
    for key in ("scale", "yaw", "roll", "flip", "tint"):
        each = getattr(billboards, key)
        if each is not None and len(each) != n:
            where.at(key).refuse(f"{len(each)} items", f"write one a position, {n}")
    if billboards.scatter is not None:
        _check_scatter(billboards, billboards.scatter, where.at("scatter"))


def _check_scatter(billboards: Billboards, scatter: Scatter, where: Where) -> None:
    if scatter.box.shape != (2, 3) or np.any(scatter.box[0] > scatter.box[1]):
        remedy = "write two corners [[x0, y0, z0], [x1, y1, z1]], the lower first"
        where.at("box").refuse(scatter.box.tolist(), remedy)
    if scatter.height[0] > scatter.height[1]:
        where.at("height").refuse(list(scatter.height), "write the lesser factor first")
    if scatter.roll[0] > scatter.roll[1]:
        where.at("roll").refuse(list(scatter.roll), "write the lesser angle first")
    try:
        billboards.instances()
    except ValueError as error:
        where.at("clearing").refuse(str(error), "make it smaller, or the box larger")
