"""The same bytes run after run, whatever the threads and the seed of hashes; and how near to them
other kernels of BLAS come, in codes and in what codes show."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from formats.occlusion import Occlusion
from formats.transfer import Layout, codes_of, primitives
from maths.spherical_harmonics import evaluate
from pipelines import relit
from tests.hard_crash.bits import LOADS
from tests.hard_crash.subjects import subjects, tree

Array = NDArray[Any]
ROOT = Path(__file__).resolve().parents[2]
THREADS, SEEDS = (1, 2, 4), ("0", "1", "random")
KERNELS = ("Haswell", "SkylakeX", "Zen", "Sandybridge", "Nehalem", "Prescott")
LIGHT = np.array([1.0, 2.0, 2.0]) / 3


def prove(sources: Path, folder: Path, runs: int) -> dict[str, Any]:
    """Bake all in processes of their own, `runs` times with each number of threads and each seed
    of hashes; return how many differed from the first, by subject."""
    first: dict[str, str] = {}
    count, differ = 0, set()
    for _ in range(runs):
        for threads in THREADS:
            for seed in SEEDS:
                build = folder / "same"
                _baked(sources, build, 1, threads, {"PYTHONHASHSEED": seed})
                found = tree(build)
                first = first or found
                odd = [k for k in first.keys() | found.keys() if first.get(k) != found.get(k)]
                differ |= {f"{threads} threads, seed {seed}: {name}" for name in odd}
                shutil.rmtree(build)
                count += 1
    return {"processes": count, "files": len(first), "wrong": {"files that differ": len(differ)},
            "faults": sorted(differ)[:8]}  # fmt: skip


def kernels(sources: Path, folder: Path, size: int) -> dict[str, Any]:
    """Bake a lumpy and a symmetrical shape with each of BLAS's kernels; return, by subject, texels
    whose codes differ from the first kernel's, by how much at most, and the same of what they show.
    """
    found: dict[str, Any] = {}
    for shape in ("blob", "ball"):
        for kernel in KERNELS:
            build = folder / f"{shape} {kernel}"
            used = _baked(sources, build, size, 0, {"OPENBLAS_CORETYPE": kernel}, shape)
            for place in sorted((build / "scenes").iterdir()):
                first = folder / f"{shape} {KERNELS[0]}" / "scenes" / place.name
                key = f"{place.name} of a {shape}"
                found.setdefault(key, {})[f"{kernel} (ran {used})"] = _differences(first, place)
    return found


def _differences(a: Path, b: Path) -> dict[str, Any]:
    kind = json.loads((a / "report.json").read_bytes())["kind"]
    codes = [_codes(LOADS[kind](folder)) for folder in (a, b)]
    told: dict[str, Any] = _compared(*codes)
    shown = [_shown(kind, folder) for folder in (a, b)]
    if shown[0] is not None:
        told["shown"] = _compared(*([each] for each in shown))
    return told


def _compared(a: list[Array], b: list[Array]) -> dict[str, Any]:
    """Count texels, those where a code differs, and by how much at most."""
    if [each.shape for each in a] != [each.shape for each in b]:
        return {"texels": 1, "differ": 1, "most": 1 << 16}
    gaps = [np.abs(x.astype(np.int64) - y).max(axis=-1).ravel() for x, y in zip(a, b, strict=True)]
    gap = np.concatenate(gaps) if gaps else np.zeros(0, np.int64)
    most = int(gap.max(initial=0))
    return {"texels": gap.size, "differ": int(np.count_nonzero(gap)), "most": most}


def _codes(value: Any) -> list[Array]:
    """All arrays of stored codes, however deep; half floats by their bits."""
    if isinstance(value, np.ndarray):
        stored = value.view(np.uint16) if value.dtype == np.float16 else value
        return [stored] if stored.dtype in (np.uint8, np.uint16) and value.ndim > 1 else []
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = [getattr(value, field.name) for field in dataclasses.fields(value)]
        return [array for field in fields for array in _codes(field)]
    if isinstance(value, dict):
        return [array for item in value.values() for array in _codes(item)]
    if isinstance(value, list | tuple):
        return [array for item in value for array in _codes(item)]
    return []


def _shown(kind: str, folder: Path) -> Array | None:
    """What a sun makes of codes, in 8 bits: a picture, shadows or irradiance; None for others."""
    if kind in ("billboard", "dome"):
        light = relit.parse_light("1,2,2")
        seen = np.asarray(relit.relight(folder, [light]), np.float64)
    elif kind == "occlusion":
        asset = Occlusion.load(folder)
        seen = asset.decoded().astype(np.float64) @ evaluate(LIGHT, asset.l_max)
        seen = seen[..., None] / (np.abs(seen).max() or 1)
    elif kind == "transfer":
        layout = Layout.load(folder)
        parts = [np.concatenate(codes_of(p), axis=1) for p in primitives(folder)]
        vectors = np.concatenate([layout.decoded(part) for part in parts]).astype(np.float64)
        seen = vectors @ evaluate(LIGHT, layout.l_max)
        seen /= np.abs(seen).max() or 1
    else:
        return None
    return np.asarray(np.rint(255 * np.clip(seen, 0, 1) ** (1 / 2.2)), np.int64)


def _baked(
    sources: Path, build: Path, size: int, threads: int, settings: dict[str, str],
    shape: str = "blob",
) -> str:  # fmt: skip
    """Bake everything in a process of its own; return the kernels that it used."""
    command = [sys.executable, "-m", "tests.hard_crash.same_bits", sources, build, size, threads]
    done = subprocess.run(
        [*map(str, command), shape], cwd=ROOT, env=os.environ | settings, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"a bake failed: {done.stderr[-2000:]}")
    return done.stdout.strip()


def _main(sources: Path, build: Path, size: int, threads: int, shape: str) -> None:
    from threadpoolctl import threadpool_info

    workers.use(threads)
    for subject in subjects(sources, size, shape).values():
        if size == 1 or subject.scene is None:
            subject.run(build)
    kernels = {str(each.get("architecture")) for each in threadpool_info()} - {"None"}
    print("/".join(sorted(kernels)))


if __name__ == "__main__":
    _main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]), sys.argv[5])
