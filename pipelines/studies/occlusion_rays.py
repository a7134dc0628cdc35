"""How many rays does a voxel of an occlusion volume need?

Uniform random rays, a Fibonacci sphere that all voxels share, and the cones of the bake, all by the
same Embree. The truth is the bake's own method with 32 times the rays, another spin; what counts is
the RMS error of the coefficients over voxels outside the solid, per ray that is cast.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import compress, occlusion, occlusion_inside, occlusion_rays, workers
from bake.rays import RayScene
from formats.mesh import Mesh
from maths import spherical_harmonics
from maths.sampling import fibonacci_sphere
from pipelines.studies.answer import PRICES, Answer, Panel, Picture, Row, Shot, lines_of, point
from pipelines.studies.interval import rms
from pipelines.studies.subjects import Setting

Array = NDArray[np.float64]
TAKES = ("mesh",)
L_MAX, GRID, DEFAULT = 4, 32, 1024
SHOWN = 12  # voxels of a picture
Pattern = Callable[[int, int], Array]


def measure(setting: Setting) -> Answer:
    """Estimate some voxels by three ways of shooting, at several numbers of rays."""
    counts = [128, 512, 1024] if setting.quick else [128, 256, 512, 1024, 2048]
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in setting.meshes("knot", "oak").items():
        rows += _rows(name, mesh, counts, setting, shots)
    worst = {
        way: max(float(r[f"of_{way}"]) for r in rows if r["way"] == "cones")
        for way in ("fibonacci", "random")
    }
    return Answer(
        question="occlusion_rays",
        title=f"Cones need {worst['fibonacci']:.2f} of the rays of a Fibonacci sphere, "
        f"1/{1 / worst['random']:.0f} of random ones",
        truth=f"{times_of(setting)} times the rays of the finest, turned otherwise",
        rows=rows,
        unit="RMS error of a coefficient",
        axes={"rays": "rays a voxel", "bake_seconds": PRICES["bake_seconds"]},
        shots=shots,
        panels=(
            Panel(
                "rays a voxel",
                "RMS error of a coefficient",
                lines_of(rows, "rays", "rms", "subject", "way"),
                None,
                ("log", "log"),
                slopes=True,
            ),
        ),
        figures={f"of_{way}": share for way, share in worst.items()},
    )


def times_of(setting: Setting) -> int:
    """Return how many times the rays of the finest the truth has."""
    return setting.pick(16, 32)


def _rows(
    name: str,
    mesh: Mesh,
    counts: list[int],
    setting: Setting,
    shots: dict[tuple[str, str], Shot],
) -> list[Row]:
    scene, points, cones, keys = _voxels(mesh, setting.pick(60, 400), setting.seed)
    many = times_of(setting) * counts[-1]
    truth = occlusion_rays.project(scene, points, cones, keys, many, L_MAX).terms
    rng = np.random.default_rng(setting.seed + 1)

    def random(_: int, count: int) -> Array:
        vectors = rng.normal(size=(count, 3))
        return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))

    ways: dict[str, Pattern] = {"fibonacci": lambda _, n: fibonacci_sphere(n), "random": random}
    errors: dict[str, list[float]] = {way: [] for way in ways}
    rows: list[Row] = []
    for way, pattern in ways.items():
        for count in counts:
            started = process_time()
            made = _everywhere(scene, points, pattern, count)
            row = _point(name, way, count, made - truth, process_time() - started)
            shots[name, str(row["setting"])] = Shot(_skies(made), _skies(truth))
            errors[way].append(float(row["rms"]))
            rows.append(row | {"rays": count})
    for count in counts:
        started = process_time()
        found = occlusion_rays.project(scene, points, cones, keys, count, L_MAX)
        spent = process_time() - started
        used = occlusion_rays.total_of(cones, count) / len(points)
        row = _point(name, "cones", count, found.terms - truth, spent)
        row |= {"rays": used, "bar": _rms(found.halves), "default": int(count == DEFAULT)}
        shots[name, str(row["setting"])] = Shot(_skies(found.terms), _skies(truth))
        for way, measured in errors.items():
            row[f"of_{way}"] = used / _rays_for(float(row["rms"]), counts, measured)
        rows.append(row)
    return rows


def _point(
    name: str, way: str, count: int, apart: NDArray[np.floating[Any]], seconds: float
) -> Row:
    """Return a measurement; apart : errors (n, K) of coefficients, a voxel each."""
    squares = np.mean(np.square(apart, dtype=np.float64), axis=1)
    what = f"{way}, {count} rays"
    row = point(name, what, rms(squares), series=way, bake_seconds=seconds)
    return row | {"way": way, "rms": _rms(apart)}


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


def _voxels(
    mesh: Mesh, count: int, seed: int
) -> tuple[RayScene, NDArray[np.float32], occlusion_rays.Cones, NDArray[np.int64]]:
    """Return some voxels outside a mesh in unit space, with their cones and numbers."""
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
    return scene, points, occlusion_rays.cones(exact, low, high, radius), keys


def _everywhere(
    scene: RayScene, points: NDArray[np.float32], pattern: Pattern, count: int
) -> Array:
    """Estimate by rays all around, weights 4 pi / count: the slow and obvious way."""
    found = np.zeros((len(points), (L_MAX + 1) ** 2))
    for n, place in enumerate(points):
        directions = pattern(n, count)
        rays = np.ascontiguousarray(directions, np.float32)
        blocked = scene.occluded(np.repeat(place[None], count, axis=0), rays)
        Y = spherical_harmonics.evaluate(directions, L_MAX)
        found[n] = 4 * np.pi / count * (blocked @ Y)
    return found


def _rays_for(error: float, counts: list[int], errors: list[float]) -> float:
    """Return how many rays reach an error, by the straight line through logarithms."""
    slope, start = np.polyfit(np.log(errors), np.log(counts), 1)
    return float(np.exp(start + slope * np.log(error)))


def overhead(mesh: Mesh, params: occlusion.Params, repeats: int = 5) -> dict[str, float]:
    """Compare a whole bake with its own Embree calls on ready-made arrays, one thread, interleaved.

    Returns the medians: seconds of the processor for `whole`, `calls` and `build` of the tree, and
    `ratio`, whole / (calls + build). Holds 24 bytes a ray.
    """
    kept: list[tuple[Any, ...]] = []

    class Recorded(RayScene):
        embree: Any

        def run(self, *arrays: Any, **query: Any) -> Any:
            kept.append((*(array.copy() for array in arrays), query))
            return self.embree.run(*arrays, **query)

    used, faces = np.unique(mesh.faces, return_inverse=True)
    vertices, faces = mesh.vertices[used], faces.reshape(-1, 3).astype(np.int64)
    before = workers.count()
    workers.use(1)
    try:
        scene = Recorded(vertices, faces)
        scene.embree, scene._scene = scene._scene, scene
        occlusion.around(scene, vertices, faces, params=params)
        spent: dict[str, list[float]] = {"whole": [], "calls": [], "build": []}
        for _ in range(repeats):
            start = process_time()
            compress.compress(occlusion.trace(mesh, params=params), params=compress.Params())
            middle = process_time()
            for origins, directions, query in kept:
                scene.embree.run(origins, directions, **query)
            end = process_time()
            RayScene(vertices, faces)
            spent["whole"].append(middle - start)
            spent["calls"].append(end - middle)
            spent["build"].append(process_time() - end)
    finally:
        workers.use(before)
    found = {name: float(np.median(times)) for name, times in spent.items()}
    rays = float(sum(len(origins) for origins, *_ in kept))
    return {**found, "ratio": found["whole"] / (found["calls"] + found["build"]), "rays": rays}


def _rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
