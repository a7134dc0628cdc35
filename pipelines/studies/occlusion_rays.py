"""How many rays does a voxel of an occlusion volume need?

Uniform random rays, a Fibonacci sphere that all voxels share, and the cones of the bake, all by the
same Embree. The truth is the bake's own method with 64 times the rays, another spin; what counts is
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
from pipelines.studies.answer import Answer, Panel, Row
from pipelines.studies.subjects import Setting

Array = NDArray[np.float64]
L_MAX, GRID, DEFAULT = 4, 32, 1024
Pattern = Callable[[int, int], Array]


def measure(setting: Setting) -> Answer:
    """Estimate some voxels by three ways of shooting, at several numbers of rays."""
    counts = [128, 256, 512, 1024, 2048][: setting.pick(3, 5)]
    rows: list[Row] = []
    for name, mesh in setting.meshes("knot", "oak").items():
        rows += _rows(name, mesh, counts, setting)
    worst = {
        way: max(float(r[f"of_{way}"]) for r in rows if r["way"] == "cones")
        for way in ("fibonacci", "random")
    }
    return Answer(
        question="occlusion_rays",
        title=f"cones need {worst['fibonacci']:.2f} of the rays of a Fibonacci sphere, "
        f"1/{1 / worst['random']:.0f} of random ones",
        truth="64 times the rays of the finest",
        rows=rows,
        panels=(
            Panel("rays a voxel", "RMS error of a coefficient", _lines(rows), None, ("log", "log")),
        ),
        figures={f"of_{way}": share for way, share in worst.items()},
    )


def _rows(name: str, mesh: Mesh, counts: list[int], setting: Setting) -> list[Row]:
    scene, points, cones, keys = _voxels(mesh, setting.pick(60, 400), setting.seed)
    many = setting.pick(1 << 14, 1 << 16)
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
            error = _rms(_everywhere(scene, points, pattern, count) - truth)
            errors[way].append(error)
            rows.append({"subject": name, "way": way, "rays": count, "rms": error})
    for count in counts:
        found = occlusion_rays.project(scene, points, cones, keys, count, L_MAX)
        used = occlusion_rays.total_of(cones, count) / len(points)
        error = _rms(found.terms - truth)
        row: Row = {"subject": name, "way": "cones", "rays": used, "rms": error}
        row["bar"] = _rms(found.halves)
        for way, measured in errors.items():
            row[f"of_{way}"] = used / _rays_for(error, counts, measured)
        rows.append(row)
    return rows


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
    for n, point in enumerate(points):
        directions = pattern(n, count)
        rays = np.ascontiguousarray(directions, np.float32)
        blocked = scene.occluded(np.repeat(point[None], count, axis=0), rays)
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


def _lines(rows: list[Row]) -> dict[str, list[tuple[float, float]]]:
    lines: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        name = f"{row['subject']}, {row['way']}"
        lines.setdefault(name, []).append((float(row["rays"]), float(row["rms"])))
    return lines


def _rms(values: NDArray[np.floating]) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
