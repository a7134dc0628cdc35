"""Which directions a mesh hides from the points around it, as harmonics in a volume.

Points inside the solid are found first and cost no rays; they are filled from outside, so that a
lookup between voxels does not bleed black. Every ray is an occlusion ray of Embree into the cone
that can hit. As an occlusion is 0 or 1, its square integrates to its own mean: what the band limit
leaves out is known without more rays, and with `adaptive` a voxel stops once its sampling error is
small beside it.

Memory: 32 bytes a coefficient and voxel at the peak (26 MB for 32^3 and l_max 4), 2 MB a thread,
and the mesh with its tree.

References
----------
Sloan, Kautz, Snyder 2002, Precomputed Radiance Transfer for Real-Time Rendering in Dynamic,
Low-Frequency Lighting Environments, section 5 (neighbourhood transfer).
Green 2003, Spherical Harmonic Lighting: The Gritty Details (visibility by rays).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bake import occlusion_bars, occlusion_inside, occlusion_proof, occlusion_rays, workers
from bake.rays import RayScene
from formats.errors import InputError
from formats.mesh import Mesh
from formats.occlusion import Box, OcclusionHarmonics
from maths import intervals

Array = NDArray[np.float64]
Float = NDArray[np.float32]

THINNEST = 0.25  # of the longest half-extent
SMALLEST, LARGEST = 1e-30, 1e30  # longest half-extent, metres: the player computes in float32
MAX_VALUES = 1 << 27  # voxels times coefficients: 512 MB
THIN = 0.02  # share of the surface that is worth a note
ROUND = 4  # times as many rays in each round of the adaptive mode


@dataclass(frozen=True)
class Params:
    """Knobs. grid : voxels a side.  l_max : highest band.  rays : a voxel that sees the mesh all
    around; smaller cones get fewer.  adaptive : 0, or stop a voxel where its sampling error is this
    share of its truncation error.  proof : voxels whose shadows are traced on their own, for the
    report."""

    grid: int = 32
    l_max: int = 4
    rays: int = 1024
    adaptive: float = 0.0
    proof: int = 128

    def check(self) -> None:
        """Raise InputError for the first knob out of its range."""
        ranges = {
            "grid": (2, 256),
            "l_max": (0, 10),
            "rays": ((self.l_max + 1) ** 2, 1 << 16),
            "adaptive": (0, 1),
            "proof": (0, 4096),
        }
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError("occlusion", name, value, f"choose from {low} to {high}")
        values = self.grid**3 * (self.l_max + 1) ** 2
        if values > MAX_VALUES:
            remedy = f"voxels times coefficients are at most {MAX_VALUES}: lower grid or l_max"
            raise InputError("occlusion", "grid", self.grid, remedy)


def trace(
    mesh: Mesh, *, params: Params, progress: workers.Progress = workers.silent
) -> OcclusionHarmonics:
    """Trace the volume around a mesh. InputError for knobs out of range and unusable meshes."""
    params.check()
    vertices, faces, dropped = _solid(mesh.checked())
    # Refuse a box that the player could not hold before building the tree
    box_of(vertices)
    scene = RayScene(vertices, faces)
    found = around(scene, vertices, faces, params=params, progress=progress)
    notes = [*mesh.notes, *_notes(found, params.grid)]
    told = {"faces_without_area": dropped, "notes": notes}
    return replace(found, quality=found.quality | told)


def around(
    scene: RayScene,
    vertices: Array,
    faces: NDArray[np.int64],
    *,
    params: Params,
    progress: workers.Progress = workers.silent,
    seed: int = 0,
) -> OcclusionHarmonics:
    """Trace the volume around a scene of these vertices (n, 3), all in use, and faces (m, 3).

    seed : of the rays' turns, for those who bake more than once.
    """
    box, low, high = box_of(vertices)
    low, high = (scene.to_unit(corner).astype(np.float64) for corner in (low, high))
    exact = (box.voxel_centres(params.grid) - scene.centre) * scene.scale
    points = exact.astype(np.float32)
    # Find the solid; it lies within the bounding box
    oriented = occlusion_inside.is_oriented(vertices, faces)
    inside = np.all((exact > low) & (exact < high), axis=1)
    inside[inside] = occlusion_inside.inside(scene, points[inside], oriented=oriented)
    outside = np.flatnonzero(~inside)
    if not len(outside):
        raise InputError("mesh", "faces", len(faces), "no voxel lies outside: raise grid")
    corners = scene.to_unit(vertices).astype(np.float64)
    radius = float(np.linalg.norm(corners - (low + high) / 2, axis=1).max())
    cones = occlusion_rays.cones(exact[outside], low, high, radius)
    places = _Places(points[outside], cones, outside, outside + seed * inside.size)
    found = _estimate(scene, places, params, progress)
    K, shape = (params.l_max + 1) ** 2, (params.grid,) * 3
    terms, spread = np.zeros((inside.size, K), np.float32), np.zeros(inside.size, np.float32)
    terms[outside] = found.terms
    spread[outside] = np.sqrt(found.told)
    hole = inside.reshape(shape)
    volume = occlusion_inside.filled(terms.reshape(*shape, K), hole)
    proof = occlusion_proof.trace(scene, points, outside, params.proof, params.l_max)
    sizes = 2 * np.arange(params.l_max + 1) + 1
    pitch = 4 * np.asarray(box.half_extent) * scene.scale / params.grid
    quality = {
        "rays": found.rays,
        "inside_share": float(np.mean(inside)),
        "oriented": oriented,
        "inverted": occlusion_inside.is_inverted(vertices, faces),
        "thin_share": occlusion_inside.thin_share(scene, pitch, oriented=oriented),
        "sampling_error": float(np.sqrt(occlusion_bars.over_bands(found.bands[None])[0])),
        "coverage_factor": intervals.coverage_factor(),
        "truncation_error": _rms(truncation(found.terms)) / K**0.5,
        "coefficients_rms": _rms(found.terms),
    }
    return OcclusionHarmonics(
        terms=volume,
        inside=hole,
        spread=spread.reshape(shape),
        error=np.repeat(np.sqrt(found.bands), sizes).astype(np.float32),
        box=box,
        proof_voxels=proof.voxels,
        proof_lights=proof.lights,
        proof_shadow=proof.shadow,
        proof_radii=occlusion_proof.RADII,
        quality=quality,
    )


def _notes(found: OcclusionHarmonics, grid: int) -> list[str]:
    """Return what a user should know of the mesh."""
    notes, thin = [], found.quality["thin_share"]
    if thin > THIN:
        pitch = 4 * max(found.box.half_extent) / grid
        notes.append(
            f"{thin:.0%} of the surface is sheets or walls thinner than a voxel ({pitch:.3g} m): "
            "beside them shadows of both sides mix; a finer grid narrows that"
        )
    if found.quality["inverted"]:
        notes.append("the mesh is inside out (its signed volume is negative): turn its faces round")
    return notes


def box_of(vertices: Array) -> tuple[Box, Array, Array]:
    """Return the box of a volume about vertices (n, 3), and the corners of the bounding box.

    InputError where the vertices lie at one place, or the box is too large or small for float32.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre, half = low / 2 + high / 2, high / 2 - low / 2
    longest = float(half.max())
    if not SMALLEST <= longest <= LARGEST or np.abs(centre).max() > LARGEST:
        remedy = f"scale the mesh to between {SMALLEST:g} and {LARGEST:g} m"
        raise InputError("mesh", "half_extent", longest, remedy)
    x, y, z = (float(v) for v in np.maximum(half, THINNEST * longest))
    return Box((float(centre[0]), float(centre[1]), float(centre[2])), (x, y, z)), low, high


def truncation(terms: Float) -> Float:
    """Return (v,) RMS over the sphere, times sqrt(4 pi), of what bands above l_max would add.

    terms : (v, K). An occlusion o is 0 or 1, so the integral of o^2 is that of o, 2 sqrt(pi) c0,
    and what the coefficients keep of it is the sum of their squares (Parseval).
    """
    whole = 2 * np.sqrt(np.float32(np.pi)) * terms[:, 0]
    return np.asarray(np.sqrt(np.maximum(whole - np.sum(np.square(terms), axis=1), 0)))


@dataclass(frozen=True)
class _Places:
    """Voxels to trace. points : (v, 3) unit space.  voxels : (v,) flat indices.  keys : (v,) what
    their random turns hang on."""

    points: Float
    cones: occlusion_rays.Cones
    voxels: NDArray[np.int64]
    keys: NDArray[np.int64]

    def pick(self, which: NDArray[np.int64]) -> _Places:
        """Return some of them."""
        cones = self.cones.pick(which)
        return _Places(self.points[which], cones, self.voxels[which], self.keys[which])


@dataclass(frozen=True)
class _Found:
    """terms : (v, K).  told : (v,) variance of a coefficient, mean over all.  bands :
    (l_max + 1,) the same by bands, mean over voxels.  rays : that were cast."""

    terms: Float
    told: Array
    bands: Array
    rays: int


def _estimate(
    scene: RayScene, places: _Places, params: Params, progress: workers.Progress
) -> _Found:
    """Trace all voxels, in rounds of more and more rays where the mode is adaptive."""
    l_max, rounds = params.l_max, [params.rays]
    while params.adaptive and rounds[0] // ROUND >= max(
        4 * (l_max + 1) ** 2, 2 * occlusion_rays.FEWEST
    ):
        rounds.insert(0, rounds[0] // ROUND)
    count = len(places.voxels)
    terms, told = np.zeros((count, (l_max + 1) ** 2), np.float32), np.zeros(count)
    bands, active, total = np.zeros((count, l_max + 1)), np.arange(count), 0
    for n, rays in enumerate(rounds):
        own = places.pick(active)
        asked = scene, own.points, own.cones, own.keys, rays
        watch = workers.silent if len(rounds) > 1 else progress
        found = occlusion_rays.project(*asked, l_max, watch)
        again = occlusion_bars.again(*asked, found)
        total += occlusion_rays.total_of(own.cones, rays) + again.rays
        terms[active] = found.terms
        bands[active] = occlusion_bars.variances(found.apart, again.scale)
        each = occlusion_bars.told(found.apart, again, own.voxels, params.grid)
        told[active] = each
        if n + 1 == len(rounds):
            break
        error = np.sqrt(each * (l_max + 1) ** 2)
        active = active[error > params.adaptive * truncation(found.terms)]
        progress((n + 1) / len(rounds))
        if not len(active):
            break
    return _Found(terms, told, bands.mean(axis=0), total)


def _solid(mesh: Mesh) -> tuple[Array, NDArray[np.int64], int]:
    """Return the vertices in use and the faces that have an area; how many have none."""
    if not len(mesh.faces):
        raise InputError("mesh", "faces", 0, "give a mesh with faces")
    first = mesh.vertices[mesh.faces[0, 0]]
    size = float(np.abs(mesh.vertices[mesh.faces] - first).max())
    a, b, c = ((mesh.vertices[mesh.faces[:, i]] - first) / (size or 1.0) for i in range(3))
    solid = np.any(np.cross(b - a, c - a) != 0, axis=1)
    if not solid.any():
        raise InputError("mesh", "faces", 0, "give a mesh whose faces have area")
    used, faces = np.unique(mesh.faces[solid], return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int64)
    return mesh.vertices[used], faces, int(np.count_nonzero(~solid))


def _rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
