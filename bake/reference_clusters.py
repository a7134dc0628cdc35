"""Many small lights in a few clusters, of which near and strong ones are chosen more often.

A cluster's chance at a point is its power over its squared distance, as in Shirley, Wang,
Zimmerman 1996, *Monte Carlo Techniques for Direct Lighting Calculations*, 3.2.1, softened by the
cluster's own size; what hides it is not known. So lamps near a wall do not starve where a far
panel, or one behind a door, has most of the power.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST = 16
"""Clusters: their chances are worked out at every point."""


@dataclass(frozen=True, eq=False)
class Clusters:
    """K clusters of m lights. of : (m,) cluster of each. centre : (K, 3) metres, of power. size :
    (K,) mean squared distance of the power from it. power : (K,)."""

    of: Indices
    centre: Array
    size: Array
    power: Array

    @classmethod
    def around(cls, places: Array, spread: Array, power: Array) -> Clusters:
        """Part m > 0 lights by halving the longest box again and again.

        places : (m, 3) their middles. spread : (m,) > 0, mean squared distance of a light's points
        from its middle. power : (m,) > 0.
        """
        members = [np.arange(len(places))]
        while len(members) < MOST:
            spans = [np.ptp(places[each], axis=0) for each in members]
            largest = int(np.argmax([span.max() for span in spans]))
            axis = int(np.argmax(spans[largest]))
            if spans[largest][axis] <= 0:
                break
            inside = members.pop(largest)
            along = places[inside, axis]
            low = along <= along.min() + spans[largest][axis] / 2
            members += [inside[low], inside[~low]]
        of = np.empty(len(places), np.int64)
        for number, each in enumerate(members):
            of[each] = number
        total = _sums(of, power)
        centre = np.stack([_sums(of, power * x) for x in places.T], axis=-1) / total[:, None]
        apart = np.sum((places - centre[of]) ** 2, axis=1) + spread
        return cls(of, centre, _sums(of, power * apart) / total, total)

    def choose(self, points: Array, u: Array) -> tuple[Indices, Array, Array]:
        """Return for points (n, 3) and numbers u (n,) in [0, 1) a cluster, its chance, and how far
        u is into it, 0..1."""
        weights = self._weights(points)
        ends = np.cumsum(weights, axis=1)
        scaled = u * ends[:, -1]
        above = ends > scaled[:, None]
        # Rounding may leave none above
        above[:, -1] = True
        row, found = np.arange(len(points)), above.argmax(axis=1)
        own = weights[row, found]
        within = np.clip((scaled - ends[row, found] + own) / own, 0, 1)
        return found, own / ends[:, -1], within

    def chance(self, points: Array, cluster: Indices) -> Array:
        """Chance (n,) that `choose` takes clusters (n,) at points (n, 3)."""
        weights = self._weights(points)
        return np.asarray(weights[np.arange(len(points)), cluster] / weights.sum(axis=1))

    def _weights(self, points: Array) -> Array:
        """Power (n, K) over squared distance and size: squares and products by one matrix."""
        middle = self.centre.mean(axis=0)
        p, c = points - middle, self.centre - middle
        rows = np.concatenate([p, np.einsum("ij,ij->i", p, p)[:, None], np.ones((len(p), 1))], 1)
        columns = np.stack([*(-2 * c.T), np.ones(len(c)), np.sum(c * c, axis=1) + self.size])
        # Next to a centre that rounds, by less than sizes, or the floor takes over
        squared = np.maximum(rows @ columns, self.size)
        return np.asarray(self.power / squared)


def _sums(of: Indices, values: Array) -> Array:
    """Sums (K,) of values (m,) by cluster."""
    return np.asarray(np.bincount(of, values), np.float64)
