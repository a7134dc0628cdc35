"""Wood: how limbs grow (wandering shoots, space colonisation) and the bark round them."""

from dataclasses import dataclass

import numpy as np
from chance import Chance
from clay import Array, Clay, across, unit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Limb:
    """A path (n, 3) in metres from its base to its tip, and the radius (n,) along it."""

    path: Array
    radius: Array

    def at(self, fraction: float) -> tuple[Array, Array, float]:
        """Point, unit direction and radius at a fraction 0..1 of the path's nodes."""
        x = fraction * (len(self.path) - 1)
        i = min(int(x), len(self.path) - 2)
        step = self.path[i + 1] - self.path[i]
        r = self.radius[i] + (self.radius[i + 1] - self.radius[i]) * (x - i)
        return self.path[i] + step * (x - i), unit(step), float(r)


def shoot(
    chance: Chance,
    base: Array,
    direction: Array,
    length: float,
    radius: tuple[float, float],
    *,
    nodes: int = 6,
    wander: float = 0.1,
    pull: Array | float = 0.0,
    taper: float = 1.0,
) -> Limb:
    """A shoot that wanders and is pulled (a vector, or upwards if a number) as it grows."""
    steps = nodes - 1
    tug = np.asarray(pull) * UP if np.ndim(pull) == 0 else np.asarray(pull)
    heading = unit(np.asarray(direction, dtype=np.float64))
    path = [np.asarray(base, dtype=np.float64)]
    for noise in chance.normal((steps, 3)):
        heading = unit(heading + wander * noise + tug / steps)
        path.append(path[-1] + heading * (length / steps))
    t = np.linspace(0.0, 1.0, nodes)
    return Limb(np.array(path), radius[0] + (radius[1] - radius[0]) * t**taper)


def colonise(
    chance: Chance, trunk: Array, attractors: Array, *, step: float, kill: float, influence: float
) -> tuple[Array, NDArray[np.int64]]:
    """Grow nodes towards attractors (Runions et al. 2007, Modeling Trees with a Space Colonization
    Algorithm): points (n, 3) and each one's parent, which always comes before it (-1: the root)."""
    points = [np.asarray(p, dtype=np.float64) for p in trunk]
    parent = list(range(-1, len(points) - 1))
    alive = attractors
    for _ in range(400):
        nodes = cKDTree(np.array(points))
        distance, nearest = nodes.query(alive, distance_upper_bound=influence)
        near = np.isfinite(distance)
        if not near.any():
            break
        # Each node heads for the mean direction of the attractors that chose it.
        pulls = np.zeros((len(points), 3))
        np.add.at(pulls, nearest[near], unit(alive[near] - np.array(points)[nearest[near]]))
        growing = np.unique(nearest[near])
        heading = unit(unit(pulls[growing]) + 0.12 * chance.normal((len(growing), 3)))
        fresh = np.array(points)[growing] + step * heading
        new = nodes.query(fresh)[0] > 0.4 * step
        if not new.any():
            break
        points.extend(fresh[new])
        parent.extend(int(i) for i in growing[new])
        alive = alive[cKDTree(fresh[new]).query(alive)[0] > kill]
        if not len(alive):
            break
    return np.array(points), np.array(parent)


def pipe_radii(parent: NDArray[np.int64], tip: float, base: float) -> Array:
    """Radii by da Vinci's rule r^e = sum of the children's r^e, e chosen so that the root has
    `base` when every tip has `tip`."""
    tips = np.ones(len(parent))
    tips[np.unique(parent[parent >= 0])] = 0.0
    for i in range(len(parent) - 1, 0, -1):
        if parent[i] >= 0:
            tips[parent[i]] += tips[i]
    return tip * tips ** (np.log(base / tip) / np.log(tips[0]))


def limbs_of(points: Array, parent: NDArray[np.int64], radii: Array) -> list[Limb]:
    """Cut a grown graph into limbs: each follows its thickest child to the tip."""
    children: list[list[int]] = [[] for _ in parent]
    for i, p in enumerate(parent):
        if p >= 0:
            children[p].append(i)
    limbs: list[Limb] = []
    starts = [(-1, 0)]
    while starts:
        before, node = starts.pop()
        chain = [node] if before < 0 else [before, node]
        while children[node]:
            order = sorted(children[node], key=lambda c: -radii[c])
            starts.extend((node, c) for c in order[1:])
            node = order[0]
            chain.append(node)
        radius = radii[chain].copy()
        if before >= 0:
            radius[0] = radius[1]
        if len(chain) > 1:
            limbs.append(Limb(points[chain], radius))
    return limbs


def smoothed(limb: Limb, rounds: int = 1) -> Limb:
    """The limb with inner nodes averaged with their neighbours."""
    path = limb.path.copy()
    for _ in range(rounds):
        path[1:-1] = 0.25 * path[:-2] + 0.5 * path[1:-1] + 0.25 * path[2:]
    return Limb(path, limb.radius)


def thinned(limb: Limb, every: int) -> Limb:
    """The limb with each `every`-th node only, both ends kept."""
    keep = np.unique(np.append(np.arange(0, len(limb.path), every), len(limb.path) - 1))
    return Limb(limb.path[keep], limb.radius[keep])


def sides_for(radius: float) -> int:
    """How many sides a tube of this radius deserves."""
    return 12 if radius > 0.12 else 7 if radius > 0.05 else 4 if radius > 0.018 else 3


def bark(
    clay: Clay,
    limb: Limb,
    colour: Array,
    *,
    sides: int | None = None,
    ridges: Array | None = None,
    part: str = "bark",
) -> None:
    """Press a tapering tube; colour (3,), (n, 3) or (n, sides, 3), ridges (n, sides) on radii."""
    sides = sides or sides_for(float(limb.radius[0]))
    n = len(limb.path)
    # Carry one frame along the path, turning it no more than the path turns.
    tangent = unit(np.gradient(limb.path, axis=0))
    side = np.empty_like(tangent)
    side[0] = across(tangent[0], np.array([1.0, 0.0, 0.0]))
    for i in range(1, n):
        side[i] = across(tangent[i], side[i - 1])
    other = np.cross(tangent, side)
    turn = np.arange(sides) * (2.0 * np.pi / sides)
    out = side[:, None] * np.cos(turn)[:, None] + other[:, None] * np.sin(turn)[:, None]
    reach = limb.radius[:, None] * (np.ones((n, sides)) if ridges is None else ridges)
    positions = limb.path[:, None] + out * reach[..., None]
    normals = out if ridges is None else _grid_normals(positions, out)
    colours = np.broadcast_to(
        colour if np.ndim(colour) != 2 else np.asarray(colour)[:, None], positions.shape
    )
    i, j = np.meshgrid(np.arange(n - 1), np.arange(sides), indexing="ij")
    k = (j + 1) % sides
    a, b, c, d = i * sides + j, i * sides + k, (i + 1) * sides + k, (i + 1) * sides + j
    quads = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    clay.press(
        part, positions.reshape(-1, 3), normals.reshape(-1, 3), colours.reshape(-1, 3), quads
    )


def _grid_normals(positions: Array, out: Array) -> Array:
    around = np.roll(positions, -1, axis=1) - np.roll(positions, 1, axis=1)
    along = np.gradient(positions, axis=0)
    normals = np.cross(around, along)
    flip = np.sum(normals * out, axis=-1, keepdims=True) < 0.0
    return unit(np.where(flip, -normals, normals))
