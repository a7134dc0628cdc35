"""Light from all around, as a lat-long map of radiance (`environment.ktx2`, RGBA16F)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report, seal
from formats.errors import DamagedError, InputError
from formats.files import ktx2

FORMAT = 1
NAME = "environment.ktx2"
LARGEST = 65504.0
"""Largest half float: radiance above it is clamped, and the report says how much of it."""


@dataclass(frozen=True, eq=False)
class Environment:
    """Radiance from every direction.

    radiance : (h, w, 3) float32 from 0, scene-linear Rec. 709; row 0 is +y, the centre column looks
    along -z, u grows towards +x. quality : further entries of the report.
    """

    radiance: NDArray[np.float32]
    quality: dict[str, Any] = field(default_factory=dict)

    def save(self, folder: Path) -> None:
        """Write `environment.ktx2` and `report.json` into an existing folder.

        Raises InputError for radiance of wrong shape, negative or not finite.
        """
        path = Path(folder) / NAME
        radiance = np.asarray(self.radiance)
        if radiance.ndim != 3 or radiance.shape[2] != 3 or radiance.dtype.kind != "f":
            value = f"{radiance.shape} {radiance.dtype}"
            raise InputError(path, "radiance", value, "give (h, w, 3) floats")
        if 0 in radiance.shape or not np.all(np.isfinite(radiance)) or radiance.min() < 0.0:
            raise InputError(path, "radiance", "empty, negative or not finite", "repair the map")
        stored = np.minimum(radiance, LARGEST).astype(np.float16)
        level = np.concatenate([stored, np.ones_like(stored[..., :1])], axis=2)[None]
        ktx2.write(path, ktx2.Texture((level,), "array"))
        report.write(folder, _report(radiance.astype(np.float64), stored, self.quality))

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Environment:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data = report.read(folder)
        if data.get("kind") != "environment" or data.get("format") != FORMAT:
            found = f"{data.get('kind')} of format {data.get('format')}"
            raise DamagedError(folder, "kind", found, "bake the environment again")
        path = Path(folder) / NAME
        sealed = seal.is_sealed(folder)
        texture = (
            ktx2.decode(seal.read_bytes(folder, NAME), str(path)) if sealed else ktx2.read(path)
        )
        level = texture.levels[0]
        if texture.kind != "array" or len(level) != 1 or level.dtype != np.float16:
            value = f"{texture.kind} {level.shape} {level.dtype}"
            raise DamagedError(path, "texture", value, "bake the environment again")
        return cls(level[0, :, :, :3].astype(np.float32), dict(data.get("quality", {})))


def _report(
    radiance: NDArray[np.float64], stored: NDArray[np.float16], quality: dict[str, Any]
) -> dict[str, Any]:
    """How much light half floats lose: weights are the solid angles of the rows."""
    height, width = radiance.shape[:2]
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    weights = ((edges[:-1] - edges[1:]) * 2.0 * np.pi / width)[:, None, None]
    power = float(np.sum(radiance * weights))
    lost = float(np.sum((radiance - stored.astype(np.float64)) * weights))
    return {
        "format": FORMAT,
        "kind": "environment",
        "size": [width, height],
        "clamped": int(np.count_nonzero(radiance > LARGEST)),
        "power_lost": lost / power if power > 0.0 else 0.0,
        "mean_radiance": np.sum(radiance * weights, axis=(0, 1)) / (4.0 * np.pi),
        "quality": quality,
    }
