"""Which pattern of rays finds what a mesh hides with the fewest of them?

Independent rays; jittered ones, one in each cell of an equal-area grid; Roberts' R2 sequence and a
Fibonacci sphere that all voxels share; and the cones of the bake, all by the same Embree. What is
asked is binary, whether a ray is stopped. Two subjects are convex, so that their harmonics are
known in closed form: the polygons of their front faces, seen from the voxel, hide it without
overlap. Meshes have rays of their own as truth: R2 with a shift for each voxel, many times as many
as the finest pattern, a sampler that none of the compared ones is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import occlusion, occlusion_inside, occlusion_rays
from bake.rays import RayScene
from formats.mesh import Material, Mesh
from maths import spherical_harmonics
from maths.hashing import uniform01
from maths.sampling import fibonacci_sphere, r2
from maths.spherical_lights import project_polygon
from pipelines.studies.answer import (
    PRICES,
    Answer,
    Panel,
    Picture,
    Row,
    Shot,
    lines_of,
    point,
    slope_of,
)
from pipelines.studies.interval import rms
from pipelines.studies.subjects import Setting

Array = NDArray[np.float64]
TAKES = ("mesh",)
L_MAX, GRID, DEFAULT = 4, 32, 1024
SHOWN = 12  # voxels of a picture
EACH = 1 << 17  # rays at once
RANDOM, CONES = "independent", "cones"
Pattern = Callable[[NDArray[np.int64], int], Array]


@dataclass(frozen=True, eq=False)
class Voxels:
    """Some voxels outside a mesh: points (v, 3) in unit space and exact, cones, numbers."""

    scene: RayScene
    points: NDArray[np.float32]
    exact: Array
    cones: occlusion_rays.Cones
    keys: NDArray[np.int64]


def measure(setting: Setting) -> Answer:
    """Estimate some voxels by every pattern, at several numbers of rays."""
    counts = [64, 256, 1024] if setting.quick else [64, 128, 256, 512, 1024, 2048, 4096]
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in subjects(setting).items():
        rows += _rows(name, mesh, counts, setting, shots)
    slopes = {
        way: float(
            np.mean([slope_of(line) for line in lines_of(own, "rays", "rms", "subject").values()])
        )
        for way in dict.fromkeys(str(r["way"]) for r in rows)
        for own in [[r for r in rows if r["way"] == way]]
    }
    shares = {way: worst(rows, way) for way in slopes if way != CONES}
    best = min((way for way in shares if way != RANDOM), key=lambda way: -shares[way])
    structured = max(slope for way, slope in slopes.items() if way != RANDOM)
    least, most = min(counts), max(counts)
    return Answer(
        question="sampling_pattern",
        title=f"Cones need {shares[best]:.2f} of the rays of the next best pattern ({best}) and "
        f"1/{1 / shares[RANDOM]:.0f} of independent ones; errors fall as rays^{slopes[CONES]:.2f} "
        f"against rays^{slopes[RANDOM]:.2f}",
        truth="closed forms of convex meshes; for others R2 rays of each voxel's own, "
        f"{times_of(setting)} times the finest",
        rows=rows,
        unit="RMS error of a coefficient",
        axes={"rays": "rays a voxel", "bake_seconds": PRICES["bake_seconds"]},
        titles={
            "rays": f"At equal error cones need {shares[best]:.2f} of the rays of {best}, "
            f"1/{1 / shares[RANDOM]:.0f} of independent ones"
        },
        shots=shots,
        panels=(
            Panel(
                "rays a voxel",
                "RMS error of a coefficient",
                lines_of(rows, "rays", "rms", "subject", "way"),
                None,
                ("log", "log"),
                slopes=True,
                title=f"From {least:,} to {most:,} rays independent ones converge as "
                f"rays^{slopes[RANDOM]:.2f}, structured ones as rays^{structured:.2f} or faster",
            ),
        ),
        figures={"slopes": slopes, "share_of_rays": shares},
    )


def subjects(setting: Setting) -> dict[str, Mesh]:
    """Return convex meshes in closed form, then others; or the user's own."""
    own = setting.meshes("knot", "oak")
    if setting.source is not None:
        return own
    return {"box": box(), **({} if setting.quick else {"gem": gem()}), **own}


def times_of(setting: Setting) -> int:
    """Return how many times the rays of the finest the truth of a mesh has."""
    return setting.pick(16, 32)


def worst(rows: list[Row], way: str) -> float:
    """Return the largest share of a pattern's rays that cones need for the same error."""
    return max(float(r[f"of_{way}"]) for r in rows if r["way"] == CONES)


def _rows(
    name: str,
    mesh: Mesh,
    counts: list[int],
    setting: Setting,
    shots: dict[tuple[str, str], Shot],
) -> list[Row]:
    found = voxels(mesh, setting.pick(48, 160), setting.seed)
    if convex(mesh):
        truth = silhouettes(mesh, found)
    else:
        truth = everywhere(found, shifted, times_of(setting) * counts[-1])
    errors: dict[str, list[float]] = {}
    rows: list[Row] = []
    for way, pattern in PATTERNS.items():
        for count in counts:
            started = process_time()
            made = everywhere(found, pattern, count)
            row = _point(name, way, count, made - truth, process_time() - started)
            shots[name, str(row["setting"])] = Shot(_skies(made), _skies(truth))
            errors.setdefault(way, []).append(float(row["rms"]))
            rows.append(row | {"rays": count})
    for count in counts:
        started = process_time()
        terms = occlusion_rays.project(
            found.scene, found.points, found.cones, found.keys, count, L_MAX
        ).terms
        spent = process_time() - started
        used = occlusion_rays.total_of(found.cones, count) / len(found.points)
        row = _point(name, CONES, count, terms - truth, spent)
        row |= {"rays": used, "default": int(count == DEFAULT)}
        shots[name, str(row["setting"])] = Shot(_skies(terms), _skies(truth))
        for way, measured in errors.items():
            row[f"of_{way}"] = used / rays_for(float(row["rms"]), counts, measured)
        rows.append(row)
    return rows


def _point(
    name: str, way: str, count: int, apart: NDArray[np.floating[Any]], seconds: float
) -> Row:
    """Return a measurement; apart : errors (n, K) of coefficients, a voxel each."""
    squares = np.mean(np.square(apart, dtype=np.float64), axis=1)
    what = f"{way}, {count} rays"
    row = point(name, what, rms(squares), series=way, bake_seconds=seconds)
    return row | {"way": way, "rms": float(np.sqrt(squares.mean()))}


# patterns of directions (v or 1, count, 3) for voxels of numbers (v,)


def independent(keys: NDArray[np.int64], count: int) -> Array:
    """Return uniform directions, each by itself."""
    u = uniform01(keys[:, None], np.arange(2 * count)[None, :], 0xA5)
    return on_sphere(u[:, :count], u[:, count:])


def jittered(keys: NDArray[np.int64], count: int) -> Array:
    """Return one direction in each cell of a grid of equal areas, twice as wide as high."""
    high = max(1, round((count / 2) ** 0.5))
    wide = max(1, count // high)
    u = uniform01(keys[:, None], np.arange(2 * high * wide)[None, :], 0x51)
    i, j = (n.ravel() for n in np.meshgrid(np.arange(high), np.arange(wide), indexing="ij"))
    return on_sphere((i + u[:, : high * wide]) / high, (j + u[:, high * wide :]) / wide)


def sequence(keys: NDArray[np.int64], count: int) -> Array:
    """Return the first points of R2, the same for all."""
    u = r2(np.arange(count))
    return on_sphere(u[None, :, 0], u[None, :, 1])


def shifted(keys: NDArray[np.int64], count: int) -> Array:
    """Return R2 with a shift of each voxel's own."""
    shift = np.stack([uniform01(keys, k) for k in (0x71, 0x72)], axis=-1)
    u = r2(np.arange(count)[None, :], shift[:, None, :])
    return on_sphere(u[..., 0], u[..., 1])


def spiral(keys: NDArray[np.int64], count: int) -> Array:
    """Return a Fibonacci sphere, the same for all."""
    return fibonacci_sphere(count)[None]


def on_sphere(height: Array, turn: Array) -> Array:
    """Map the unit square to the sphere, keeping areas: (..., 3)."""
    z, phi = 1 - 2 * np.asarray(height), 2 * np.pi * np.asarray(turn)
    r = np.sqrt(np.maximum(1 - z * z, 0))
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


PATTERNS: dict[str, Pattern] = {
    RANDOM: independent,
    "jittered": jittered,
    "R2": sequence,
    "fibonacci": spiral,
}


# truths


def convex(mesh: Mesh) -> bool:
    """Say whether a mesh is convex: all its corners lie behind each of its few faces."""
    if len(mesh.faces) > 256:
        return False
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    before = np.einsum("fi,fvi->fv", normal, mesh.vertices[None] - a[:, None])
    return bool(before.max() < 1e-9 * np.ptp(mesh.vertices))


def silhouettes(mesh: Mesh, found: Voxels) -> Array:
    """Return the harmonics (v, K) that a convex mesh hides: those of its faces as lights of
    radiance 1, of which only the front ones shine."""
    corners = (mesh.vertices[mesh.faces] - found.scene.centre) * found.scene.scale
    each = project_polygon(found.exact[:, None], corners[None], np.ones(3), L_MAX)
    return np.asarray(each[..., 0].sum(axis=1))


def everywhere(found: Voxels, pattern: Pattern, count: int) -> Array:
    """Estimate by rays all around, weights 4 pi / rays: the slow and obvious way."""
    terms = np.zeros((len(found.points), (L_MAX + 1) ** 2))
    step = max(1, EACH // count)
    for first in range(0, len(terms), step):
        own = slice(first, first + step)
        directions = pattern(found.keys[own], count)
        n = directions.shape[1]
        starts = np.repeat(found.points[own], n, axis=0)
        rays = np.broadcast_to(directions, (len(found.points[own]), n, 3)).reshape(-1, 3)
        stopped = found.scene.occluded(starts, np.ascontiguousarray(rays, np.float32))
        Y = spherical_harmonics.evaluate(directions, L_MAX)
        hidden = stopped.reshape(-1, n).astype(np.float64)
        # The shared ones have one Y for all voxels
        same = len(Y) == 1
        sums = hidden @ Y[0] if same else np.einsum("vn,vnk->vk", hidden, Y)
        terms[own] = 4 * np.pi / n * sums
    return terms


def voxels(mesh: Mesh, count: int, seed: int) -> Voxels:
    """Draw some voxels outside a mesh."""
    vertices = mesh.vertices[np.unique(mesh.faces)]
    box, low, high = occlusion.box_of(vertices)
    scene = RayScene(mesh.vertices, mesh.faces)
    drawn = np.random.default_rng(seed).permutation(GRID**3)[: 2 * count]
    exact = (box.voxel_centres(GRID)[drawn] - scene.centre) * scene.scale
    points = exact.astype(np.float32)
    oriented = occlusion_inside.is_oriented(mesh.vertices, mesh.faces)
    outside = ~occlusion_inside.inside(scene, points, oriented=oriented)
    exact, points, keys = exact[outside][:count], points[outside][:count], drawn[outside][:count]
    low, high = (scene.to_unit(c).astype(np.float64) for c in (low, high))
    corners = scene.to_unit(vertices).astype(np.float64)
    radius = float(np.linalg.norm(corners - (low + high) / 2, axis=1).max())
    return Voxels(scene, points, exact, occlusion_rays.cones(exact, low, high, radius), keys)


def rays_for(error: float, counts: list[int], errors: list[float]) -> float:
    """Return how many rays reach an error, by the straight line through logarithms."""
    slope, start = np.polyfit(np.log(errors), np.log(counts), 1)
    return float(np.exp(start + slope * np.log(error)))


def box() -> Mesh:
    """Return a box of 12 faces, turned out of all axes."""
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], np.float64)
    return hull(corners * [0.5, 0.8, 0.3])


def gem() -> Mesh:
    """Return the hull of 24 points of a Fibonacci sphere, stretched."""
    return hull(fibonacci_sphere(24) * [0.6, 0.9, 0.5])


def hull(corners: Array) -> Mesh:
    """Return the convex hull of points (n, 3), turned, its faces seen from outside."""
    from scipy.spatial import ConvexHull

    turned = corners @ np.linalg.qr(np.array([[2.0, 1, 0.5], [-1, 2, 0.7], [0.3, -0.4, 2]]))[0]
    faces = ConvexHull(turned).simplices
    a, b, c = (turned[faces[:, i]] for i in range(3))
    away = np.einsum("fi,fi->f", np.cross(b - a, c - a), a - turned.mean(axis=0))
    faces = np.where(away[:, None] < 0, faces[:, ::-1], faces).astype(np.int64)
    a, b, c = (turned[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Mesh(
        vertices=turned,
        faces=faces,
        normals=np.repeat(normal[:, None], 3, axis=1).astype(np.float32),
        material=np.zeros(len(faces), np.int32),
        materials=(Material("clay", (0.7, 0.7, 0.7)),),
    )


def _skies(terms: NDArray[np.floating[Any]]) -> Picture:
    """Return what some voxels see of an even sky, by their harmonics: 4 x 3 maps of all
    directions, up on top, white where nothing is in the way."""
    y, x = np.mgrid[:16, :32]
    polar, turn = np.pi * (y + 0.5) / 16, 2 * np.pi * (x + 0.5) / 32
    directions = np.stack(
        [np.sin(polar) * np.cos(turn), np.cos(polar), np.sin(polar) * np.sin(turn)], axis=-1
    )
    Y = spherical_harmonics.evaluate(directions, L_MAX)
    seen = np.clip(1 - np.einsum("nk,hwk->nhw", terms[:SHOWN], Y), 0, 1)
    sheet = np.pad(seen, ((0, 0), (1, 1), (1, 1)), constant_values=0.2)
    rows = [np.concatenate(list(sheet[a : a + 3]), axis=1) for a in range(0, len(sheet) - 2, 3)]
    codes = np.rint(255 * np.concatenate(rows)).astype(np.uint8)
    return np.repeat(codes[..., None], 3, axis=2)
