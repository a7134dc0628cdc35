"""Occlusion harmonics become sixteen numbers a voxel in four RGBA volumes.

The components are those that keep most of the sum of squares over the voxels outside the solid:
uncentred, so that nothing hidden stays exactly zero far away.

References
----------
Sloan, Hall, Hart, Snyder 2003, Clustered Principal Components for Precomputed Radiance Transfer
(components of transfer vectors, lit by projected light).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import workers
from formats import occlusion as kind
from formats.errors import InputError
from formats.occlusion import Occlusion, OcclusionHarmonics
from maths.principal_components import principal_components

Float = NDArray[np.float32]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Params:
    """Knobs. components : numbers a voxel, four a volume.  depth : bits of each, 8 or 16."""

    components: int = 16
    depth: int = 8

    def check(self) -> None:
        """Raise InputError for the first knob out of its range."""
        if not 1 <= self.components <= 64:
            raise InputError("occlusion", "components", self.components, "choose from 1 to 64")
        if self.depth not in (8, 16):
            raise InputError("occlusion", "depth", self.depth, "choose 8 or 16")


def compress(
    master: OcclusionHarmonics, *, params: Params, progress: workers.Progress = workers.silent
) -> Occlusion:
    """Choose components, and quantise. InputError for knobs out of range and broken arrays."""
    params.check()
    master = master.checked()
    n, K = len(master.terms), master.terms.shape[-1]
    terms = master.terms.reshape(-1, K)
    outside = terms[~master.inside.ravel()]
    if not len(outside):
        raise InputError("occlusion", "inside", "everywhere", kind.AGAIN)
    count = min(params.components, K)
    found = principal_components(outside, count)
    scores = np.zeros((len(terms), 4 * -(-count // 4)), np.float32)
    scores[:, :count] = terms @ found.vectors.T.astype(np.float32)
    scales = np.abs(scores).max(axis=0)
    values = np.asarray(scores / np.where(scales > 0, scales, 1), np.float32)
    codes = kind.encode(values, params.depth).reshape(n, n, n, -1, 4)
    volumes = np.ascontiguousarray(np.moveaxis(codes, 3, 0))
    asset = Occlusion(volumes, scales, found.vectors, master.box)
    kept = scores[:, :count] @ found.vectors.astype(np.float32)
    stored = asset.decoded().reshape(-1, count) @ found.vectors.astype(np.float32)
    quality = {
        **master.quality,
        "standard_errors": master.error,
        "singular_values": found.singular,
        "kept_energy": _energy(outside, found.singular),
        "component_loss": found.residual,
        "component_loss_least": found.optimum,
        "quantisation_loss": _rms((stored - kept)[~master.inside.ravel()]),
        "shadow_rms": shadow_rms(master, {"harmonics": terms, "components": kept, "codes": stored}),
        "bytes": int(volumes.nbytes),
        "warnings": list(found.warnings),
    }
    return Occlusion(volumes, scales, found.vectors, master.box, quality)


def shadow_rms(master: OcclusionHarmonics, volumes: dict[str, Float]) -> dict[str, Any]:
    """Return the RMS error of the shares of the proof's lights that are seen, radius by radius.

    volumes : (v, K) coefficients by name. Empty without proof.
    """
    if not master.proof_shadow.size:
        return {}
    found: dict[str, Any] = {"degrees": np.degrees(master.proof_radii).round(3)}
    for name, terms in volumes.items():
        hidden = master.proof_lights @ terms[master.proof_voxels].T
        error = np.clip(1 - hidden, 0, 1) - master.proof_shadow
        found[name] = np.sqrt(np.mean(np.square(error, dtype=np.float64), axis=(1, 2)))
    return found


def _energy(records: Float, singular: Array) -> float:
    """Return the share of the sum of squares that the components keep."""
    total = float(np.sum(np.square(records, dtype=np.float64)))
    return float(np.sum(np.square(singular))) / total if total > 0 else 1.0


def _rms(values: Float) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))
