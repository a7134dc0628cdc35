"""Run the matrix of hard cases and write its table; exit code 1 where a case is not met.

python -m pipelines.hard.run [--quick] [--describe] [-o FOLDER] [WORDS]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pipelines.hard import matrix


def main(arguments: list[str]) -> int:
    """Run the cells whose names hold one of the words, or all."""
    parser = argparse.ArgumentParser(description="Run the matrix of hard cases.")
    parser.add_argument("words", nargs="*", help="rows or stages")
    parser.add_argument("--quick", action="store_true", help="leave out what takes long")
    parser.add_argument("--describe", action="store_true", help="print docs/hard-cases.md")
    parser.add_argument("-o", "--output", type=Path, default=Path("build/hard"))
    given = parser.parse_args(arguments)
    if given.describe:
        print(matrix.described(), end="")
        return 0
    chosen = [c for c in matrix.cells(slow=not given.quick)
              if not given.words or any(word in c.name for word in given.words)]  # fmt: skip
    outcomes = matrix.run(chosen, _say)
    matrix.write(outcomes, given.output)
    for outcome in outcomes:
        if not outcome.result.good:
            print(f"{outcome.cell.name}: {outcome.result}", file=sys.stderr)
    found = matrix.counts(outcomes)
    seconds = sum(outcome.seconds for outcome in outcomes)
    told = ", ".join(f"{count} {verdict}" for verdict, count in found.items())
    print(f"{len(matrix.rows())} rows, {len(outcomes)} cells: {told}; {seconds:.0f} s")
    print(given.output / "table.md")
    return 1 if found["failed"] else 0


def _say(number: int, count: int, family: str) -> None:
    if sys.stderr.isatty():
        print(f"\r{number + 1}/{count} {family:40}", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
