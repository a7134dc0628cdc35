"""How many rays does a voxel of an occlusion volume need?

The volume is traced with more and more rays a voxel and stored as the talk does and in bands. The
truth is rays of the points' own; so what is left with many rays is what bands, grid and codes cost,
and from where the error no longer falls, rays are wasted.
"""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np

from bake import compress, occlusion, workers
from bake.rays import RayScene
from formats.mesh import Mesh
from pipelines.studies import occlusion_knob
from pipelines.studies.answer import PRICES, Answer, Row, Shot
from pipelines.studies.occlusion_encodings import TALK, benches
from pipelines.studies.occlusion_knob import BANDS, SLACK
from pipelines.studies.subjects import Setting

TAKES = ("mesh",)
COUNTS = (64, 128, 256, 512, 1024, 2048, 4096)
QUICK = (64, 256, 1024)
DEFAULT = occlusion.Params().rays
KINDS = {"16 numbers": (TALK, 4), "bands, 512 KiB": (BANDS, 7)}


def measure(setting: Setting) -> Answer:
    """Bake with more and more rays."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    counts = QUICK if setting.quick else COUNTS
    grid = setting.pick(20, 32)
    for bench in benches(setting, "bust", "mushrooms", "knot"):
        for kind, (params, l_max) in KINDS.items():
            for rays in counts:
                row = bench.shipped("rays", params, rays=rays, l_max=l_max, grid=grid)
                what = f"{kind}, {rays:,} rays"
                shots[bench.name, what] = bench.shots[bench.name, str(row["setting"])]
                default = rays == DEFAULT and kind == "16 numbers"
                rows.append(occlusion_knob.marked(row, kind, what, default))
    least = {kind: occlusion_knob.enough(rows, "rays", kind) for kind in KINDS}
    most = max(counts)
    errors = {
        kind: [occlusion_knob.mean_error(rows, "rays", n, kind) for n in (least[kind], most)]
        for kind in KINDS
    }
    told = " and ".join(f"{n:,} rays for {kind}" for kind, n in least.items())
    finest = {kind: least[kind] < most for kind in KINDS}
    beyond = "beyond, truncation dominates" if all(finest.values()) else "fewer are felt"
    first, second = KINDS
    return occlusion_knob.answered(
        "occlusion_rays",
        f"{told}: {beyond} (the errors are {errors[first][0]:.3f} and "
        f"{errors[second][0]:.3f}, with {most:,} rays {errors[first][1]:.3f} and "
        f"{errors[second][1]:.3f})",
        rows,
        axes={"rays": "rays a voxel", "bake_seconds": PRICES["bake_seconds"]},
        titles={"rays": f"From {told} on, more rays change less than {SLACK:.0%} of the error"},
        shots=shots,
        panels=tuple(
            occlusion_knob.by_light(
                rows, "rays", "rays a voxel", kind,
                f"{kind}: from {least[kind]:,} rays on the error stays within {SLACK:.0%} of what "
                f"{most:,} reach",
                float(DEFAULT),
            )
            for kind in KINDS
        ),
        figures={"enough": least, "errors": errors},
    )  # fmt: skip


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
