"""Sprites in the light of a world of cubes: what comes to where they stand.

The light of surfaces is that of few points, `runtime.probe_places`. Lamps and what glows light each
sprite by its own place: what lies in between is how much of them is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maths import transforms
from runtime.passes import probe
from runtime.probe_places import Places, spread

Array = NDArray[np.float64]

EXACT = 512
"""Sprites of a set to which what glows sends its light from where it is; more share points for it,
too."""


class SpriteProbes:
    """Answers `runtime.lighting.SpriteLighting`. passed : pass `probe` of the player. player : its
    sprites, all of a set, choose the points, so that light does not ask which of them are seen."""

    def __init__(self, passed: Any, player: Any = None) -> None:
        self._probe, self._player = passed, player
        self._places: dict[Any, Places] = {}
        self._rows: dict[Any, tuple[Any, Array]] = {}

    def rows(
        self,
        lights: Any,
        series: Any,
        yaw: float,
        centres: Array,
        shares: Sequence[Array | None] = (),
    ) -> Array:
        """Return series (n, K, 3) of all light on sprites at centres (n, 3), metres.

        lights, series, yaw, shares : as `runtime.lighting.SpriteLighting.project` takes them.
        """
        sprite_from_world = transforms.rotation("y", -yaw)
        found = self.project(series, yaw, centres)
        seen = self._seen(series, centres)[:, :, None, None]
        for number, sun in enumerate(lights.suns):
            row = series.sun(sprite_from_world @ sun.to_light, sun.irradiance)
            share = shares[number] if number < len(shares) else None
            found += seen[:, number] * (row if share is None else share[:, None, None] * row)
        for number, ball in enumerate(lights.spheres, len(lights.suns)):
            offset = (ball.position - centres) @ sprite_from_world.T
            found += seen[:, number] * series.sphere(offset, ball.radius, ball.radiance)
        if lights.discs or lights.polygons:
            from runtime import flat_lights

            first = len(lights.suns) + len(lights.spheres)
            for number, (towards, light) in enumerate(flat_lights.suns(lights, centres), first):
                flat = series.sun(towards @ sprite_from_world.T, light).sum(axis=1)
                found += seen[:, number] * flat
        return found

    def project(self, series: Any, yaw: float, centres: Array) -> Array:
        """Return series (n, K, 3) of what cubes, lamps and the environment send to sprites.

        series : as of `runtime.lighting`. yaw : of the camera. centres : (n, 3) metres.
        """
        places, passed = self._at(series, centres), self._probe
        exact = len(self._every(series, centres)) <= EXACT
        share = self._even(places, exact)
        found = passed.around(places.points, passed.time, share)
        # Where only others move, light stays: what it was made from is the same object
        key = id(series), centres.tobytes(), yaw
        made, rows = self._rows.get(key, (None, centres))
        if made is found:
            return rows.copy()
        sprite_from_world = transforms.rotation("y", -yaw)

        def basis(directions: Array) -> Array:
            return np.asarray(series.directions(directions @ sprite_from_world.T))

        even = 4.0 * np.pi / len(passed.directions) * basis(passed.directions)
        light = even.T @ found.radiance.astype(np.float64)
        if not exact:
            light += passed.glow(places.points, found.places, basis, share)
            rows = places.between(light)
        else:
            rows = places.between(light)
            rows += passed.glow(centres, places.between(found.places), basis, share)
        seen = places.between(found.lamps)
        for i, ball in enumerate(passed.balls(passed.time)):
            offset = (ball.middle - centres) @ sprite_from_world.T
            rows += seen[:, i, None, None] * series.sphere(offset, ball.radius, ball.radiance)
        while len(self._rows) >= probe.KEPT:
            del self._rows[next(iter(self._rows))]
        self._rows[key] = found, rows.copy()
        return rows

    def _seen(self, series: Any, centres: Array) -> Array:
        """Share (n, lights) that sprites see of each of the scene's lights."""
        places = self._at(series, centres)
        share = self._even(places, len(self._every(series, centres)) <= EXACT)
        return places.between(self._probe.around(places.points, self._probe.time, share).lights)

    def _even(self, places: Places, exact: bool) -> float:
        """Rays count less where places on what glows are looked at from each sprite."""
        shared = places.number.shape[1] > 1 and exact
        return probe.EVEN * self._probe.share_of_rays() if shared else probe.EVEN

    def _every(self, series: Any, centres: Array) -> Array:
        """Centres (m, 3) of all sprites that count light by this series."""
        sets = [] if self._player is None else self._player.sprites
        found = [s.centres for s in sets if s.series is series]
        return np.concatenate(found) if found else centres

    def _at(self, series: Any, centres: Array) -> Places:
        volume, every = self._probe.cubes.volume, self._every(series, centres)
        state = self._probe.cubes.state(self._probe.time)
        key = centres.tobytes(), every.tobytes(), state
        if key not in self._places:
            while len(self._places) >= probe.KEPT:
                del self._places[next(iter(self._places))]
            own, others = ((each - volume.origin) / volume.cell_size for each in (centres, every))
            found = spread(own, volume.solid, others)
            points = found.points * volume.cell_size + volume.origin
            self._places[key] = Places(points, found.number, found.weight)
        return self._places[key]
