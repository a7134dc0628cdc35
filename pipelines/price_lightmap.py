"""What the light of a world of cubes costs: rays a texel against the spread of the bake's own sets.

The error is the lightmap's own: standard error over light, both RMS over texels. Eight sets of
rays, each spread by a shift of its own, tell it without a truth (`bake.lightmap_rounds`); that the
light is taken at the centres of texels is no part of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from bake import lightmap as stage
from bake.lightmap_rounds import SETS
from bake.recipe import Baked
from formats.lightmap import Lightmap
from maths import price as laws
from maths.price import Estimate
from pipelines import price

if TYPE_CHECKING:
    from bake.recipe import Entry, Input
    from bake.store import Store

QUANTITY = "irradiance, standard error RMS over texels, as a share of its RMS"
FEW, MANY = 16, 64  # rays of the probes
MOST_RAYS = 1 << 16
ROUNDS = 1.1
SLOWEST, FASTEST = 0.5, 0.75  # powers of rays, between which the probe decides


@dataclass(frozen=True)
class LightmapAsset:
    """Baked light by price. light : gathers with so many rays, no fewer. run : bakes with them, by
    the store. rays : counts for sale."""

    name: str
    light: Callable[[int], Lightmap]
    run: Callable[[Store, dict[str, Any], price.Watch | None], Entry]
    rays: tuple[int, ...] = tuple(SETS * n for n in price.ladder(2, MOST_RAYS // SETS))
    stops: bool = False

    def probe(self, clock: price.Clock) -> price.Prices:
        """Gather with few rays, and with a few more."""
        begun = clock()
        runs = [price.timed(partial(self.light, n), clock) for n in (SETS, FEW, MANY)]
        made = [found for found, _ in runs[1:]]
        errors = [float(each.quality["relative_error"]) for each in made]
        work = [[1.0, float(n)] for n in (FEW, MANY)]
        unit = laws.seconds_fitted(work, [seconds for _, seconds in runs[1:]])
        power = SLOWEST
        if min(errors) > 0:
            slope = float(np.log(errors[0] / errors[1]) / np.log(MANY / FEW))
            power = float(np.clip(slope, SLOWEST, FASTEST))
        law = laws.Law(0.0, errors[1] * MANY**power, power)
        size = 8 * made[1].faces.size[0] * made[1].faces.size[1]
        points = []
        for n in self.rays:
            # Rounds add up a little worse than one set of rays
            stop = {"error": min(1.0, ROUNDS * law.error(n))} if self.stops else {}
            point = price.Point({"rays": n, **stop}, law.error(n), float(unit @ [1.0, n]), size)
            points.append(point)
        return price.Prices(QUANTITY, tuple(points), clock() - begun)

    def bake(self, store: Store, knobs: dict[str, Any], watch: price.Watch | None) -> Entry:
        """Gather by the store."""
        return self.run(store, knobs, watch)

    def reached(self, store: Store, knobs: dict[str, Any]) -> Estimate:
        """Read what the sets of the bake say; rows of the atlas tell how sure that is."""
        found = Lightmap.load(self.run(store, knobs, None).path)
        squares = np.sum(np.square(found.error, dtype=np.float64), axis=(1, 2))
        wholes = np.sum(np.square(found.irradiance, dtype=np.float64), axis=(1, 2))
        lit = wholes > 0
        told = laws.relative_rms(squares[lit], wholes[lit])
        value = float(found.quality["relative_error"])
        factor = value / told.value if told.value > 0 else 1.0
        return Estimate(value, told.low * factor, told.high * factor)


def of_inputs(
    name: str, inputs: list[Input], params: stage.Params, *, stops: bool = False
) -> LightmapAsset:
    """Return the lightmap of a world, and of what is around it, by price. stops : where it has
    reached the target of `params`."""
    assets = [each.load(each.entry.path) if isinstance(each, Baked) else each.load()
              for each in inputs]  # fmt: skip

    def knobs(rays: int) -> stage.Params:
        return replace(params, rays=rays, target=params.target if stops else 0.0)

    def run(store: Store, chosen: dict[str, Any], watch: price.Watch | None) -> Entry:
        return store.run(stage.light, *inputs, params=knobs(chosen["rays"]), on_progress=watch)

    return LightmapAsset(name, lambda rays: stage.light(*assets, params=knobs(rays)), run)
