# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""Lights of a scene as its file describes them."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from formats.keyed import Keyed
from formats.schema import Where, item
from maths.transforms import vector_area

Array = NDArray[np.float64]

RGB = {"sizes": (3,), "low": 0.0, "high": 1e6}
PLACE = {"unit": "m", "sizes": (3,), "low": -1e6, "high": 1e6}
RADIANCE = "W/(m2 sr)"
CORNERS = 8
"""Most corners of a polygon."""
FLAT = 1e-3
"""Largest distance of a polygon's corner from its plane, of its size."""


@dataclass(frozen=True, kw_only=True)
class Sun:
    """Light from far away."""

    type: ClassVar[str] = "sun"
    to_light: Keyed = item(
        "keyed", "direction towards the sun, of any length but 0", sizes=(3,), low=-1e6, high=1e6
    )
    irradiance: Keyed = item("keyed", "on a surface that faces the sun", unit="W/m2", **RGB)
    angular_diameter: float = item(
        "number", "as seen from the ground", 0.53, unit="deg", low=0, high=90
    )

    def direction(self, t: float) -> Array:
        """Unit vector (3,) towards the sun at t seconds."""
        return _unit(self.to_light.at(t))


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A glowing ball."""

    type: ClassVar[str] = "sphere"
    position: Keyed = item("keyed", "centre", **PLACE)
    radius: float = item("number", "radius", unit="m", low=1e-4, high=1e4)
    radiance: Keyed = item("keyed", "of its surface", unit=RADIANCE, **RGB)


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A glowing flat disc."""

    type: ClassVar[str] = "disc"
    position: Keyed = item("keyed", "centre", **PLACE)
    facing: Keyed = item(
        "keyed", "direction of its front, of any length but 0", sizes=(3,), low=-1e6, high=1e6
    )
    radius: float = item("number", "radius", unit="m", low=1e-4, high=1e4)
    radiance: Keyed = item("keyed", "of its surface", unit=RADIANCE, **RGB)
    two_sided: bool = item("flag", "the back glows too", False)

    def axis(self, t: float) -> Array:
        """Unit vector (3,) that its front faces at t seconds."""
        return _unit(self.facing.at(t))


@dataclass(frozen=True, kw_only=True)
class Rectangle:
    """A glowing rectangle, level unless it faces straight up or down."""

    type: ClassVar[str] = "rectangle"
    position: Keyed = item("keyed", "centre", **PLACE)
    facing: Keyed = item(
        "keyed", "direction of its front, of any length but 0", sizes=(3,), low=-1e6, high=1e6
    )
    size: tuple[float, float] = item(
        "vector", "width and height", unit="m", sizes=(2,), low=1e-4, high=1e4
    )
    radiance: Keyed = item("keyed", "of its surface", unit=RADIANCE, **RGB)
    two_sided: bool = item("flag", "the back glows too", False)

    def axis(self, t: float) -> Array:
        """Unit vector (3,) that its front faces at t seconds."""
        return _unit(self.facing.at(t))

    def corners(self, t: float) -> Array:
        """Corners (4, 3) at t seconds, counter-clockwise as seen from its front."""
        right, up = level_frame(self.axis(t))
        right, up = right * self.size[0] / 2, up * self.size[1] / 2
        centre = np.asarray(self.position.at(t))
        return np.stack(
            [centre + x * right + y * up for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Polygon:
    """A glowing flat, convex polygon."""

    type: ClassVar[str] = "polygon"
    outline: Array = item(
        "numbers",
        f"3 to {CORNERS} corners, counter-clockwise as seen from its front",
        unit="m",
        sizes=(3,),
        low=-1e6,
        high=1e6,
    )
    offset: Keyed = item("keyed", "moves all corners", [0.0, 0.0, 0.0], **PLACE)
    radiance: Keyed = item("keyed", "of its surface", unit=RADIANCE, **RGB)
    two_sided: bool = item("flag", "the back glows too", False)

    def axis(self, t: float) -> Array:
        """Unit vector (3,) that its front faces."""
        del t  # corners move together
        return _unit(vector_area(self.outline))

    def corners(self, t: float) -> Array:
        """Corners (k, 3) at t seconds, counter-clockwise as seen from its front."""
        return np.asarray(self.outline + np.asarray(self.offset.at(t)))


@dataclass(frozen=True, kw_only=True)
class EnvironmentLight:
    """Light from all around, from a lat-long picture."""

    type: ClassVar[str] = "environment"
    source: Path = item("source", "lat-long picture", choices=(".exr", ".hdr"))
    scale: Keyed = item("keyed", "factor on its radiance", 1.0, sizes=(1, 3), low=0, high=1e6)
    rotate: float = item(
        "number", "turn about +y, counter-clockwise from above", 0.0, unit="deg", low=-360, high=360
    )

    def factor(self, t: float) -> Array:
        """Factor (3,) on the radiance at t seconds."""
        return np.broadcast_to(np.asarray(self.scale.at(t), dtype=np.float64), (3,)).copy()


Light = Sun | Sphere | Disc | Rectangle | Polygon | EnvironmentLight
LIGHTS = {light.type: light for light in (Sun, Sphere, Disc, Rectangle, Polygon, EnvironmentLight)}


def check(light: Light, where: Where) -> None:
    """Refuse what only several fields of a light together show to be wrong."""
    directions = {Sun: "to_light", Disc: "facing", Rectangle: "facing"}
    name = directions.get(type(light))
    if name is not None and getattr(light, name).shortest < 1e-6:
        values = getattr(light, name).values.tolist()
        where.at(name).refuse(values, "keep the direction away from 0 at all times")
    if isinstance(light, Polygon):
        _check_outline(light.outline, where.at("outline"))


def level_frame(axis: Array) -> tuple[Array, Array]:
    """Right and up (3,) of something that faces `axis`, as seen from in front; right is level.

    What faces straight up or down has +x to its right.
    """
    right = np.cross([0.0, 1.0, 0.0], axis)
    length = np.linalg.norm(right)
    right = np.array([1.0, 0.0, 0.0]) if length < 1e-9 else right / length
    return right, np.cross(axis, right)


def _check_outline(outline: Array, where: Where) -> None:
    if not 3 <= len(outline) <= CORNERS:
        where.refuse(f"{len(outline)} corners", f"write 3 to {CORNERS}")
    area = vector_area(outline)
    size = float(np.ptp(outline, axis=0).max())
    if np.linalg.norm(area) <= 1e-9 * size * size:
        where.refuse(outline.tolist(), "write corners that do not lie on one line")
    axis = _unit(area)
    off = np.abs((outline - outline.mean(axis=0)) @ axis).max()
    if off > FLAT * size:
        where.refuse(f"{off:.3g} m out of its plane", "write corners in one plane")
    edges = np.roll(outline, -1, axis=0) - outline
    following = np.roll(edges, -1, axis=0)
    turns = np.cross(edges, following) @ axis
    if turns.min() < -1e-9 * size * size:
        where.refuse("a corner that points inwards", "write a convex outline, or split it in two")
    # A star turns left everywhere too, but more than once round
    if np.arctan2(turns, np.sum(edges * following, axis=1)).sum() > 3 * np.pi:
        where.refuse("an outline that goes round twice", "write a convex outline, once round")


def _unit(vector: Array) -> Array:
    found = np.asarray(vector, np.float64)
    return np.asarray(found / np.linalg.norm(found))
