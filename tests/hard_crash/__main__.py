"""Crash safety by numbers: python -m tests.hard_crash [--kills N] [--only NAME,...] ...

Kills, full disks, flipped bits, bakes at once, the order of flushes and the same bits, over all
stages. Prints each count, with its 95 % bound where it is zero, and writes it as JSON. Counts are
kept after each trial: interrupted ones go on, if the code is the same. With TMPDIR on a disk in
memory it takes a third of the time and proves as much. Ends with 1 where something went wrong.
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
from typing import Any

from bake import syntax
from bake.store import SYNTAX
from tests.hard_crash import at_once, bits, forks, full_disk, kills, order, same_bits
from tests.hard_crash.subjects import Subject, subjects, use_small_tiles, write_sources
from tests.hard_crash.tally import Note, Proof, Tally

Judge = Callable[[dict[str, Any]], dict[str, Any]]
ROOT = Path(__file__).resolve().parents[2]
MOST = 1  # code of difference between kernels
SHARE = 1e-4  # of texels that differ


def main() -> int:
    """Run what is asked for; return the exit code."""
    asked = _arguments()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    use_small_tiles()
    numbers = {k: v for k, v in vars(asked).items() if isinstance(v, int) and k != "again"}
    kept = asked.output.with_name("crash-tally.json")
    if asked.again:
        kept.unlink(missing_ok=True)
    tally = Tally(kept, numbers)
    with tempfile.TemporaryDirectory(prefix="hard-crash-") as made:
        folder = Path(made)
        write_sources(folder / "sources")
        write_sources(folder / "larger", asked.size)
        write_sources(folder / "tiled", asked.size // 2 or 1)
        found = subjects(folder / "sources")
        imported = partial(_bake_all, found, folder / "warm")
        forks.import_what(imported)
        _parse_once(folder / "warm/store" / SYNTAX)
        proofs = _proofs(asked, found, folder)
        results = {
            name: _told(name, tally.count(name, proof), judge)
            for name, (proof, judge) in proofs.items()
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
    parser.add_argument("--size", type=int, default=16, help="of pictures to compare kernels by")
    parser.add_argument(
        "--only", default="", help="kills,disk,bits,tiles,at-once,order,same,kernels"
    )
    parser.add_argument("--again", action="store_true", help="forget what was counted before")
    parser.add_argument("--output", type=Path, default=ROOT / "build/hard/crash.json")
    return parser.parse_args()


def _parse_once(file: Path) -> None:
    """Know what a bake parsed; children still write it down, as the first in a folder does."""
    syntax.remember(file)
    syntax._saved.clear()


def _bake_all(found: dict[str, Subject], build: Path) -> None:
    for subject in found.values():
        subject.run(build)


def _proofs(
    asked: argparse.Namespace, found: dict[str, Subject], folder: Path
) -> dict[str, tuple[Proof, Judge]]:
    """Return each proof, and how what it gives is judged."""
    in_tiles = {name: found[name] for name in ("ring", "dome", "occlusion", "transfer")}
    tiled = partial(same_bits.prove, folder / "tiled", folder, asked.runs, asked.size // 2 or 1)

    def kill(begin: int, note: Note) -> dict[str, Any]:
        result = kills.prove(found, folder, asked.kills, begin, note)
        trials = max(12, asked.kills // 20)
        damaged = kills.control(found["dome"], folder / "control", trials)
        turned = kills.control_of_tiles(in_tiles, folder / "control")
        result["controls"] = {
            f"a store that writes in place, of {trials} kills": damaged,
            f"tiles turned round, of {len(in_tiles)}": len(turned),
        }
        return result

    def flip(begin: int, note: Note) -> dict[str, Any]:
        result = bits.prove(found, folder, asked.flips, begin, note)
        entries = {name: found[name] for name in ("mesh", "environment")}
        unseen = bits.prove(entries, folder / "control", 12, verify=lambda path: None)["wrong"]
        result["controls"] = {"no hash compared, of 12 flips": unseen["verify missed"]}
        return result

    return {
        "kills": (kill, _counted),
        "disk": (partial(full_disk.prove, found, folder, asked.every), _counted),
        "bits": (flip, _counted),
        "tiles": (partial(bits.prove_tiles, in_tiles, folder, asked.flips // 10), _counted),
        "at-once": (
            partial(at_once.prove, found, folder, asked.trials), partial(_counted, factor=2)
        ),
        "order": (lambda begin, note: order.prove(found, folder), _counted),
        "same": (tiled, _counted),
        "kernels": (
            lambda begin, note: same_bits.kernels(folder / "larger", folder, asked.size), _kernels
        ),
    }  # fmt: skip


def _told(name: str, counts: dict[str, Any], judge: Judge) -> dict[str, Any]:
    seconds = counts.pop("seconds")
    result = judge(counts) | {"seconds": seconds}
    print(f"{name}, {seconds:.0f} s", *result.pop("lines"), sep="\n  ", flush=True)
    return result


def _counted(result: dict[str, Any], factor: int = 1) -> dict[str, Any]:
    """Judge counts of what went wrong; bound each zero of n by 3/n, the rule of three."""
    first = next(iter(result.values()))
    n = factor * (sum(first.values()) if isinstance(first, dict) else first)
    of = {name: result.get("of", {}).get(name, n) for name in result["wrong"]}
    bounds = {name: 3 / of[name] for name, count in result["wrong"].items() if count == 0}
    told = [name for name in result if name not in ("wrong", "faults", "of", "controls")]
    lines = [f"{name}: {result[name]}" for name in told]
    for name, count in result["wrong"].items():
        bound = f" (95 %: below {bounds[name]:.2g})" if name in bounds else ""
        lines.append(f"{name}: {count} of {of[name]}{bound}")
    lines += result.get("faults", [])
    controls = result.get("controls", {})
    lines += [f"control, {name}: {count} found" for name, count in controls.items()]
    holds = not any(result["wrong"].values()) and all(controls.values())
    return {**result, "n": n, "bounds": bounds, "holds": holds, "lines": lines}


def _kernels(compared: dict[str, Any]) -> dict[str, Any]:
    """Judge lumpy shapes by codes, symmetrical ones by what is shown."""
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
        unit = "files" if "files" in worst else "texels"
        lines.append(
            f"{name}: {differ} of {texels} {unit} differ {what} with the worst, by at most {most}"
            + ("" if fine else f" -- MORE than {MOST} code in {SHARE:g}")
        )
    lines.append("kernels: " + ", ".join(next(iter(compared.values()))))
    return {"compared": compared, "holds": holds, "lines": lines}


if __name__ == "__main__":
    sys.exit(main())
