"""What a bake leaves: every number in memory and in the files is finite, and the seal holds."""

from __future__ import annotations

import dataclasses
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from formats import seal
from pipelines.hard.cells import Result


def saved(asset: Any, parent: Path) -> Result:
    """Save an asset, seal it, read it back, and count the numbers that are not finite."""
    with tempfile.TemporaryDirectory(dir=parent) as name:
        folder = Path(name)
        bad = not_finite(asset, "made")
        asset.save(folder)
        seal.seal(folder)
        bad += not_finite(json.loads((folder / "report.json").read_bytes()), "report")
        if hasattr(type(asset), "load"):
            bad += not_finite(type(asset).load(folder), "read")
        seal.verify(folder)
    return Result("failed" if bad else "ok", float(len(bad)), 0.0, ", ".join(bad[:3]))


def not_finite(value: Any, where: str) -> list[str]:
    """Return the places of numbers that are not finite."""
    return [place for place, number in numbers(value, where) if not np.isfinite(number).all()]


def numbers(value: Any, where: str) -> Iterator[tuple[str, Any]]:
    """Yield every float that can be reached through dataclasses, sequences and tables."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "fc":
            yield where, value
    elif isinstance(value, float | np.floating):
        yield where, value
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from numbers(getattr(value, field.name), f"{where}.{field.name}")
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from numbers(item, f"{where}.{key}")
    elif isinstance(value, list | tuple):
        for n, item in enumerate(value):
            yield from numbers(item, f"{where}[{n}]")
