"""What a mesh that lights itself costs: rays, bands and numbers a vertex, against traced lamps.

The error is that of the irradiance that vertices get from far round lamps of `DEGREES`, RMS over
vertices and lamps, as a share of what each lamp gives a surface that faces it. Truth are rays of
their own at some vertices: what they see of each lamp, and, where light bounces, what they gather
of it from the mesh. How finely the mesh is cut into vertices is another question.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bake import mesh as meshes
from bake import subdivision, transfer_gather, transfer_mesh, transfer_rays, workers
from bake import transfer as stage
from bake.rays import RayScene
from formats import transfer as kind
from formats.mesh import Mesh
from formats.occlusion import decode, encode
from maths import price as laws
from maths import spherical_harmonics, spherical_projection
from maths.hashing import pcg
from maths.price import Estimate
from maths.sampling import fibonacci_sphere, random_rotation
from pipelines import bake_sprites, price

if TYPE_CHECKING:
    from bake.recipe import Entry
    from bake.store import Store

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

CHOSEN = ("rays", "l_max", "components")
DEGREES = 20.0
QUANTITY = (
    f"irradiance from far lamps of {DEGREES:g} degrees, RMS over vertices, as a share of what each "
    "gives a surface that faces it"
)
POWER = 0.75  # of cosine-spread rays on what is hidden or not
FEW, MANY, TRUTH = 32, 128, 2048  # rays a vertex
ROUGH = 16  # rays a vertex of all: light that bounces is a mean over many of them
VERTICES = 128
LAMPS = 24
BANDS = (2, 3, 4, 6)
MOST_BAND = 6
MOST_RAYS = 1 << 14
RAYS_SHARE = 0.25  # of the time of many rays at least, where the clock tells less
SALT = 71  # of the truth's spins; the bake has another


@dataclass(frozen=True)
class _Scene:
    """A mesh made ready as the bake does."""

    single: Mesh
    whole: Mesh
    normals: Float
    scene: RayScene
    outer: RayScene

    def starts(self, salt: int) -> transfer_rays.Starts:
        """Return where rays start, with spins of this salt."""
        count = len(self.normals)
        return transfer_rays.starts_of(self.outer, self.whole.faces, self.normals, count, salt)


class TransferAsset:
    """A mesh's transfer by price; params : knobs that stay as they are, but for those free."""

    def __init__(self, source: Path, params: stage.Params, free: tuple[str, ...] = CHOSEN) -> None:
        self.source, self.params, self.free = source, params, free
        self.name = str(source)
        self._whole: Mesh | None = None
        self._vertices: Indices = np.zeros(0, np.int64)
        self._truth: Array = np.zeros((0, LAMPS, 1))

    def probe(self, clock: price.Clock) -> price.Prices:
        """Trace some vertices with few rays and with many, and all of them roughly."""
        begun = clock()
        mesh = bake_sprites.mesh_source(self.source).load()
        ready = _ready(mesh, self.params)
        self._whole = ready.whole
        start = clock() - begun
        count = len(ready.normals)
        lit = self.params.mode == "interreflected"
        rough = replace(self.params, l_max=4, rays=ROUGH, bounces=max(1, self.params.bounces - 1))
        if self.params.bounces == 1 and lit:
            rough = replace(rough, mode="shadowed")
        found, all_seconds = price.timed(
            lambda: stage.vectors(ready.single, ready.whole, rough, lambda _: None), clock
        )
        order = np.argsort(pcg(np.arange(count), SALT), kind="stable")
        self._vertices = np.sort(order[:VERTICES])
        self._truth = _truth(ready, self._vertices, found.vectors if lit else None)
        runs, seconds = [], []
        for rays in (FEW, MANY):
            other, spent = price.timed(
                partial(_some, ready, self._vertices, rays, found.vectors if lit else None),
                clock,
            )
            runs.append(other)
            seconds.append(spent)
        # Of all vertices, with few rays; what more rays cost, of some vertices
        ray = max((seconds[1] - seconds[0]) / (MANY - FEW), seconds[1] / MANY * RAYS_SHARE)
        ray /= len(self._vertices)
        points = []
        for l_max in self._bands():
            K = (l_max + 1) ** 2
            parts = [run[..., :K].reshape(len(run), -1) for run in runs]
            vectors = _components(parts[1])
            for components in self._counts(K * self._truth.shape[2]):
                errors = [
                    self._error(self._packed(part, vectors[:components], K), l_max).value
                    for part in parts
                ]
                law = laws.fitted([FEW, MANY], errors, POWER)
                growth = count * self._truth.shape[2] * K * 6e-8
                tier = max(0, -(-components // 4) - -(-self.params.components // 4))
                for rays in self._rays():
                    spent = start + all_seconds + ray * count * (rays - ROUGH) + growth
                    knobs = {"rays": rays, "l_max": l_max, "components": components}
                    size = count * 4 * -(-components // 4) * self.params.depth // 8
                    points.append(
                        price.Point(knobs, law.error(rays), max(spent, start), size, tier)
                    )
        return price.Prices(QUANTITY, tuple(points), clock() - begun)

    def bake(self, store: Store, knobs: dict[str, Any], watch: price.Watch | None) -> Entry:
        """Trace and pack."""
        given = bake_sprites.mesh_source(self.source)
        return store.run(
            stage.trace, given, params=replace(self.params, **knobs), on_progress=watch
        )

    def reached(self, store: Store, knobs: dict[str, Any]) -> Estimate:
        """Light the vertices of the truth by what is stored."""
        if self._whole is None:
            self.probe(lambda: 0.0)
        assert self._whole is not None
        folder = self.bake(store, knobs, None).path
        vectors = _stored(folder, self._whole)[self._vertices]
        return self._error(vectors, knobs["l_max"])

    def _error(self, vectors: Float, l_max: int) -> Estimate:
        """Return the error of vectors (v, C, K)."""
        made = np.einsum("vck,mk->vmc", vectors, _lamps(l_max))
        squares = np.mean(np.square(made - self._truth), axis=(1, 2))
        return laws.relative_rms(squares, np.ones_like(squares))

    def _packed(self, vectors: Float, components: Float, K: int) -> Float:
        """Return vectors (v, C K) as components and codes leave them, as (v, C, K)."""
        scores = vectors @ components.T
        scales = np.maximum(np.abs(scores).max(axis=0), 1e-30)
        codes = encode(np.asarray(scores / scales, np.float32), self.params.depth)
        stored = (decode(codes) * scales) @ components
        return np.asarray(stored.reshape(len(vectors), -1, K), np.float32)

    def _bands(self) -> tuple[int, ...]:
        return BANDS if "l_max" in self.free else (self.params.l_max,)

    def _counts(self, values: int) -> tuple[int, ...]:
        given = self.params.components
        if "components" not in self.free:
            return (given,)
        return tuple(sorted({min(c, values) for c in (given, 32) if c >= given}))

    def _rays(self) -> tuple[int, ...]:
        return price.ladder(16, MOST_RAYS) if "rays" in self.free else (self.params.rays,)


def _ready(mesh: Mesh, params: stage.Params) -> _Scene:
    ready = meshes.prepare(mesh, params=meshes.Params())
    used = ready.vertices[np.unique(ready.faces)]
    if params.edge:
        longest = float((used.max(axis=0) - used.min(axis=0)).max())
        ready = subdivision.subdivide(ready, params.edge * longest)
    single = transfer_mesh.split(ready)
    whole = transfer_mesh.two_sided(single)
    scene = RayScene(single.vertices, single.faces)
    outer = RayScene(whole.vertices, whole.faces) if len(whole.faces) > len(single.faces) else scene
    return _Scene(single, whole, transfer_mesh.normals_of(whole), scene, outer)


def _some(ready: _Scene, vertices: Indices, rays: int, others: Float | None) -> Float:
    """Return vectors (v, C, K) of some vertices, to MOST_BAND. others : (n, C, k), what those that
    their rays meet make of light; None without bounces."""
    shape, starts = transfer_rays.pattern(rays, MOST_BAND), ready.starts(stage.SALT)

    def tile(own: Indices) -> Float:
        clear = spherical_projection.clamped_cosine(ready.normals[own], MOST_BAND)
        origins, directions = transfer_rays.rays_of(starts, shape, own)
        if others is None:
            blocked = ready.scene.occluded(origins, directions, finite=True)
            lost = transfer_rays.hidden(starts, shape, own, blocked, MOST_BAND)[0]
            return np.asarray(clear - lost.T, np.float32)[:, None]
        hits = ready.scene.intersect(origins, directions, finite=True)
        lost = transfer_rays.hidden(starts, shape, own, hits.face >= 0, MOST_BAND)[0]
        first = np.asarray(clear - lost.T, np.float32)[:, None]
        return first + _bounced(ready, hits, directions, len(own), others, first.shape[2])

    step = max(1, min(-(-len(vertices) // 4), transfer_rays.TILE // rays))
    tiles = [vertices[a : a + step] for a in range(0, len(vertices), step)]
    return np.concatenate(workers.map_tiles(tile, tiles))


def _bounced(
    ready: _Scene, hits: Any, directions: Float, count: int, others: Float, K: int
) -> Float:
    """Return what some vertices gather of the others' light: (v, C, K), higher bands 0."""
    seen = transfer_gather.gathered(ready.scene, ready.single, ready.whole, hits, directions, count)
    found = np.zeros((count, 3, K), np.float32)
    for channel in range(3):
        own = others[:, min(channel, others.shape[1] - 1)]
        found[:, channel, : own.shape[1]] = seen[channel] @ own
    return found


def _truth(ready: _Scene, vertices: Indices, others: Float | None) -> Array:
    """Return the irradiance (v, LAMPS, C) of some vertices, as a share of a facing one's."""
    shape, starts = transfer_rays.pattern(TRUTH, 0), ready.starts(SALT)
    origins, directions = transfer_rays.rays_of(starts, shape, vertices)
    hits = ready.scene.intersect(origins, directions, finite=True)
    free = (hits.face < 0).reshape(TRUTH, -1)
    toward, least = directions.reshape(TRUTH, -1, 3), np.cos(np.radians(DEGREES))
    # Rays have density cos / pi; a lamp that faces the vertex has the share sin^2 of them
    whole = TRUTH * np.sin(np.radians(DEGREES)) ** 2
    direct = np.stack(
        [np.sum(free & (toward @ c >= least), axis=0) / whole for c in _centres()], axis=1
    )
    if others is None:
        return np.asarray(direct[..., None], np.float64)
    bounced = _bounced(ready, hits, directions, len(vertices), others, others.shape[2])
    l_max = round(others.shape[2] ** 0.5) - 1
    return np.asarray(direct[..., None] + np.einsum("vck,mk->vmc", bounced, _lamps(l_max)))


def _centres() -> Float:
    return fibonacci_sphere(LAMPS, random_rotation(SALT)).astype(np.float32)


@lru_cache(maxsize=16)
def _lamps(l_max: int) -> Array:
    """Return the lamps' coefficients (LAMPS, K), whose irradiance on a facing surface is 1."""
    dense = fibonacci_sphere(1 << 14)
    member = _centres() @ dense.T >= np.cos(np.radians(DEGREES))
    Y = spherical_harmonics.evaluate(dense, l_max)
    share = 4 * np.pi / len(dense) / (np.pi * np.sin(np.radians(DEGREES)) ** 2)
    return np.asarray(share * (member.astype(np.float64) @ Y))


def _stored(folder: Path, whole: Mesh) -> Float:
    """Return the vectors (n, C, K) that a baked folder holds for the vertices of its mesh."""
    layout, found = kind.Layout.load(folder), np.zeros(0, np.float32)
    numbers = np.unique(whole.material).tolist()
    for number, part in zip(numbers, kind.primitives(folder), strict=True):
        vertex = np.unique(whole.faces[whole.material == number])
        codes = np.concatenate(kind.codes_of(part), axis=1)
        vectors = layout.decoded(codes.view(np.float16) if layout.depth == 16 else codes)
        if not found.size:
            found = np.zeros((len(whole.vertices), *vectors.shape[1:]), np.float32)
        found[vertex] = vectors
    return found


def _components(rows: Float) -> Float:
    """Return the principal components of few, long rows (n, p), best first: (min(n, p), p)."""
    energy, mixed = np.linalg.eigh(rows @ rows.T.astype(np.float64))
    order = np.argsort(-energy)[: min(rows.shape)]
    vectors = mixed[:, order].T @ rows / np.sqrt(np.maximum(energy[order], 1e-20))[:, None]
    return np.asarray(vectors, np.float32)
