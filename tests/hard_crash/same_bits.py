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
from tests.hard_crash.tally import Note, silent

Array = NDArray[Any]
ROOT = Path(__file__).resolve().parents[2]
THREADS, SEEDS = (1, 2, 4), ("0", "1", "random")
DIFFER = "files that differ"
KERNELS = ("Haswell", "SkylakeX", "Zen", "Sandybridge", "Nehalem", "Prescott")
LIGHT = np.array([1.0, 2.0, 2.0]) / 3


def prove(
    sources: Path, folder: Path, runs: int, size: int, begin: int = 0, note: Note = silent
) -> dict[str, Any]:
    """Bake all in processes of their own, `runs` times with each number of threads and each seed
    of hashes; return how many files differed from those of one thread.

    size : of pictures, so that there are tiles enough for four threads.
    """
    trials = [(t, s) for _ in range(runs) for t in THREADS for s in SEEDS]
    build = folder / "same"

    def baked(threads: int, seed: str) -> dict[str, str]:
        settings = {"PYTHONHASHSEED": seed, "OPENBLAS_NUM_THREADS": str(threads)}
        _baked(sources, build, size, threads, settings, scenes=True)
        found = tree(build)
        shutil.rmtree(build)
        return found

    first = baked(THREADS[0], SEEDS[0])
    kinds = sorted({Path(name).parts[1] for name in first if name.startswith("scenes/")})
    result: dict[str, Any] = {"processes": 0, "kinds": ", ".join(kinds)}
    result |= {"wrong": {DIFFER: 0}, "of": {DIFFER: 0}, "faults": []}
    for number, (threads, seed) in enumerate(trials[begin:], begin):
        found = baked(threads, seed)
        odd = sorted(k for k in first.keys() | found.keys() if first.get(k) != found.get(k))
        result["processes"] += 1
        result["of"][DIFFER] += len(first)
        result["wrong"][DIFFER] += len(odd)
        result["faults"] += [f"{threads} threads, seed {seed}: {name}" for name in odd[:2]]
        note(number + 1, result)
    return result


def kernels(sources: Path, folder: Path, size: int) -> dict[str, Any]:
    """Bake a lumpy and a symmetrical shape with each of BLAS's kernels that runs here; return, by
    subject, texels whose codes differ from the first kernel's, by how much at most, and the same of
    what they show."""
    found: dict[str, Any] = {}
    for shape in ("blob", "ball"):
        first: Path | None = None
        ran: set[str] = set()
        for kernel in KERNELS:
            build = folder / f"{shape} {kernel}"
            settings = {"OPENBLAS_CORETYPE": kernel}
            if (used := _kernel(settings)) in ran:
                continue
            ran.add(used)
            _baked(sources, build, size, 0, settings, shape)
            for place in sorted((build / "scenes").iterdir()):
                key = f"{place.name} of a {shape}"
                known = build if first is None else first
                told = _differences(known / "scenes" / place.name, place)
                found.setdefault(key, {})[used] = told
            first = first or build
    return found


def _kernel(settings: dict[str, str]) -> str:
    """Return what OpenBLAS runs with these settings: another kernel than asked for, where this
    processor cannot run that one."""
    code = "import numpy, threadpoolctl as t; print(*{str(i.get('architecture')) "
    code += "for i in t.threadpool_info()} - {'None'})"
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | settings, text=True, capture_output=True,
        check=True,
    )  # fmt: skip
    return done.stdout.strip()


def _differences(a: Path, b: Path) -> dict[str, Any]:
    kind = json.loads((a / "report.json").read_bytes())["kind"]
    codes = [_codes(LOADS[kind](folder)) for folder in (a, b)]
    told: dict[str, Any] = _compared(*codes) if any(codes) else _files(a, b)
    shown = [_shown(kind, folder) for folder in (a, b)]
    if shown[0] is not None:
        told["shown"] = _compared(*([each] for each in shown))
    return told


def _compared(a: list[Array], b: list[Array]) -> dict[str, Any]:
    """Count texels, those where a code differs, and by how much at most."""
    if [each.shape for each in a] != [each.shape for each in b]:
        return {"texels": 1, "differ": 1, "most": 1 << 16}
    gaps = [np.abs(x - y).max(axis=-1).ravel() for x, y in zip(a, b, strict=True)]
    gap = np.concatenate(gaps) if gaps else np.zeros(0, np.int64)
    most = int(gap.max(initial=0))
    return {"texels": gap.size, "differ": int(np.count_nonzero(gap)), "most": most}


def _files(a: Path, b: Path) -> dict[str, Any]:
    """The same of files without texels, such as a mesh, by their bytes; reports are left out."""
    trees = [{k: v for k, v in tree(each).items() if not k.endswith(".json")} for each in (a, b)]
    differ = sum(trees[0].get(k) != trees[1].get(k) for k in trees[0].keys() | trees[1].keys())
    return {"files": True, "texels": len(trees[0]), "differ": differ, "most": differ << 16}


def _codes(value: Any) -> list[Array]:
    """All arrays of stored codes, however deep, as int64; half floats as the number of their step
    from 0, and what was stored as such and is read as float32."""
    if isinstance(value, np.ndarray):
        if value.ndim < 2 or value.size == 0:
            return []
        if value.dtype == np.float32 and value.ndim > 2:
            with np.errstate(over="ignore"):
                half = value.astype(np.float16)
            value = half if np.array_equal(half, value) else value
        if value.dtype == np.float16:
            bits = value.view(np.int16).astype(np.int64)
            return [np.where(bits < 0, -(bits & 0x7FFF), bits)]
        return [value.astype(np.int64)] if value.dtype in (np.uint8, np.uint16) else []
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
    shape: str = "blob", scenes: bool = False,
) -> None:  # fmt: skip
    """Bake everything in a process of its own; a whole scene only where asked for."""
    command = [sys.executable, "-m", "tests.hard_crash.same_bits", sources, build, size, threads]
    done = subprocess.run(
        [*map(str, command), shape, str(scenes)], cwd=ROOT, env=os.environ | settings, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"a bake failed: {done.stderr[-2000:]}")


def _main(sources: str, build: str, size: str, threads: str, shape: str, scenes: str) -> None:
    workers.use(int(threads))
    for subject in subjects(Path(sources), int(size), shape).values():
        if subject.scene is None or scenes == "True":
            subject.run(Path(build))


if __name__ == "__main__":
    _main(*sys.argv[1:])
