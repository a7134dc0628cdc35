"""What is known of the assets that a scene was baked to: the reports that plans take."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from formats import report
from formats.errors import BakelightError

Reports = dict[str, dict[str, Any]]


def of_entries(folders: Iterable[tuple[str, Path]]) -> Reports:
    """Read the reports of baked assets (name, folder); one that cannot be read is not known."""
    found: Reports = {}
    for name, folder in folders:
        with suppress(BakelightError, OSError, struct.error):
            data = report.read(folder)
            texture = next(
                (p for p in (folder / "planes.ktx2", folder / "dome.ktx2") if p.is_file()), None
            )
            if name.startswith("billboard/") and texture is not None:
                data["size"] = _size(texture)
            found[name] = data
    return found


def _size(path: Path) -> list[int]:
    """Width and height in texels of level 0: KTX 2.0, 3.1, bytes 20 to 28."""
    with open(path, "rb") as file:
        return list(struct.unpack("<20x2I", file.read(28)))
