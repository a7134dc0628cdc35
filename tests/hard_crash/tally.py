"""Counts that are kept on disk after every trial, so that a long proof can be done in pieces."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

from formats.files import atomic

Note = Callable[[int, dict[str, Any]], None]
"""Is told how many trials are done, and what those of this process gave."""
Proof = Callable[[int, Note], dict[str, Any]]
"""Does the trials from a number on; returns what they gave."""

ROOT = Path(__file__).resolve().parents[2]
MOST_FAULTS = 8


def silent(trials: int, result: dict[str, Any]) -> None:
    """Keep nothing."""


class Tally:
    """Counts in a file; those of other code or of other numbers asked for are forgotten."""

    def __init__(self, path: Path, asked: dict[str, Any]) -> None:
        self.path, self.known = path, {"code": _code(), "asked": asked, "proofs": {}}
        try:
            found = json.loads(path.read_bytes())
        except (OSError, ValueError):
            return
        if {**found, "proofs": {}} == self.known:
            self.known = found

    def count(self, name: str, proof: Proof) -> dict[str, Any]:
        """Go on with a proof where it was left; return what all its trials gave."""
        before = self.known["proofs"].get(name, {"next": 0, "seconds": 0.0, "result": {}})
        if before.get("done"):
            return {**before["result"], "seconds": before["seconds"]}
        begin = perf_counter()

        def keep(trials: int, result: dict[str, Any], done: bool = False) -> None:
            now = {
                "next": trials,
                "seconds": round(before["seconds"] + perf_counter() - begin, 1),
                "result": merged(before["result"], result),
                "done": done,
            }
            self.known["proofs"][name] = now
            self.path.parent.mkdir(parents=True, exist_ok=True)
            atomic.write_bytes(self.path, json.dumps(self.known, indent=1).encode())

        result = proof(before["next"], keep)
        keep(-1, result, done=True)
        kept = self.known["proofs"][name]
        return {**kept["result"], "seconds": kept["seconds"]}


def merged(a: dict[str, Any], b: dict[str, Any]) -> dict[str, Any]:
    """Add up numbers, at any depth; lists of faults come one after the other.

    >>> merged({"n": 1, "wrong": {"x": 2}, "faults": ["a"]}, {"n": 4, "wrong": {"y": 1}})
    {'n': 5, 'wrong': {'x': 2, 'y': 1}, 'faults': ['a']}
    """
    found = dict(a)
    for name, value in b.items():
        if isinstance(value, dict):
            found[name] = merged(a.get(name, {}), value)
        elif isinstance(value, list):
            found[name] = (a.get(name, []) + value)[:MOST_FAULTS]
        elif isinstance(value, bool) or not isinstance(value, int):
            found[name] = value
        else:
            found[name] = a.get(name, 0) + value
    return found


def _code() -> str:
    found = hashlib.sha256()
    for package in ("bake", "formats", "maths", "pipelines", "tests/hard_crash"):
        for path in sorted((ROOT / package).rglob("*.py")):
            found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()
