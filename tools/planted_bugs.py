"""Tests of the tests: plant one known mistake at a time and see that the suite catches it.

    .venv/bin/python tools/planted_bugs.py [WORDS ...] [--list] [--json]

Each mistake is one that this field makes: an exact piece of text of a file, what it becomes, and
the test files that must fail then. The checkout is copied to a temporary folder; the checkout
itself stays as it is. Ends with 1 where a mistake is not caught, or where its text is gone.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("maths", "formats", "bake", "runtime", "pipelines", "tests", "assets", "docs", "tools")
LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc")
PATIENCE = 600  # seconds that one run of tests may take


@dataclass(frozen=True)
class Mistake:
    """name : what it is. file : where. old, new : text, which stands in the file exactly once.
    tests : files of which at least one test must fail."""

    name: str
    file: str
    old: str
    new: str
    tests: str


MISTAKES = (
    # numbers
    Mistake(
        "Gram matrix in single precision",
        "maths/principal_components.py",
        "gram += block.T @ block",
        "gram += block.astype(np.float32).T @ block.astype(np.float32)",
        "tests/maths/test_principal_components.py",
    ),
    Mistake(
        "squared condition trusted too far",
        "maths/principal_components.py",
        "TRUSTED = 1e5",
        "TRUSTED = 1e12",
        "tests/maths/test_principal_components.py",
    ),
    Mistake(
        "signs of components left to the library",
        "maths/principal_components.py",
        "_signed(Vt[:kept])",
        "Vt[:kept]",
        "tests/maths/test_principal_components.py",
    ),
    Mistake(
        "no centring of a scene before Embree",
        "bake/rays.py",
        "moved = (np.asarray(points, np.float64) - self.centre) * self.scale",
        "moved = np.asarray(points, np.float64) * self.scale",
        "tests/bake/test_rays.py",
    ),
    Mistake(
        "Embree in its fast mode",
        "bake/rays.py",
        "EmbreeScene(robust=True)",
        "EmbreeScene(robust=False)",
        "tests/bake/test_rays.py tests/bake/test_watertight.py",
    ),
    Mistake(
        "no offset of rays from their surface",
        "bake/rays.py",
        "return np.where(np.abs(points) < np.float32(1 / 32), near, far)",
        "return points",
        "tests/bake/test_rays.py",
    ),
    Mistake(
        "rays of the wrong length reach Embree",
        "bake/rays.py",
        "        check_rays(origins, directions, finite=finite)\n        found =",
        "        found =",
        "tests/bake/test_rays.py",
    ),
    # harmonics
    Mistake(
        "wrong sign of m",
        "maths/spherical_harmonics.py",
        "values[centre - m] = q * imaginary",
        "values[centre - m] = -q * imaginary",
        "tests/maths/test_spherical_harmonics.py",
    ),
    Mistake(
        "Condon-Shortley phase",
        "maths/spherical_harmonics.py",
        "            values[centre + m] = q * real",
        "            values[centre + m] = (-1) ** m * q * real",
        "tests/maths/test_spherical_harmonics.py",
    ),
    Mistake(
        "order of sine and cosine of the circle",
        "maths/circular_basis.py",
        "basis[..., 1::2] = np.sin(angles) / np.sqrt(np.pi)",
        "basis[..., 1::2] = np.cos(angles) / np.sqrt(np.pi)",
        "tests/maths/test_circular_basis.py",
    ),
    Mistake(
        "clamp before the sum of terms",
        "maths/circular_basis.py",
        'total = np.einsum("...kc,...kc->...c", transfer, np.asarray(L, np.float64))',
        "total = np.maximum(0.0, transfer * np.asarray(L, np.float64)).sum(axis=-2)",
        "tests/maths/test_circular_basis.py",
    ),
    Mistake(
        "left and right hand of the axis up",
        "maths/circular_lights.py",
        '"up": lambda d: (d[..., 0], -d[..., 2], d[..., 1]),',
        '"up": lambda d: (d[..., 0], d[..., 2], d[..., 1]),',
        "tests/maths/test_circular_lights.py",
    ),
    Mistake(
        "smoothness that also penalises the constant",
        "maths/hemispherical_harmonics.py",
        "return np.asarray(np.square(band * (band + 1)) / top)",
        "return np.asarray(np.square(band * (band + 1) + 1) / top)",
        "tests/maths/test_hemispherical_harmonics.py",
    ),
    # codes
    Mistake(
        "truncating quantiser",
        "maths/sprite_packing.py",
        "np.floor(unit * 127 + 128.5)",
        "np.floor(unit * 127 + 128)",
        "tests/maths/test_sprite_packing.py",
    ),
    Mistake(
        "codes without an exact zero",
        "maths/sprite_packing.py",
        "np.floor(unit * 127 + 128.5)",
        "np.floor(unit * 127.5 + 128)",
        "tests/maths/test_sprite_packing.py",
    ),
    Mistake(
        "swapped BC1 endpoints",
        "maths/bc1.py",
        "swapped = (a > b) if steps == 2 else (a < b)",
        "swapped = (a < b) if steps == 2 else (a > b)",
        "tests/maths/test_bc1.py",
    ),
    Mistake(
        "indices not exchanged with the endpoints",
        "maths/bc1.py",
        "levels = np.where(swapped, steps - levels, levels)",
        "levels = np.asarray(levels)",
        "tests/maths/test_bc1.py",
    ),
    Mistake(
        "sRGB taken for linear",
        "maths/colour.py",
        "return np.where(c <= 0.04045, c / 12.92, "
        "((np.maximum(c, 0.04045) + 0.055) / 1.055) ** 2.4)",
        "return c",
        "tests/maths/test_colour.py",
    ),
    Mistake(
        "sRGB linear part left out on the card",
        "runtime/glsl/colour.glsl",
        "return mix(curve, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));",
        "return curve;",
        "tests/agreement/test_libraries.py",
    ),
    Mistake(
        "picture upside down",
        "runtime/player.py",
        "return data.reshape(height, width, 4)[::-1].copy()",
        "return data.reshape(height, width, 4).copy()",
        "tests/runtime/test_player.py tests/runtime/passes",
    ),
    Mistake(
        "palette off by one",
        "formats/files/vox.py",
        "order = self.shown.astype(np.intp)",
        "order = np.roll(self.shown.astype(np.intp), 1)",
        "tests/formats/test_vox_palette.py tests/formats/test_vox.py",
    ),
    Mistake(
        "OpenEXR given arrays that are not contiguous",
        "formats/files/exr.py",
        "stored = np.ascontiguousarray(pixels, np.float16 if half else np.float32)",
        "stored = pixels.astype(np.float16 if half else np.float32, copy=False)",
        "tests/formats/test_exr.py tests/formats/test_codec_battery.py",
    ),
    # lens and mips
    Mistake(
        "half a circle of confusion",
        "maths/optics.py",
        "aperture = f / number",
        "aperture = f / (2 * number)",
        "tests/maths/test_optics.py",
    ),
    Mistake(
        "level of the lens added to the hardware's own",
        "runtime/passes/billboard.frag",
        "level = max(level, lod(",
        "level = (level + lod(",
        "tests/runtime/passes/test_billboard.py tests/runtime/passes/test_depth_of_field.py",
    ),
    Mistake(
        "mip levels without an empty border",
        "bake/mips.py",
        "levels.append(_bordered(_filtered(",
        "levels.append((_filtered(",
        "tests/bake/test_mips.py",
    ),
    # light
    Mistake(
        "no share of pi in a bounce",
        "runtime/passes/gather_send.frag",
        "sent = vec4(albedo * light * 0.3183098861837907, 1.0);",
        "sent = vec4(albedo * light, 1.0);",
        "tests/runtime/test_gather.py",
    ),
    Mistake(
        "weights of light sampling that do not sum to one",
        "bake/lightmap_rays.py",
        "weight = cosine / (count * (cosine / np.pi + density))",
        "weight = cosine / (count * density)",
        "tests/bake/test_lightmap_truth.py tests/bake/test_lightmap.py",
    ),
    Mistake(
        "alias table that gives its rest to nobody",
        "maths/alias_table.py",
        "stay[high] -= 1 - stay[low]",
        "stay[high] -= 0.99 * (1 - stay[low])",
        "tests/maths/test_alias_table.py",
    ),
    Mistake(
        "rays slip between cells that touch by an edge",
        "maths/voxel_traversal.py",
        "here[k, axis] = np.where(ahead[k, axis], wall[k, axis], wall[k, axis] - 1)",
        "here = np.where(times <= now[:, None], np.where(ahead, wall, wall - 1), here)",
        "tests/maths/test_voxel_traversal.py",
    ),
    Mistake(
        "bloom that adds light",
        "maths/bloom.py",
        "return np.asarray(found / found.sum())",
        "return np.asarray(found / found[-1])",
        "tests/maths/test_bloom.py",
    ),
    Mistake(
        "grain with a mean",
        "maths/grain.py",
        "MIDDLE = 4 * 255 / 2",
        "MIDDLE = 4 * 256 / 2",
        "tests/maths/test_grain.py",
    ),
    Mistake(
        "hash of the thread instead of the sample",
        "maths/hashing.py",
        "state = np.zeros((), np.uint32)\n    # Wrap",
        "import threading\n\n"
        "    state = np.uint64(threading.get_ident()).astype(np.uint32)\n    # Wrap",
        "tests/maths/test_hashing.py",
    ),
    Mistake(
        "a loop of keys that jumps",
        "maths/keyframes.py",
        "at = at - np.floor((at - when[0]) / period) * period if self.loop else at",
        "at = np.mod(at, when[-1]) if self.loop else at",
        "tests/maths/test_keyframes.py",
    ),
    Mistake(
        "decibels of the square root twice",
        "maths/image_error.py",
        "20.0 * math.log10(peak / error)",
        "10.0 * math.log10(peak / error)",
        "tests/maths/test_image_error.py",
    ),
    # files and the store
    Mistake(
        "no fsync before the rename",
        "formats/files/atomic.py",
        "        _flush(temporary, os.O_RDWR)\n",
        "",
        "tests/formats/test_atomic.py",
    ),
    Mistake(
        "no fsync of the folder after the rename",
        "formats/files/atomic.py",
        "        _flush(path.parent, os.O_RDONLY)\n",
        "",
        "tests/formats/test_atomic.py",
    ),
    Mistake(
        "version of the libraries left out of the key",
        "bake/recipe.py",
        '"libraries": machine.versions({lib for each in closures for lib in each.libraries}),',
        '"libraries": {},',
        "tests/bake/test_recipe.py tests/bake/test_store_rebuilds.py",
    ),
    Mistake(
        "code of a stage left out of the key",
        "bake/recipe.py",
        '"code": closures[0].code,',
        '"code": "",',
        "tests/bake/test_recipe.py tests/bake/test_store_rebuilds.py",
    ),
    Mistake(
        "bytes served without a look at their seal",
        "formats/seal.py",
        "        if found[field] != entry[field]:",
        "        if field == 'bytes' and found[field] != entry[field]:",
        "tests/formats/test_seal.py",
    ),
    Mistake(
        "a scene that reads outside of its folder",
        "formats/schema.py",
        "    if not found.is_relative_to(root):",
        "    if False:",
        "tests/formats/test_scene.py tests/formats/test_schema.py",
    ),
)


def main() -> int:
    """Plant, run, report; 0 where every mistake is caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("words", nargs="*", help="only mistakes whose names hold one of these")
    parser.add_argument("--list", action="store_true", help="print the names and end")
    parser.add_argument("--json", action="store_true", help="print the results as data")
    given = parser.parse_args()
    chosen = [m for m in MISTAKES if not given.words or any(w in m.name for w in given.words)]
    if given.list:
        print("\n".join(m.name for m in chosen))
        return 0
    with tempfile.TemporaryDirectory(prefix="planted-") as folder:
        copy = _copied(Path(folder))
        results = [_tried(copy, mistake, given.json) for mistake in chosen]
    survivors = [r["name"] for r in results if not r["caught"]]
    if given.json:
        print(json.dumps(results, indent=2))
    else:
        print(f"{len(results) - len(survivors)} of {len(results)} mistakes caught")
    return 1 if survivors else 0


def _copied(folder: Path) -> Path:
    for part in PARTS:
        shutil.copytree(ROOT / part, folder / part, ignore=LEFT_OUT)
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy(path, folder)
    return folder


def _tried(copy: Path, mistake: Mistake, silent: bool) -> dict[str, object]:
    """Plant one mistake, run its tests, mend it again."""
    path, started = copy / mistake.file, perf_counter()
    sound = path.read_text(encoding="utf-8")
    if sound.count(mistake.old) != 1:
        raise SystemExit(
            f"{mistake.file}: {mistake.old!r} stands there {sound.count(mistake.old)} times"
        )
    path.write_text(sound.replace(mistake.old, mistake.new), encoding="utf-8")
    try:
        failed = _first_failure(copy, mistake.tests.split())
    finally:
        path.write_text(sound, encoding="utf-8")
    seconds = perf_counter() - started
    if not silent:
        verdict = f"caught by {failed}" if failed else "NOT CAUGHT"
        print(f"{mistake.name:55} {seconds:5.1f} s  {verdict}", flush=True)
    return {"name": mistake.name, "file": mistake.file, "caught": failed, "seconds": seconds}


def _first_failure(copy: Path, tests: list[str]) -> str:
    """Return the first test that fails, "" where all pass."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=PATIENCE
    )
    if done.returncode == 0:
        return ""
    lines = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return lines[0].split(" - ")[0].split(" ", 1)[1] if lines else f"exit {done.returncode}"


if __name__ == "__main__":
    raise SystemExit(main())
