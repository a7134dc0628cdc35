"""Occlusion harmonics become a few numbers a voxel in RGBA volumes, in one of two encodings.

"talk": sixteen components in four cubic volumes, those that keep most of the sum of squares over
the voxels outside the solid: uncentred, so that nothing hidden stays exactly zero far away.
"bands": all bands, each number by itself, on two grids that lookups fit (`bake.occlusion_fit`).
The same bytes then hold four times the harmonics, for four times the lookups.

References
----------
Sloan, Hall, Hart, Snyder 2003, Clustered Principal Components for Precomputed Radiance Transfer
(components of transfer vectors, lit by projected light).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import occlusion_fit, workers
from formats import occlusion as kind
from formats.errors import InputError
from formats.occlusion import Occlusion, OcclusionHarmonics
from maths.occlusion_shadow import occlusion_place, occlusion_warp
from maths.principal_components import principal_components
from maths.trilinear import looked_up

Float = NDArray[np.float32]
Array = NDArray[np.float64]

ENCODINGS = ("talk", "bands")
LARGEST = 1 << 16  # KiB
BLOCK = 1 << 15  # voxels that are summed at once


@dataclass(frozen=True)
class Params:
    """Knobs. encoding : "talk" or "bands".  components : numbers a voxel of "talk", four a volume.
    depth : bits of each number, 8 or 16.  size : KiB that "bands" may take."""

    encoding: str = "talk"
    components: int = 16
    depth: int = 8
    size: int = 512

    def check(self) -> None:
        """Raise InputError for the first knob out of its range."""
        if self.encoding not in ENCODINGS:
            remedy = f"choose from {', '.join(ENCODINGS)}"
            raise InputError("occlusion", "encoding", self.encoding, remedy)
        if not 1 <= self.components <= 64:
            raise InputError("occlusion", "components", self.components, "choose from 1 to 64")
        if self.depth not in (8, 16):
            raise InputError("occlusion", "depth", self.depth, "choose 8 or 16")
        if not 1 <= self.size <= LARGEST:
            raise InputError("occlusion", "size", self.size, f"choose from 1 to {LARGEST}")


def compress(
    master: OcclusionHarmonics, *, params: Params, progress: workers.Progress = workers.silent
) -> Occlusion:
    """Choose components or grids, and quantise. InputError for knobs out of range and broken
    arrays."""
    params.check()
    master = master.checked()
    if master.inside.all():
        raise InputError("occlusion", "inside", "everywhere", kind.AGAIN)
    return _bands(master, params) if params.encoding == "bands" else _talk(master, params)


def l_max_for(params: Params) -> int:
    """Return the highest band, 1 to 8, for "bands" of that size where none is asked for: one more
    for twice the numbers. More of them err less in the same bytes, but cost lookups.

    >>> [l_max_for(Params(size=size)) for size in (1, 128, 512, 4096)]
    [1, 5, 7, 8]
    """
    return int(np.clip(np.rint(np.log2(params.size * 8 / params.depth)) - 2, 1, 8))


def _talk(master: OcclusionHarmonics, params: Params) -> Occlusion:
    """Keep the components of most energy, on the grid that was traced."""
    n, K = len(master.terms), master.terms.shape[-1]
    terms = master.terms.reshape(-1, K)
    outside = ~master.inside.ravel()
    count = min(params.components, K)
    found = principal_components(terms[outside], count)
    vectors = found.vectors.astype(np.float32)
    scores = scores_of(terms, found.vectors).reshape(n, n, n, count)
    volumes, scales = _stored(scores, params.depth)
    asset = Occlusion(volumes, scales, found.vectors, master.box)
    kept = np.asarray(scores.reshape(-1, count) @ vectors, np.float32)
    stored = np.asarray(asset.decoded().reshape(-1, count) @ vectors, np.float32)
    quality = {
        **_quality(master, asset),
        "singular_values": found.singular,
        "kept_energy": _energy(terms[outside], found.singular),
        "component_loss": found.residual,
        "component_loss_least": found.optimum,
        "quantisation_loss": _rms((stored - kept)[outside]),
        "shadow_rms": shadow_rms(master, {"harmonics": terms, "components": kept, "codes": stored}),
        "warnings": list(found.warnings),
    }
    return replace(asset, quality=quality)


def scores_of(terms: Float, vectors: Array) -> Float:
    """Return the scores (v, count) of coefficients (v, K) along directions (count, K), summed in
    double precision: codes must not depend on the kernel of BLAS."""
    scores = np.empty((len(terms), len(vectors)), np.float32)
    for a in range(0, len(terms), BLOCK):
        scores[a : a + BLOCK] = terms[a : a + BLOCK].astype(np.float64) @ vectors.T
    return scores


def _bands(master: OcclusionHarmonics, params: Params) -> Occlusion:
    """Fit every harmonic, low ones on the finer of two grids."""
    n, K = len(master.terms), master.terms.shape[-1]
    terms = master.terms.reshape(-1, K)
    size = occlusion_fit.sizes(master.box, K, params.size * 1024 * 8 // params.depth)
    fine, warp = occlusion_fit.split(K)[0], occlusion_fit.WARP
    ranges = ((0, fine), (fine, K)) if fine < K else ((0, K),)
    fitted = [
        occlusion_fit.fit(np.ascontiguousarray(master.terms[..., a:b]), master.inside, grid, warp)
        for (a, b), grid in zip(ranges, size, strict=False)
    ]
    grids, scales = zip(*(_stored(each, params.depth) for each in fitted), strict=True)
    coarse = grids[1] if len(grids) > 1 else None
    asset = Occlusion(
        grids[0], np.concatenate(scales), np.eye(K), master.box, coarse=coarse, warp=warp
    )
    voxels = master.box.to_object(master.box.voxel_centres(n))
    places = occlusion_warp(occlusion_place(voxels), warp)
    kept = np.concatenate([looked_up(each, places) for each in fitted], axis=1)
    stored = asset.terms(voxels)
    outside = ~master.inside.ravel()
    quality = {
        **_quality(master, asset),
        "component_loss": _rms((kept - terms)[outside]),
        "quantisation_loss": _rms((stored - kept)[outside]),
        "shadow_rms": shadow_rms(master, {"harmonics": terms, "components": kept, "codes": stored}),
        "warnings": [],
    }
    return replace(asset, quality=quality)


def _quality(master: OcclusionHarmonics, asset: Occlusion) -> dict[str, Any]:
    """Return what the report of every encoding says."""
    return {**master.quality, "standard_errors": master.error, "bytes": int(asset.nbytes)}


def _stored(values: Float, depth: int) -> tuple[NDArray[Any], Float]:
    """Return codes (P, z, y, x, 4) of values (z, y, x, c), and the scales (4 P,) of their slots."""
    padded = np.zeros((*values.shape[:3], 4 * -(-values.shape[3] // 4)), np.float32)
    padded[..., : values.shape[3]] = values
    scales = np.abs(padded).max(axis=(0, 1, 2))
    shares = np.asarray(padded / np.where(scales > 0, scales, 1), np.float32)
    codes = kind.encode(shares, depth)
    volumes = np.moveaxis(codes.reshape(*values.shape[:3], -1, 4), 3, 0)
    return np.ascontiguousarray(volumes), scales


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
