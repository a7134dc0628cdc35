"""What each vertex of a mesh makes of light from every direction: precomputed radiance transfer.

A vertex's vector T holds the harmonics of what turns the light around into its irradiance, E = T.L:

    unshadowed       T = A_l Y(n), the clamped cosine in closed form
    shadowed         less what Embree's rays find hidden: pi times the mean of Y over hidden rays
    interreflected   plus, bounce by bounce, albedo times the vectors at the points that they meet

so that only what is hidden is estimated, and a convex mesh is exact. The vertex's own albedo stays
out of it: textures keep their detail. Other meshes, the ground and what the mesh itself emits have
no part in it, and light that falls through thin sheets has none either; each side of a
double-sided face has vertices of its own.

Memory: 80 bytes a vertex and coefficient at the peak, and 48 bytes a ray that meets the mesh where
there are bounces.

References
----------
Sloan, Kautz, Snyder 2002, Precomputed Radiance Transfer for Real-Time Rendering in Dynamic,
Low-Frequency Lighting Environments, sections 4.1 and 5.
Ramamoorthi, Hanrahan 2001, On the relationship between radiance and irradiance (A_l).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import mesh as meshes
from bake import subdivision, transfer_bars, transfer_gather, transfer_mesh, transfer_rays, workers
from bake.rays import RayScene
from bake.tiles import kept
from bake.transfer_rays import Pattern, Starts
from formats import transfer as kind
from formats.errors import InputError
from formats.mesh import Mesh
from formats.occlusion import encode
from formats.transfer import Layout, Transfer
from maths import intervals, sampling, spherical_harmonics, spherical_projection
from maths.principal_components import principal_components

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

MODES = ("unshadowed", "shadowed", "interreflected")
MAX_VALUES = 1 << 27  # vertices times coefficients times channels: 512 MB
SALT = 3


@dataclass(frozen=True)
class Params:
    """Knobs. mode : one of MODES.  l_max : highest band.  rays : a vertex.  bounces : of light
    from the mesh to itself.  edge : longest edge, as a share of the longest side of the bounding
    box; longer ones are halved, 0 leaves all as they are.  components : numbers a vertex, in fours.
    depth : bits of each, 8 or 16."""

    mode: str = "interreflected"
    l_max: int = 4
    rays: int = 256
    bounces: int = 2
    edge: float = 0.03125
    components: int = 24
    depth: int = 8

    def check(self) -> None:
        """Raise InputError for the first knob out of its range."""
        if self.mode not in MODES:
            raise InputError("transfer", "mode", self.mode, f"choose one of {', '.join(MODES)}")
        ranges = {
            "l_max": (0, 10),
            "rays": (2, 1 << 16),
            "bounces": (1, 64),
            "components": (1, 4 * kind.MOST_VOLUMES),
        }
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError("transfer", name, value, f"choose from {low} to {high}")
        if self.edge != 0 and not 1e-4 <= self.edge <= 1:
            raise InputError("transfer", "edge", self.edge, "choose 0, or from 0.0001 to 1")
        if self.depth not in (8, 16):
            raise InputError("transfer", "depth", self.depth, "choose 8 or 16")


@dataclass(frozen=True)
class Found:
    """Vectors (n, C, K) float32 in the order of a mesh's vertices, and how they came about. error :
    standard error of a coefficient, RMS over all.  hidden : share of an even sky."""

    vectors: Float
    error: float = 0.0
    hidden: float = 0.0
    rays: int = 0


def trace(mesh: Mesh, *, params: Params, progress: workers.Progress = workers.silent) -> Transfer:
    """Bake a mesh's transfer. InputError for knobs out of range and unusable meshes."""
    params.check()
    ready = meshes.prepare(mesh, params=meshes.Params())
    used = ready.vertices[np.unique(ready.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    if params.edge:
        ready = subdivision.subdivide(ready, params.edge * float((high - low).max()))
    single = transfer_mesh.split(ready)
    whole = transfer_mesh.two_sided(single)
    channels = 3 if params.mode == "interreflected" else 1
    if len(whole.vertices) * channels * (params.l_max + 1) ** 2 > MAX_VALUES:
        remedy = "lower l_max, raise edge, or use a coarser mesh"
        raise InputError("transfer", "vertices", len(whole.vertices), remedy)
    found = vectors(single, whole, params, progress)
    codes, layout, quality = pack(found.vectors, params, np.stack([low, high]))
    told = {
        "mode": params.mode,
        "bounces": params.bounces if channels == 3 else 0,
        "rays": found.rays,
        "sampling_error": found.error,
        "coverage_factor": intervals.coverage_factor(),
        "hidden_share": found.hidden,
        "faces_in": len(mesh.faces),
        **quality,
    }
    return Transfer(whole, codes, layout, told)


def vectors(
    single: Mesh, whole: Mesh, params: Params, progress: workers.Progress, *, seed: int = 0
) -> Found:
    """Return the transfer vectors of `whole`: a mesh whose vertices have one normal each, and whose
    first faces are those of `single`.

    seed : of the rays' spins, for those who bake more than once.
    """
    normals = transfer_mesh.normals_of(whole)
    clear = spherical_projection.clamped_cosine(normals, params.l_max).astype(np.float32)
    if params.mode == "unshadowed":
        return Found(clear[:, None])
    scene = RayScene(single.vertices, single.faces)
    shape = transfer_rays.pattern(params.rays, params.l_max)
    count, which = len(normals), transfer_bars.chosen(len(normals))
    lit = params.mode == "interreflected"
    # Some are traced again, with other spins
    tracers = [
        _Tracer(
            scene,
            single,
            whole,
            _starts(scene, single, whole, normals, 2 * seed + number),
            shape,
            params.l_max,
            bounces=lit,
        )
        for number in (0, 1)
    ]
    done = tracers[0].all(np.arange(count), progress)
    again = tracers[1].all(which, workers.silent)
    lost = np.concatenate([tile.lost for tile in done])
    # A constant light of 1: what is hidden of pi
    hidden = float(np.mean(lost[:, 0], dtype=np.float64) * 2 / np.sqrt(np.pi))
    first = np.concatenate([clear - lost, clear[which]])
    first[count:] -= np.concatenate([tile.lost for tile in again])
    vectors = first[:, None]
    if lit:
        seen = [transfer_gather.matrices(tile.seen, count) for tile in (*done, *again)]
        vectors = transfer_gather.bounced(first, seen, params.bounces)
    apart, apart_again = (np.concatenate([tile.apart for tile in tiles]) for tiles in (done, again))
    error = transfer_bars.error(vectors[which], vectors[count:], apart, apart_again, which)
    return Found(vectors[:count], error, hidden, (count + len(which)) * params.rays)


@dataclass(frozen=True)
class _Tile:
    """lost : (v, K).  apart : (v, l_max + 1), by how much halves of the rays differ.  seen : arrays
    of three sparse matrices (v, n), one a channel, that turn irradiance at vertices into what the
    tile's vertices receive after one bounce."""

    lost: Float
    apart: Float
    seen: tuple[NDArray[Any], ...]


@dataclass(frozen=True)
class _Tracer:
    scene: RayScene
    single: Mesh
    whole: Mesh
    starts: Starts
    shape: Pattern
    l_max: int
    bounces: bool

    def all(self, vertices: Indices, progress: workers.Progress) -> list[_Tile]:
        """Trace the rays of vertices, some at a time."""
        step = max(1, transfer_rays.TILE // len(self.shape.directions))
        tiles = [vertices[a : a + step] for a in range(0, len(vertices), step)]
        return kept(self.tile, tiles, progress, (_Tile,))

    def tile(self, vertices: Indices) -> _Tile:
        """Trace the rays of some vertices."""
        origins, directions = transfer_rays.rays_of(self.starts, self.shape, vertices)
        if not self.bounces:
            blocked = self.scene.occluded(origins, directions, finite=True)
            seen: tuple[NDArray[Any], ...] = ()
        else:
            hits = self.scene.intersect(origins, directions, finite=True)
            blocked = hits.face >= 0
            seen = transfer_gather.arrays(
                transfer_gather.gathered(
                    self.scene, self.single, self.whole, hits, directions, len(vertices)
                )
            )
        lost, apart = transfer_rays.hidden(self.starts, self.shape, vertices, blocked, self.l_max)
        return _Tile(np.ascontiguousarray(lost.T), apart, seen)


def pack(vectors: Float, params: Params, box: Array) -> tuple[NDArray[Any], Layout, dict[str, Any]]:
    """Choose components, uncentred, and quantise. Returns codes (n, 4 P), layout and quality."""
    n, C, K = vectors.shape
    flat = vectors.reshape(n, C * K)
    count = min(params.components, C * K)
    found = principal_components(flat, count)
    scores = np.zeros((n, 4 * -(-count // 4)), np.float32)
    # Summed in double precision: codes must not depend on the kernel of BLAS
    scores[:, :count] = flat.astype(np.float64) @ found.vectors.T
    scales = np.abs(scores).max(axis=0)
    values = np.asarray(scores / np.where(scales > 0, scales, 1), np.float32)
    codes = encode(values, params.depth)
    layout = Layout(scales, found.vectors.reshape(count, C, K), box, params.depth)
    size = float(np.sqrt(np.mean(np.square(flat, dtype=np.float64))))
    quality = {
        "vectors_rms": size,
        "component_loss": found.residual,
        "irradiance_rms": irradiance_rms(vectors, codes, layout),
        "bytes": int(codes.nbytes),
        "warnings": list(found.warnings),
    }
    return codes, layout, quality


def irradiance_rms(vectors: Float, codes: NDArray[Any], layout: Layout) -> float:
    """RMS over vertices of what components and codes change in the irradiance of far points of
    light all around, as a share of what each gives a surface that faces it."""
    toward = spherical_harmonics.evaluate(sampling.fibonacci_sphere(64), layout.l_max)
    change = (layout.decoded(codes) - vectors) @ toward.T.astype(np.float32)
    return float(np.sqrt(np.mean(np.square(change, dtype=np.float64))))


def _starts(scene: RayScene, single: Mesh, whole: Mesh, normals: Float, number: int) -> Starts:
    """Return where rays start; those of twins start behind."""
    if len(whole.faces) > len(single.faces):
        scene = RayScene(whole.vertices, whole.faces)
    return transfer_rays.starts_of(scene, whole.faces, normals, len(normals), SALT, number)
