"""Do rays leave a closed mesh, or meet the convex mesh that they start on?

Embree itself promises no more than 2 leaks in 100,000 rays in its robust mode, and has a scale
beyond which each mode misses everything. Rays start inside a ball, a ring and a lean box, at any
place and in any direction; then on the outside of the ball and the box. The truth is that none
leaves and none is blocked, whatever the mesh's scale and its distance from the origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import workers
from bake.rays import RayScene, offset_origins
from pipelines.studies import interval
from pipelines.studies.answer import Answer, Panel, Picture, Row, Shot, point
from pipelines.studies.subjects import Setting

Array = NDArray[np.float64]
Float = NDArray[np.float32]

TAKES: tuple[str, ...] = ()
SCALES = (1e-6, 1e-3, 1.0, 1e3, 1e6)
# In sizes of the mesh. Leaks are sought with vertices in float32, as files hold them, up to 1e3; in
# float64 at 1e6, where float32 would have steps of a sixteenth of the mesh. Rounded far from the
# origin a mesh stays closed but not convex: rays on it take float64
OFFSETS = (0.0, 1e3, 1e6)
PLACE = np.array([0.7, -1.0, 0.3])
TILE = 1 << 16
DEEPEST = 0.98  # of the way from the core to the surface, where rays start
RING = 0.4  # radius of the ring's tube, of a circle of radius 1
LEAN = np.array([1.0, 0.3, 0.02])


@dataclass(frozen=True)
class Subject:
    """A closed mesh about the origin. vertices : (n, 3).  faces : (m, 3), outward.  kind : how
    places within are drawn."""

    kind: str
    vertices: Array
    faces: NDArray[np.int64]

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Draw places (count, 3) within, off the surface by at least a fiftieth of the way."""
        if self.kind == "box":
            return np.asarray(rng.uniform(-DEEPEST, DEEPEST, (count, 3)) * LEAN)
        # Chords of 64 rings lie within cos(pi / 64) cos(pi / 128) = .9985
        inner = DEEPEST * np.cbrt(rng.random((count, 1))) * directions(rng, count)
        if self.kind == "ball":
            return np.asarray(inner)
        around = rng.uniform(0, 2 * np.pi, count)
        out = np.stack([np.cos(around), np.zeros(count), np.sin(around)], axis=-1)
        # A ball of .9 of the tube's radius about the circle stays within the ring
        return np.asarray(out + 0.9 * RING * inner)


def subjects() -> tuple[Subject, ...]:
    """Return the ball of 64 by 128, the ring of 96 by 48, and the box fifty times as long as
    thin."""
    t = np.pi * np.arange(65)[:, None] / 64
    p = 2 * np.pi * np.arange(128) / 128
    ball = [np.sin(t) * np.cos(p), np.cos(t) + 0 * p, -np.sin(t) * np.sin(p)]
    v = 2 * np.pi * np.arange(48) / 48
    u = 2 * np.pi * np.arange(96)[:, None] / 96
    wide = 1 + RING * np.cos(v)
    ring = [wide * np.cos(u), RING * np.sin(v) + 0 * u, -wide * np.sin(u)]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    box = np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))])
    return (
        _welded("ball", np.stack(ball, axis=-1), closed=False),
        _welded("ring", np.stack(ring, axis=-1), closed=True),
        Subject("box", signs * LEAN, box),
    )


def _welded(kind: str, grid: Array, *, closed: bool) -> Subject:
    """Make a mesh of a grid (rows, columns, 3) whose columns close, and rows too if `closed`."""
    rows, columns = grid.shape[:2]
    i, j = np.meshgrid(np.arange(rows if closed else rows - 1), np.arange(columns), indexing="ij")
    down, right = (i + 1) % rows, (j + 1) % columns
    a, b, c, d = (
        (r * columns + s).ravel() for r, s in ((i, j), (down, j), (down, right), (i, right))
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    # Places that are one are one vertex: poles are exact, so that no sliver stays
    places = np.round(grid.reshape(-1, 3), 12) + 0.0
    vertices, same = np.unique(places, axis=0, return_inverse=True)
    faces = same.reshape(-1)[faces]
    apart = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return Subject(kind, vertices, faces[apart])


def directions(rng: np.random.Generator, count: int) -> Array:
    """Draw unit vectors (count, 3), even over the sphere."""
    vectors = rng.standard_normal((count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def placed(subject: Subject, scale: float, offset: float, *, exact: bool) -> tuple[RayScene, Array]:
    """Return the scene of a mesh scaled and moved by `offset` of its sizes, and by how much.

    exact : vertices stay float64.
    """
    place = PLACE * offset * scale
    vertices = subject.vertices * scale + place
    if not exact:
        vertices = vertices.astype(np.float32).astype(np.float64)
    return RayScene(vertices, subject.faces), place


def leaks(subject: Subject, scale: float, offset: float, rays: int, seed: int) -> int:
    """Count the rays from inside that meet nothing: half are asked for the first hit, half whether
    there is one. Memory: 6 MB a thread."""
    scene, place = placed(subject, scale, offset, exact=offset >= OFFSETS[-1])

    def count(tile: int) -> int:
        n = min(TILE, rays - tile * TILE)
        rng = np.random.default_rng([seed, tile])
        starts = scene.to_unit(subject.draw(rng, n) * scale + place)
        towards = np.ascontiguousarray(directions(rng, n), np.float32)
        if tile % 2:
            return int(np.count_nonzero(scene.intersect(starts, towards).face < 0))
        return int(np.count_nonzero(~scene.occluded(starts, towards)))

    return sum(workers.map_tiles(count, range(-(-rays // TILE))))


def self_hits(subject: Subject, scale: float, offset: float, rays: int, seed: int) -> int:
    """Count the rays that start on a convex mesh, go outward, and are blocked all the same."""
    scene, _ = placed(subject, scale, offset, exact=True)
    normals = scene.normals()

    def count(tile: int) -> int:
        n = min(TILE, rays - tile * TILE)
        rng = np.random.default_rng([seed, tile, 1])
        # From around towards places within: in unit space they are what they are
        starts = 3 * directions(rng, n)
        towards = subject.draw(rng, n) - starts
        hits = scene.intersect(
            np.ascontiguousarray(starts, np.float32), np.ascontiguousarray(towards, np.float32)
        )
        assert np.all(hits.face >= 0)
        normal = normals[hits.face]
        out = directions(rng, len(normal))
        out *= np.where(np.einsum("ij,ij->i", out, normal) < 0, -1, 1)[:, None]
        origins = offset_origins(scene.points(hits), normal)
        return int(scene.occluded(origins, np.ascontiguousarray(out, np.float32)).sum())

    return sum(workers.map_tiles(count, range(-(-rays // TILE))))


def seen(scale: float, offset: float, width: int = 96, height: int = 54) -> Picture:
    """Return the ring, looked at from above and scaled and moved so: its normals as colours."""
    ring = next(one for one in subjects() if one.kind == "ring")
    scene, place = placed(ring, scale, offset, exact=offset >= OFFSETS[-1])
    x = 1.6 * (2 * (np.arange(width) + 0.5) / width - 1)
    z = 1.6 * (2 * (np.arange(height) + 0.5) / height - 1) * height / width * 1.7
    starts = np.stack(np.broadcast_arrays(x[None], 2.0, z[:, None]), axis=-1).reshape(-1, 3)
    down = np.array([[0.0, -0.9, -0.44]], np.float32)
    starts = starts - 2.2 * down
    hits = scene.intersect(scene.to_unit(starts * scale + place), down)
    normals = np.where(hits.face[:, None] >= 0, scene.normals()[np.maximum(hits.face, 0)], -1.0)
    codes = np.rint(255 * (0.5 + 0.5 * normals)).astype(np.uint8)
    return codes.reshape(height, width, 3)


def measure(setting: Setting) -> Answer:
    """Shoot in fifteen settings of scale and place, over all meshes together."""
    rays, starts = setting.pick(30_000, 10_000_000), setting.pick(10_000, 1_000_000)
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    truth = seen(1.0, 0.0)
    for offset in OFFSETS:
        for scale in SCALES:
            row: Row = {"scale": scale, "offset_in_sizes": offset, "rays": 0, "leaks": 0}
            row |= {"starts": 0, "self_hits": 0}
            every, seed = subjects(), 15 * setting.seed + len(rows)
            for one in every:
                share = -(-rays // len(every))
                row["rays"] = int(row["rays"]) + share
                row["leaks"] = int(row["leaks"]) + leaks(one, scale, offset, share, seed)
                if one.kind != "ring":
                    found = self_hits(one, scale, offset, starts // 2, seed)
                    row["starts"] = int(row["starts"]) + starts // 2
                    row["self_hits"] = int(row["self_hits"]) + found
            what = f"size {scale:g} m, {offset:g} sizes away"
            error = interval.share(int(row["leaks"]), int(row["rays"]))
            named = point("closed meshes", what, error, series=f"{offset:g} sizes away")
            rows.append(named | row)
            shots["closed meshes", what] = Shot(seen(scale, offset), truth)
    counted = ("rays", "leaks", "starts", "self_hits")
    total = {name: sum(int(row[name]) for row in rows) for name in counted}
    lines = {
        f"{what.replace('_', '-')}, {offset:g} sizes away": [
            (float(r["scale"]), float(r[what])) for r in rows if r["offset_in_sizes"] == offset
        ]
        for what in ("leaks", "self_hits")
        for offset in OFFSETS
    }
    return Answer(
        question="watertight",
        title=f"{total['leaks']} of {total['rays']:,} rays leave, {total['self_hits']} of "
        f"{total['starts']:,} meet the convex mesh that they start on",
        truth="closed and convex meshes: none",
        rows=rows,
        unit="share of rays that leave a closed mesh",
        axes={"scale": "size of the mesh, metres"},
        titles={"scale": f"{total['leaks']} of {total['rays']:,} rays leave, whatever the size"},
        shots=shots,
        panels=(
            Panel(
                "size of the mesh, metres",
                "rays",
                lines,
                None,
                ("log", "linear"),
                title=f"{total['leaks']} leaks and {total['self_hits']} self-hits at sizes from "
                f"{min(SCALES):g} to {max(SCALES):g} metres",
            ),
        ),
        figures=total,
    )
