"""Fins along the outline of a mesh: from its polygons' edges out to the round outline they mean.

At a smooth vertex the outline of the surface lies beyond the vertex by rho (1 - cos delta): rho is
the radius of the surface along the view, delta the angle between the normal and the picture. From
there a cubic of the handles of an arc leads to the next, at right angles to both normals in the
picture. At a crease its tangent is where the two smooth sides meet. A fin never takes away: where
the cubic lies within the polygon the fin has no width.

References
----------
Hertzmann, Zorin 2000, Illustrating Smooth Surfaces (the outline where normal . view is 0).
Vlachos, Peters, Boyd, Mitchell 2001, Curved PN Triangles (edges from normals).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.silhouette_edges import Edges, Index, tangents

Array = NDArray[np.float64]
LEAST = 0.5  # pixels: a width below changes nothing
MOST_STEPS, SLACK = 16, 0.05  # of the cubic as a polygon; pixels it may be off
SHARP = 0.05  # sine between two normals of a crease
STEEP = 0.2  # cosine between a fin and its edge's normal: less is no outline of that edge
BENT = 0.5  # cosine between a chord and the tangent at its end: less is no arc
NOTCH = 0.75  # length of the mean of the outward vectors that meet: less is a corner
SEAM = 1.5  # pixels within the polygon's edge over which a fin that stands out ends
ASTRAY, FITS = 0.75, 0.9  # cosine between a fin and its edge's normal: from none to all of it
EDGE = 1.0  # half of a pixel's diagonal at most, and room to spare
COLUMNS = ("place", 2), ("beyond", 1), ("fade", 1), ("depths", 4), ("chord", 4), ("seam", 1)
"""What a vertex of a fin has, in order: see `Fins.vertices`."""


@dataclass(frozen=True, eq=False)
class Fins:
    """Fins of a mesh in one picture.

    vertices : (n, steps + 1, 3, 13), along each edge and outwards from within the polygon to the
    round outline and to the tip: place (2,) pixels from the lower left; beyond, pixels past the
    outline; fade, pixels over which it ends; depths (4,), all near / distance: its own, of the
    nearest of the faces beside it, and from which to which the picture's colour is the mesh's;
    chord, a point (2,) of the polygon's edge and the unit vector (2,) outwards; seam, the share of
    its colour that hides the polygon's last row of pixels.
    heights : (n, steps + 1) pixels between polygon and outline.
    """

    vertices: Array
    heights: Array

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Numbers (k, 3) of vertices."""
        count, columns = self.vertices.shape[:2]
        corner = 3 * np.arange(columns - 1)[:, None] + np.arange(2)
        two = np.stack([[corner, corner + 1, corner + 3], [corner + 3, corner + 1, corner + 4]])
        cell = np.moveaxis(two, (0, 1), (2, 3)).reshape(-1, 3)
        start = 3 * columns * np.arange(count)[:, None, None]
        return np.asarray((start + cell).reshape(-1, 3), np.int32)


def fin_alpha(
    inside: ArrayLike, beyond: ArrayLike, fade: ArrayLike, half: ArrayLike, seam: ArrayLike
) -> Array:
    """Share of a fin's colour laid over a pixel that the polygon covers already in part.

    inside : pixels past the polygon's edge. beyond : past the outline. fade : pixels over which it
    ends. half : of a pixel's extent across the edge. seam : at most, over whole pixels within, none
    of it SEAM further in; under a half the fin itself thins out. The twin of `silhouette.glsl`.
    """
    past_edge, past_outline, soft, extent, share = (
        np.asarray(each, np.float64) for each in (inside, beyond, fade, half, seam)
    )
    whole = 2.0 * extent
    covered = np.clip(0.5 - past_edge / whole, 0.0, 1.0)
    wanted = 1.0 - np.clip((past_outline + extent) / (whole + soft), 0.0, 1.0)
    over = np.clip((wanted - covered) / np.maximum(1.0 - covered, 1e-6), 0.0, 1.0)
    within = np.clip(1.0 + (past_edge + extent) / SEAM, 0.0, 1.0)
    over = over * np.minimum(2.0 * share, 1.0)
    return np.asarray(np.where(covered < 1.0, over, share * within))


def fins(
    edges: Edges,
    clip_from_mesh: Array,
    eye: ArrayLike,
    size: tuple[int, int],
    *,
    width: float,
    softness: float = 0.0,
    near: float = 0.1,
) -> Fins:
    """Return the fins of a mesh; all lengths in the mesh's units.

    clip_from_mesh : (4, 4), the last row distance along the axis. eye : (3,) in the mesh's frame.
    size : (width, height) of the picture. width : farthest that a fin stands out, and softness :
    how much farther it fades, as a share of that. near : distance of the near plane; edges that
    reach it have none.
    """
    edge = edges.turning(eye)
    view = _View(clip_from_mesh, np.asarray(eye, np.float64), size)
    distance = _project(edges.points[edges.ends[edge]], clip_from_mesh, size)[1]
    edge = edge[(distance > 1.001 * near).all(axis=1)]
    chord = _chords(edges, edge, view)
    long = chord.length > 1e-3
    edge, chord = edge[long], chord.of(long)
    limit = _limit(chord.distance, clip_from_mesh, size, width)
    start, outward = _ends(edges, edge, chord, view, limit)
    mean = _means(edges, edge, chord.normal)
    alone = edges.faces[edge, 1] < 0
    start[alone], outward[alone] = chord.ends[alone], _unit(mean[alone])
    lean = np.sum(outward * chord.normal[:, None], axis=-1)
    steep = lean < STEEP
    outward[steep] = np.broadcast_to(chord.normal[:, None], outward.shape)[steep]
    # Normals that do not fit the polygon, as of ridges shaded as one, say nothing of its outline
    fit = np.clip((lean.min(axis=1) - ASTRAY) / (FITS - ASTRAY), 0.0, 1.0)[:, None]
    start = chord.ends + fit[..., None] * (start - chord.ends)
    limit = fit * limit
    # Where outlines meet at an angle, fading fins would leave a notch
    even = np.clip((np.linalg.norm(mean, axis=-1) - NOTCH) / (1.0 - NOTCH), 0.0, 1.0)
    curves = _Curves(chord, start, outward, alone[:, None] | steep, limit, softness * limit * even)
    high = curves.at(np.array([0.0, 0.5, 1.0]))[3]
    shown = (high.max(axis=1) > 1e-3) | (curves.fade.max(axis=1) > 1e-3)
    depths = _depths(edges, edge[shown], chord.of(shown), view, near)
    steps = np.ceil(np.sqrt(high.max(initial=0.0) / SLACK))
    return _strips(curves.of(shown), depths, near, int(np.clip(steps, 1, MOST_STEPS)))


@dataclass(frozen=True, eq=False)
class _View:
    matrix: Array
    eye: Array
    size: tuple[int, int]

    def directions(self, points: Array, vectors: Array) -> Array:
        """Directions (..., 2) in the picture of small vectors at points, not normalised."""
        clip = points @ self.matrix[:, :3].T + self.matrix[:, 3]
        turn = vectors @ self.matrix[:, :3].T
        x = (turn[..., :2] * clip[..., 3:] - clip[..., :2] * turn[..., 3:]) / clip[..., 3:] ** 2
        return np.asarray(0.5 * x * np.array(self.size))


@dataclass(frozen=True, eq=False)
class _Chords:
    """Edges in the picture: ends (n, 2, 2) pixels, distance (n, 2), normal (n, 2) outwards."""

    ends: Array
    distance: Array
    normal: Array
    length: Array

    def of(self, which: NDArray[np.bool_]) -> _Chords:
        return _Chords(
            self.ends[which], self.distance[which], self.normal[which], self.length[which]
        )


@dataclass(frozen=True, eq=False)
class _Curves:
    """Outlines: start (n, 2, 2) and outward (n, 2, 2) at both ends, straight (n, 2) where the curve
    leaves along the chord, limit and fade (n, 2) pixels."""

    chord: _Chords
    start: Array
    outward: Array
    straight: NDArray[np.bool_]
    limit: Array
    fade: Array

    def of(self, which: NDArray[np.bool_]) -> _Curves:
        start, outward, straight = self.start[which], self.outward[which], self.straight[which]
        chord, limit, fade = self.chord.of(which), self.limit[which], self.fade[which]
        return _Curves(chord, start, outward, straight, limit, fade)

    def at(self, t: Array) -> tuple[Array, Array, Array, Array]:
        """Points (n, k, 2), ways out (n, k, 2), their cosines to the chord's and heights (n, k)."""
        normal, base = self.chord.normal[:, None], _between(self.chord.ends, t)
        outline = _cubic(self.start, self.outward, self.straight, t)
        way = _unit(_between(self.outward, t))
        lean = np.maximum(np.sum(way * normal, axis=-1), STEEP)
        rise = np.sum((outline - base) * normal, axis=-1)
        high = np.clip(rise, 0.0, _between(self.limit, t))
        return outline + ((high - rise) / lean)[..., None] * way, way, lean, high


def _project(points: Array, matrix: Array, size: tuple[int, int]) -> tuple[Array, Array]:
    """Pixels (..., 2) from the lower left, and distance (...) along the axis."""
    clip = points @ matrix[:, :3].T + matrix[:, 3]
    safe = np.maximum(clip[..., 3:], 1e-9)
    return np.asarray((0.5 * clip[..., :2] / safe + 0.5) * np.array(size)), clip[..., 3]


def _chords(edges: Edges, edge: NDArray[np.int64], view: _View) -> _Chords:
    point = edges.points[edges.ends[edge]]
    pixels, distance = _project(point, view.matrix, view.size)
    along = pixels[:, 1] - pixels[:, 0]
    length = np.linalg.norm(along, axis=1)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(length, 1e-9)[:, None]
    # The side of the faces, from the plane through eye and edge: it holds behind the eye too
    plane = np.cross(point[:, 0] - view.eye, point[:, 1] - view.eye)
    side = np.einsum("ekc,ec->ek", edges.points[edges.across[edge]] - view.eye, plane)
    larger = np.take_along_axis(side, np.abs(side).argmax(axis=1)[:, None], axis=1)
    return _Chords(pixels, distance, np.where(larger > 0, left, -left), length)


def _limit(distance: Array, matrix: Array, size: tuple[int, int], width: float) -> Array:
    """The most pixels that fins stand out at distances; none below half a pixel, all from one."""
    pixels = width * 0.5 * size[1] * np.linalg.norm(matrix[1, :3]) / distance
    return np.asarray(pixels * np.clip(pixels / LEAST - 1.0, 0.0, 1.0))


def _ends(
    edges: Edges, edge: NDArray[np.int64], chord: _Chords, view: _View, limit: Array
) -> tuple[Array, Array]:
    """Where outlines start (n, 2, 2) and which way is outwards there (n, 2, 2), in pixels."""
    point, smooth = edges.points[edges.ends[edge]], edges.smooth[edge]
    one, two = edges.normals[smooth[:, 0]], edges.normals[smooth[:, 1]]
    sight = view.eye - point
    sight = sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    facing = np.sum(one * sight, axis=-1)
    level = one - facing[..., None] * sight
    cosine = np.linalg.norm(level, axis=-1)
    level = level / np.maximum(cosine, 1e-9)[..., None]

    stand, normal = _outline(edges, smooth[:, 0], sight, facing, cosine)
    shift = stand[..., None] * view.directions(point, level)
    pixels = np.linalg.norm(shift, axis=-1)
    shift *= np.minimum(1.0, limit / np.maximum(pixels, 1e-9))[..., None]

    # What is at right angles in the picture is not so in space, but tangents stay tangents
    fold = np.cross(one, two)
    crease = (np.linalg.norm(fold, axis=-1) > SHARP)[..., None]
    along = _unit(view.directions(point, np.where(crease, fold, np.cross(sight, normal))))
    outward = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    outward *= np.where(np.sum(outward * chord.normal[:, None], axis=-1, keepdims=True) < 0, -1, 1)
    return chord.ends + np.where(crease, 0.0, shift), outward


def _outline(
    edges: Edges, smooth: Index, sight: Array, facing: Array, cosine: Array
) -> tuple[Array, Array]:
    """How far (n, 2) the smooth outline lies beyond vertices, and the surface's normal there."""
    normal = edges.normals[smooth]
    u, v = tangents(normal)
    x, y = np.sum(u * sight, axis=-1), np.sum(v * sight, axis=-1)
    length = np.maximum(np.hypot(x, y), 1e-9)
    x, y = x / length, y / length
    xx, xy, yy = np.moveaxis(edges.bends[smooth], -1, 0)
    turn = (xx * x + xy * y)[..., None] * u + (xy * x + yy * y)[..., None] * v
    bend = xx * x * x + 2.0 * xy * x * y + yy * y * y
    reach = edges.reach[smooth]
    # Where it is flatter than an edge can turn, the outline is not of this vertex
    bend = np.where(bend * reach > 1e-4, bend, np.inf)
    away = np.arctan2(np.abs(facing), cosine) / bend / reach
    stand = (1.0 - cosine) / bend * np.clip(2.0 - away, 0.0, 1.0)
    # Along the view the normal turns with the surface, until it looks neither to nor fro
    turned = normal - (facing / np.maximum(length, 1e-9) / bend)[..., None] * turn
    return stand, _unit(turned)


def _depths(
    edges: Edges, edge: NDArray[np.int64], chord: _Chords, view: _View, near: float
) -> Array:
    """Near / distance (n, 3) of the nearest that the faces at both ends may come, and from which to
    which the mesh's own lie."""
    scale = np.linalg.norm(view.matrix[3, :3])
    beside = scale * edges.reach[edges.smooth[edge]].max(axis=(1, 2))
    nearest, spread = chord.distance.min(axis=1) - beside, 0.5 * edges.radius * scale
    far, close = chord.distance.max(axis=1) + spread, chord.distance.min(axis=1) - spread
    found = [near / np.maximum(each, near) for each in (nearest, far, close)]
    return np.stack(found, axis=1)


def _means(edges: Edges, edge: NDArray[np.int64], normal: Array) -> Array:
    """Mean (n, 2, 2) of the outward vectors of the edges at each end."""
    ends = edges.ends[edge]
    points, at = np.unique(ends, return_inverse=True)
    at = at.reshape(ends.shape)
    count = np.bincount(at.ravel(), minlength=len(points))
    rows = np.repeat(normal, 2, axis=0)
    sums = [np.bincount(at.ravel(), rows[:, axis], len(points)) for axis in (0, 1)]
    return np.asarray((np.stack(sums, axis=1) / np.maximum(count, 1)[:, None])[at])


def _cubic(start: Array, outward: Array, straight: NDArray[np.bool_], t: Array) -> Array:
    """Points (n, k, 2) of cubics between starts (n, 2, 2), with the handles of an arc."""
    chord = start[:, 1] - start[:, 0]
    length = np.linalg.norm(chord, axis=1)
    tangent = np.stack([-outward[..., 1], outward[..., 0]], axis=-1)
    cosine = np.sum(tangent * chord[:, None], axis=-1) / np.maximum(length, 1e-9)[:, None]
    tangent *= np.where(cosine < 0.0, -1.0, 1.0)[..., None]
    cosine = np.abs(cosine)
    arc = (2.0 / 3.0) / (1.0 + cosine) * length[:, None]
    plain = (straight | (cosine < BENT))[..., None]
    handles = np.where(plain, chord[:, None] / 3.0, tangent * arc[..., None])
    t = t[:, None]
    a, d = start[:, None, 0], start[:, None, 1]
    b, c, s = a + handles[:, None, 0], d - handles[:, None, 1], 1.0 - t
    return np.asarray(s**3 * a + 3 * s * s * t * b + 3 * s * t * t * c + t**3 * d)


def _between(ends: Array, t: Array) -> Array:
    """Values (n, k, ...) between those at the ends (n, 2, ...)."""
    t = t.reshape(-1, *(1,) * (ends.ndim - 2))
    return np.asarray(ends[:, :1] * (1.0 - t) + ends[:, 1:] * t)


def _strips(curves: _Curves, depths: Array, near: float, steps: int) -> Fins:
    """Join rows within the polygon's edges, of the outlines and of the tips."""
    chord, t = curves.chord, np.linspace(0.0, 1.0, steps + 1)
    outline, way, lean, high = curves.at(t)
    soft = _between(curves.fade, t)
    within = (SEAM + EDGE) / lean
    inner = _between(chord.ends, t) - within[..., None] * way
    tip = outline + (soft + EDGE)[..., None] * way
    rows = np.zeros((*high.shape, 3, sum(size for _, size in COLUMNS)))
    rows[..., :2] = np.stack([inner, outline, tip], axis=2)
    rows[..., 2] = np.stack([-high / lean - within, 0.0 * high, soft + EDGE], axis=2)
    rows[..., 3] = soft[..., None]
    rows[..., 4] = _between(near / chord.distance, t)[..., None]
    rows[..., 5:8] = depths[:, None, None]
    rows[..., 8:10] = chord.ends[:, None, None, 0]
    rows[..., 10:12] = chord.normal[:, None, None]
    rows[..., 12] = np.minimum(high + soft, 1.0)[..., None]
    return Fins(rows, high)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, 1e-30))
