"""Crash safety by numbers: python -m tests.hard_crash [--kills N] [--only NAME,...] ...

Kills, full disks, flipped bits, bakes at once, the order of flushes and the same bits, over all
stages. Prints each count, with its 95 % bound where it is zero, and writes it as JSON. Ends with 1
where something went wrong.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from tests.hard_crash import at_once, bits, forks, full_disk, kills, order, same_bits
from tests.hard_crash.subjects import Subject, subjects, write_sources

ROOT = Path(__file__).resolve().parents[2]
MOST = 1  # code of difference between kernels
SHARE = 1e-4  # of texels that differ


def main() -> int:
    """Run what is asked for; return the exit code."""
    asked = _arguments()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory(prefix="hard-crash-") as made:
        folder = Path(made)
        write_sources(folder / "sources")
        write_sources(folder / "larger", asked.size)
        found = subjects(folder / "sources")
        imported = partial(_bake_all, found, folder / "warm")
        forks.import_what(imported)
        proofs = _proofs(asked, found, folder)
        results = {
            name: _timed(name, proof)
            for name, proof in proofs.items()
            if not asked.only or name in asked.only.split(",")
        }
    asked.output.parent.mkdir(parents=True, exist_ok=True)
    asked.output.write_text(json.dumps(results, indent=1) + "\n")
    bad = [name for name, result in results.items() if not result["holds"]]
    print(f"crash: {'holds' if not bad else 'does NOT hold: ' + ', '.join(bad)}; {asked.output}")
    return bool(bad)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--kills", type=int, default=500)
    parser.add_argument("--flips", type=int, default=1000)
    parser.add_argument("--trials", type=int, default=100, help="of 2 and of 8 bakes at once")
    parser.add_argument("--runs", type=int, default=5, help="with each of 9 settings")
    parser.add_argument("--every", type=int, default=1, help="write of a bake that fails")
    parser.add_argument("--size", type=int, default=8, help="of pictures to compare kernels by")
    parser.add_argument("--only", default="", help="kills,disk,bits,at-once,order,same,kernels")
    parser.add_argument("--output", type=Path, default=ROOT / "build/hard/crash.json")
    return parser.parse_args()


def _bake_all(found: dict[str, Subject], build: Path) -> None:
    for subject in found.values():
        subject.run(build)


def _proofs(
    asked: argparse.Namespace, found: dict[str, Subject], folder: Path
) -> dict[str, Callable[[], dict[str, Any]]]:
    return {
        "kills": lambda: _kills(found, folder, asked.kills),
        "disk": lambda: _counted(full_disk.prove(found, folder, asked.every)),
        "bits": lambda: _bits(found, folder, asked.flips),
        "at-once": lambda: _counted(at_once.prove(found, folder, asked.trials), factor=2),
        "order": lambda: _counted(order.prove(found, folder)),
        "same": lambda: _counted(same_bits.prove(folder / "sources", folder, asked.runs)),
        "kernels": lambda: _kernels(folder, asked.size),
    }


def _timed(name: str, proof: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    begin = perf_counter()
    result = proof()
    result["seconds"] = round(perf_counter() - begin, 1)
    print(f"{name}, {result['seconds']:.0f} s", *result.pop("lines"), sep="\n  ", flush=True)
    return result


def _counted(result: dict[str, Any], factor: int = 1) -> dict[str, Any]:
    """Judge counts of what went wrong; bound each zero of n by 3/n, the rule of three."""
    first = next(iter(result.values()))
    n = factor * (sum(first.values()) if isinstance(first, dict) else first)
    of = {name: result.get("of", {}).get(name, n) for name in result["wrong"]}
    bounds = {name: 3 / of[name] for name, count in result["wrong"].items() if count == 0}
    told = [name for name in result if name not in ("wrong", "faults", "of")]
    lines = [f"{name}: {result[name]}" for name in told]
    for name, count in result["wrong"].items():
        bound = f" (95 %: below {bounds[name]:.2g})" if name in bounds else ""
        lines.append(f"{name}: {count} of {of[name]}{bound}")
    lines += result.get("faults", [])
    holds = not any(result["wrong"].values())
    return {**result, "n": n, "bounds": bounds, "holds": holds, "lines": lines}


def _kills(found: dict[str, Subject], folder: Path, count: int) -> dict[str, Any]:
    result = _counted(kills.prove(found, folder, count))
    control = max(12, count // 20)
    result["control"] = kills.control(found["dome"], folder / "control", control)
    result["holds"] &= result["control"] > 0
    told = f"control, a store that writes in place: {result['control']} of {control} damaged"
    result["lines"].append(told)
    return result


def _bits(found: dict[str, Subject], folder: Path, count: int) -> dict[str, Any]:
    result = _counted(bits.prove(found, folder, count))
    entries = {name: found[name] for name in ("mesh", "environment")}
    missed = bits.prove(entries, folder / "control", 12, verify=lambda path: None)["wrong"]
    result["control"] = missed["verify missed"]
    result["holds"] &= result["control"] > 0
    result["lines"].append(f"control, no hash compared: {result['control']} of 12 missed")
    return result


def _kernels(folder: Path, size: int) -> dict[str, Any]:
    """Judge lumpy shapes by codes, symmetrical ones by what is shown."""
    compared = same_bits.kernels(folder / "larger", folder, size)
    lines, holds = [], True
    for name, kernels in compared.items():
        symmetric = name.endswith("of a ball")
        counts = [k.get("shown", k) if symmetric else k for k in kernels.values()]
        worst = max(counts, key=lambda each: each["differ"] / max(each["texels"], 1))
        texels, differ = worst["texels"], worst["differ"]
        most = max(each["most"] for each in counts)
        if not texels:
            continue
        fine = most <= MOST and 0 <= differ <= SHARE * texels
        holds &= fine
        what = "of what is shown" if symmetric and "shown" in next(iter(kernels.values())) else ""
        lines.append(
            f"{name}: {differ} of {texels} texels differ {what} with the worst, by at most {most}"
            + ("" if fine else f" -- MORE than {MOST} code in {SHARE:g}")
        )
    lines.append("kernels: " + ", ".join(next(iter(compared.values()))))
    return {"compared": compared, "holds": holds, "lines": lines}


if __name__ == "__main__":
    sys.exit(main())
