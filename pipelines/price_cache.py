"""What probes found, kept in build/prices, so that a plan can tell prices before a bake."""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from formats import photograph_files
from formats.files import atomic
from formats.plan import AssetPlan, Plan
from formats.scene import Scene
from maths.price import Law
from pipelines import current
from pipelines.price import Point, Prices

FOLDER = "prices"
MOST_CHANNELS = 32
PRIORS = {
    "billboard": ("samples", Law(0.15, 0.35, 0.75), 16),
    "photographs": ("channels", Law(0.1, 0.6, 1.0), 16),
    "occlusion": ("rays", Law(0.055, 1.0, 0.75), 1024),
    "transfer": ("rays", Law(0.035, 0.4, 0.75), 256),
    "lightmap": ("rays", Law(0.0, 0.9, 0.65), 1024),
}
"""Knob, law and usual count of each kind where nothing was probed: rough numbers of meshes of
ours at the usual terms and bands, set by hand; `plan` says that they are no more."""


def keep(build_folder: Path, scene: Scene, asset: str, prices: Prices) -> None:
    """Keep the front of an asset's prices for `known`; a folder that cannot be written keeps
    nothing."""
    path = _path(build_folder, scene, asset)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        told = {"quantity": prices.quantity, "seconds": prices.seconds}
        told["points"] = [asdict(point) for point in prices.points]
        atomic.write_bytes(path, json.dumps(told).encode())


def known(build_folder: Path, scene: Scene, asset: str) -> Prices | None:
    """Return what a probe of this very asset found, or None."""
    try:
        told = json.loads(_path(build_folder, scene, asset).read_text())
        points = tuple(Point(**point) for point in told["points"])
        return Prices(told["quantity"], points, told["seconds"]) if points else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def prior(plan: Plan, asset: AssetPlan) -> Prices:
    """Return what assets of that kind cost as a rule, about the plan's estimate of seconds."""
    photographed = asset.source.endswith(photograph_files.SUFFIX)
    knob, law, usual = PRIORS["photographs" if photographed else asset.kind]
    counts = [max(1, round(usual * 2.0 ** (n / 2))) for n in range(-8, 13)]
    if photographed:
        counts = [n for n in counts if 4 <= n <= MOST_CHANNELS]
    # Half of a usual bake grows with its rays
    points = [
        Point({knob: n}, law.error(n), asset.seconds * (0.5 + 0.5 * n / usual), asset.bytes)
        for n in counts
    ]
    return Prices("a usual asset of this kind", tuple(points), 0.0)


def _path(build_folder: Path, scene: Scene, asset: str) -> Path:
    """Return the file for an asset as it is described now, by these sources and this code."""
    told: dict[str, Any] = {"scene": scene.raw, "asset": asset, "code": current.code()}
    told["sources"] = {
        name: current.digest(file) for name, file in scene.sources.items() if file.is_file()
    }
    text = json.dumps(told, sort_keys=True, default=str)
    key = hashlib.sha256(text.encode()).hexdigest()
    return build_folder / FOLDER / f"{asset.replace('/', '-')}-{key[:32]}.json"
