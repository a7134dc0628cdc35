"""Milliseconds of each pass of the last render of a scene, kept beside the scenes' folders."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from formats.errors import BakelightError
from formats.files import atomic
from formats.scene import Scene

# On two cores without a card, a million pixels; no scene's own content is known
ESTIMATES = {
    "gather": 400.0,
    "probe": 5.0,
    "voxels": 200.0,
    "surface": 60.0,
    "transfer": 30.0,
    "ground": 90.0,
    "sky": 25.0,
    "occlusion": 450.0,
    "fog": 25.0,
    "defocus": 900.0,
    "particles": 2.0,
    "billboard": 40.0,
    "radial_blur": 130.0,
    "bloom": 130.0,
    "film": 45.0,
}


def keep(scene: Scene, build_folder: Path, profile: dict[str, Any]) -> None:
    """Keep what a player measured of a scene; a folder that takes no file is no error."""
    if not profile.get("milliseconds"):
        return
    names = ("size", "renderer", "timing", "milliseconds")
    data = {"scene": scene.raw, **{name: profile[name] for name in names}}
    path = _path(scene, build_folder)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        atomic.write_bytes(path, json.dumps(data, indent=1, sort_keys=True).encode())
    except (OSError, BakelightError):
        return


def known(scene: Scene, build_folder: Path, lines: int) -> dict[str, float]:
    """Milliseconds by pass for pictures `lines` high, as many a pixel as the last render took.

    Empty where this very scene was not rendered.
    """
    try:
        data = json.loads(_path(scene, build_folder).read_text())
        if data["scene"] != scene.raw:
            return {}
        width, height = data["size"]
        share = pixels(lines) / (width * height)
        return {str(name): float(ms) * share for name, ms in data["milliseconds"].items()}
    except (OSError, ValueError, KeyError, TypeError, ZeroDivisionError):
        return {}


def estimate(name: str, lines: int) -> float:
    """Milliseconds of a pass for pictures `lines` high, 16:9."""
    return ESTIMATES.get(name, 0.0) * pixels(lines) / 1e6


def pixels(lines: int) -> int:
    """Pixels of a picture 16:9."""
    return lines * round(lines * 16 / 9)


def _path(scene: Scene, build_folder: Path) -> Path:
    return build_folder / "timings" / f"{scene.name}.json"
