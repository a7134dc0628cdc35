"""Light as shaders take it: coefficients per sprite, suns and balls for the ground.

Sprites stand upright and share the camera's yaw, so a sun or an environment has one projection
for a whole set; spheres, discs and polygons are projected per sprite, from its centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.scene import Disc, EnvironmentLight, Polygon, Rectangle, Sphere, Sun
from maths import circular_harmonics, circular_lights, transforms

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SunState:
    """A sun at one moment: unit direction towards it, perpendicular irradiance, radius (rad).

    above : share of its disc over the ground's horizon, which the irradiance has lost already.
    """

    to_light: Array
    irradiance: Array
    radius: float
    above: float = 1.0


@dataclass(frozen=True, eq=False)
class SphereState:
    """A glowing ball at one moment."""

    position: Array
    radius: float
    radiance: Array


@dataclass(frozen=True, eq=False)
class DiscState:
    """A glowing flat disc at one moment; axis : unit, where its front faces."""

    position: Array
    axis: Array
    radius: float
    radiance: Array
    two_sided: bool


@dataclass(frozen=True, eq=False)
class PolygonState:
    """A glowing rectangle or polygon at one moment.

    corners : (k, 3), counter-clockwise as seen from its front.
    """

    corners: Array
    radiance: Array
    two_sided: bool


@dataclass(frozen=True, eq=False)
class EnvironmentState:
    """An environment at one moment: number among the lights, factor (3,), turn (rad)."""

    index: int
    factor: Array
    rotate: float


@dataclass(frozen=True, eq=False)
class Lights:
    """Every light of the scene at one moment."""

    suns: tuple[SunState, ...]
    spheres: tuple[SphereState, ...]
    environments: tuple[EnvironmentState, ...]
    discs: tuple[DiscState, ...] = ()
    polygons: tuple[PolygonState, ...] = ()


def at(scene: Any, time: float, turn: tuple[float, float] = (0.0, 0.0)) -> Lights:
    """Return the scene's lights at `time` seconds.

    turn : (azimuth, elevation) radians added to the first sun, for a viewer. Where there is a
    ground, a sun fades as its disc sets behind the horizon.
    """
    suns, spheres, environments, discs, polygons = [], [], [], [], []
    for index, light in enumerate(scene.lights):
        if isinstance(light, Sun):
            direction = light.direction(time)
            if not suns and any(turn):
                direction = turned(direction, *turn)
            radius = np.radians(light.angular_diameter) / 2
            up = above_horizon(direction, radius) if scene.ground else 1.0
            irradiance = np.asarray(light.irradiance.at(time)) * up
            suns.append(SunState(direction, irradiance, radius, up))
        elif isinstance(light, Sphere):
            spheres.append(
                SphereState(light.position.at(time), light.radius, light.radiance.at(time))
            )
        elif isinstance(light, Disc):
            where, axis = light.position.at(time), light.axis(time)
            emitted = light.radiance.at(time)
            discs.append(DiscState(where, axis, light.radius, emitted, light.two_sided))
        elif isinstance(light, Rectangle | Polygon):
            corners, emitted = light.corners(time), light.radiance.at(time)
            polygons.append(PolygonState(corners, emitted, light.two_sided))
        elif isinstance(light, EnvironmentLight):
            turn_of_map = np.radians(light.rotate)
            environments.append(EnvironmentState(index, light.factor(time), turn_of_map))
    return Lights(tuple(suns), tuple(spheres), tuple(environments), tuple(discs), tuple(polygons))


def turned(direction: Array, azimuth: float, elevation: float) -> Array:
    """Turn a unit direction about +y by `azimuth` and raise it by `elevation`, both radians."""
    x, y, z = direction
    height = np.clip(np.arcsin(np.clip(y, -1, 1)) + elevation, -np.pi / 2, np.pi / 2)
    around = np.arctan2(x, z) + azimuth
    level = np.cos(height)
    return np.array([level * np.sin(around), np.sin(height), level * np.cos(around)])


def above_horizon(direction: Array, radius: float) -> float:
    """Share of a disc's area above the horizon (a disc of radius 0 counts as the real sun's)."""
    radius = max(radius, np.radians(0.53) / 2)
    x = float(np.clip(np.arcsin(np.clip(direction[1], -1, 1)) / radius, -1, 1))
    return 0.5 + (x * np.sqrt(1 - x * x) + np.arcsin(x)) / np.pi


class RingSeries:
    """How sprites under a ring of lights count light: circular harmonics.

    rows : numbers of a light that the shader takes. length : terms K of a series. key : what makes
    two of the same kind equal. mirror : (K,) factors of a light mirrored along x. turns : whether
    a turn about +y only rotates a series.
    """

    def __init__(self, ring: Any) -> None:
        self.rows = self.length = ring.terms
        self._basis = {
            "axis": ring.axis,
            "elevation": ring.elevation,
            "one_sided": ring.one_sided,
        }
        self.key: tuple[Any, ...] = ("ring", ring.terms, *self._basis.values())
        self.mirror = mirror_signs(ring.terms)
        self.turns = ring.axis == "up"

    def sun(self, direction: Array, irradiance: Array) -> Array:
        """Series (K, 3) of a sun towards `direction`, sprite's frame."""
        return circular_harmonics.project_sun(direction, irradiance, self.length, **self._basis)

    def sphere(self, offsets: Array, radius: float, radiance: Array) -> Array:
        """Series (n, K, 3) of a ball whose centre is at `offsets` (n, 3) from the sprites."""
        return circular_harmonics.project_sphere(
            offsets, radius, radiance, self.length, **self._basis
        )

    def environment(self, radiance: Array, yaw: float) -> Array:
        """Series (K, 3) of a lat-long map seen by a sprite turned by `yaw`."""
        return circular_harmonics.project_environment(radiance, self.length, **self._basis, yaw=yaw)

    def directions(self, directions: Array) -> Array:
        """Series (..., K) of radiance 1 W/(m2 sr) a steradian from unit directions (..., 3).

        A one-sided ring fades in about z = 0, so that light of a whole map keeps its sum.
        """
        basis = {**self._basis, "one_sided": False}
        found = circular_lights.evaluate_direction(directions, self.length, **basis)
        if self._basis["one_sided"]:
            found *= np.clip(0.5 + directions[..., 2:] / circular_lights.GRAZING, 0.0, 1.0)
        return np.asarray(found)

    def constants(self, series: Array) -> Array:
        """Rows (..., rows, 3) for the shader of series (..., K, 3): the terms themselves."""
        return series


class SpriteLighting:
    """Projects lights for sets of sprites; keeps the projections that cost something."""

    def __init__(self) -> None:
        self._maps: dict[int, Array] = {}
        self._kept: dict[tuple[Any, ...], Array] = {}
        self._cubes: Any = None

    def surround(self, cubes: Any) -> None:
        """Let sprites stand in a world of cubes. cubes : runtime.sprite_probes.SpriteProbes."""
        self._cubes = cubes

    def take(self, environments: dict[int, NDArray[np.floating]]) -> None:
        """Take environment maps: number among the scene's lights -> lat-long radiance (h, w, 3)."""
        self._maps = {index: shrunk(radiance) for index, radiance in environments.items()}

    def project(
        self,
        lights: Lights,
        series: Any,
        yaw: float,
        centres: Array,
        flip: NDArray[np.bool_],
        shares: Sequence[Array | None] = (),
    ) -> tuple[Array, NDArray[np.int64]]:
        """Return (rows, index): row index[i] of `rows` (m, R, 3) lights the sprite i.

        series : RingSeries or DomeSeries, with R rows. yaw : of the camera, radians. centres : (n,
        3) of the sprites, metres. flip : (n,) mirrored sprites, whose light is mirrored along x
        just as their picture is. shares : for each sun, (n,) of it that reaches the sprites, None
        where all of it does. In a world of cubes, these hide lights, and send their own.
        """
        if self._cubes is not None and len(centres):
            rows = self._cubes.rows(lights, series, yaw, centres, shares)
            rows[flip] *= series.mirror[:, None]
            return series.constants(rows), np.arange(len(centres))
        shared = np.zeros((series.length, 3))
        sprite_from_world = transforms.rotation("y", -yaw)
        parts: list[tuple[Array, Array]] = []
        if lights.suns:
            towards = np.stack([sun.to_light for sun in lights.suns]) @ sprite_from_world.T
            each = series.sun(towards, np.stack([sun.irradiance for sun in lights.suns]))
            kept = [*shares, *[None] * (len(each) - len(shares))]
            shared += each[[share is None for share in kept]].sum(axis=0)
            parts = [(s, row) for s, row in zip(kept, each, strict=False) if s is not None]
        for environment in (e for e in lights.environments if e.index in self._maps):
            shared += self._environment(environment, series, yaw) * environment.factor
        mirror = series.mirror[:, None]
        near = lights.spheres or lights.discs or lights.polygons
        if not near and not parts:
            both = series.constants(np.stack([shared, shared * mirror]))
            return both, flip.astype(np.int64)
        rows = np.repeat(shared[None], len(centres), axis=0)
        for share, row in parts:
            rows += share[:, None, None] * row
        for ball in lights.spheres:
            offset = (ball.position - centres) @ sprite_from_world.T
            rows += series.sphere(offset, ball.radius, ball.radiance)
        if lights.discs or lights.polygons:
            from runtime import flat_lights

            for towards, light in flat_lights.suns(lights, centres):
                rows += series.sun(towards @ sprite_from_world.T, light).sum(axis=1)
        rows[flip] *= mirror
        return series.constants(rows), np.arange(len(centres))

    def _environment(self, state: EnvironmentState, series: Any, yaw: float) -> Array:
        turn = yaw - state.rotate
        # About the up axis a turn only rotates the series: project once for all yaws
        seen_from = 0.0 if series.turns else round(turn, 9)
        key = (state.index, *series.key, seen_from)
        if key not in self._kept:
            if not series.turns:
                self._kept = {k: v for k, v in self._kept.items() if k[:-1] != key[:-1]}
            self._kept[key] = series.environment(self._maps[state.index], seen_from)
        found = self._kept[key]
        return circular_harmonics.rotate(found, -turn, axis=0) if series.turns else found


def mirror_signs(terms: int) -> Array:
    """Factors (K,) of a series under t -> pi - t: sin(h t) keeps odd h, cos(h t) keeps even h.

    >>> mirror_signs(5).tolist()
    [1.0, 1.0, -1.0, -1.0, 1.0]
    """
    k = np.arange(terms)
    harmonic, is_cosine = (k + 1) // 2, k % 2 == 0
    return np.where((harmonic % 2 == 0) == is_cosine, 1.0, -1.0)


def shrunk(radiance: NDArray[np.floating], height: int = 32) -> Array:
    """Average a lat-long map down to about `height` rows: low harmonics need no more.

    Rows are averaged by solid angle, so that the map's total power stays.
    """
    h, w, _ = radiance.shape
    factor = max(1, h // height)
    if h % factor or w % factor:
        return np.asarray(radiance, np.float64)
    weight = transforms.latlong_solid_angles(h, w)[:, None, None]
    blocks = (radiance * weight).reshape(h // factor, factor, w // factor, factor, 3)
    total = weight.reshape(h // factor, factor).sum(axis=1)[:, None, None] * factor
    return np.asarray(blocks.sum(axis=(1, 3), dtype=np.float64) / total)


def irradiance_from_above(radiance: NDArray[np.floating]) -> Array:
    """Irradiance (3,) of a map (h, w, 3) on a level plane: integral of L cos over the top half."""
    h, w, _ = radiance.shape
    edges = np.cos(np.pi * np.arange(h + 1) / h)
    # Exact integral of cos over a row's band, 0 below the horizon
    clipped = np.maximum(edges, 0.0)
    band = 0.5 * (clipped[:-1] ** 2 - clipped[1:] ** 2) * (2 * np.pi / w)
    return np.einsum("hwc,h->c", np.asarray(radiance, np.float64), band)


def ambient(maps: dict[int, Array], environments: Sequence[EnvironmentState]) -> Array:
    """Irradiance (3,) of all environments on the ground; `maps` hold it per environment."""
    found = np.zeros(3)
    for state in environments:
        found += maps[state.index] * state.factor
    return found
