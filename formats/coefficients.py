"""The float master of a relit sprite: what the rays found, before mips and codes."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report, seal
from formats.billboard import Ring, description, read_layout
from formats.errors import InputError
from formats.files import exr

LARGEST = 1e30
"""Largest coefficient: sums of many are still finite in float32."""


@dataclass(frozen=True)
class Coefficients:
    """Float master of a sprite (`terms.exr`).

    terms : (V, K, h, w, 3) float32 premultiplied circular-harmonic coefficients of outgoing
    radiance per unit irradiance (1/sr). alpha : (V, h, w) coverage, 0..1. held_out : (M, n, 3)
    renders of some texels of view 0, `held_out_texels` (n,), row-major, under lights of azimuth
    `held_out_angles` (M,) that the fit never saw. pivot : (x, y) texels from the top left to the
    ground point. height : metres of the object itself.
    """

    terms: NDArray[np.float32]
    alpha: NDArray[np.float32]
    ring: Ring
    metres_per_texel: float
    pivot: tuple[float, float]
    height: float
    held_out: NDArray[np.float32]
    held_out_texels: NDArray[np.int64]
    held_out_angles: tuple[float, ...] = ()
    quality: dict[str, Any] = field(default_factory=dict)

    def save(self, folder: Path) -> None:
        """Write `terms.exr` (one part a term) and `report.json` into an empty folder."""
        parts: dict[str, NDArray[Any]] = {}
        for v, (terms, alpha) in enumerate(zip(self.terms, self.alpha, strict=True)):
            parts[f"view{v}.alpha"] = alpha[..., None]
            parts |= {f"view{v}.term{k}": term for k, term in enumerate(terms)}
        if self.held_out_texels.size:
            width = self.alpha.shape[2]
            parts |= {f"held_out{m}": _folded(row, width) for m, row in enumerate(self.held_out)}
            # As rows and columns: float32 holds whole numbers up to 2^24 only
            row, column = np.divmod(self.held_out_texels, width)
            places = np.stack([row, column, np.zeros_like(row)], axis=1)
            parts["held_out_texels"] = _folded(places, width)
        exr.write(folder / "terms.exr", parts, half=False, compression="none")
        layout = {
            "ring": asdict(self.ring),
            "views": len(self.terms),
            "metres_per_texel": self.metres_per_texel,
            "pivot": list(self.pivot),
            "height": self.height,
            "held_out": self.held_out.shape[1],
            "held_out_angles": list(self.held_out_angles),
        }
        report.write(folder, description("coefficients", layout, self.quality))

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Coefficients:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data = read_layout(folder, "coefficients")
        layout = data["layout"]
        if seal.is_sealed(folder):
            seal.read_bytes(folder, "terms.exr")
        parts = exr.read(folder / "terms.exr")
        ring = Ring(**layout["ring"])
        views, angles = range(layout["views"]), layout["held_out_angles"]
        terms = [[parts[f"view{v}.term{k}"] for k in range(ring.terms)] for v in views]
        alpha = [parts[f"view{v}.alpha"][..., 0] for v in views]
        count = layout["held_out"]
        held_out, texels = np.zeros((len(angles), count, 3), np.float32), np.zeros(0, np.int64)
        for m in range(len(angles) if count else 0):
            held_out[m] = parts[f"held_out{m}"].reshape(-1, 3)[:count]
        if count:
            places = parts["held_out_texels"].reshape(-1, 3)[:count].astype(np.int64)
            texels = places[:, 0] * alpha[0].shape[1] + places[:, 1]
        return cls(
            terms=np.asarray(terms, np.float32),
            alpha=np.asarray(alpha, np.float32),
            ring=ring,
            metres_per_texel=layout["metres_per_texel"],
            pivot=(layout["pivot"][0], layout["pivot"][1]),
            height=layout["height"],
            held_out=held_out,
            held_out_texels=texels,
            held_out_angles=tuple(angles),
            quality=data["quality"],
        )

    def checked(self, where: object = "coefficients") -> Coefficients:
        """Return the sprite with arrays of the declared types, contiguous, native byte order.

        Raises InputError for an array of wrong shape or type and for numbers that are not finite or
        out of range; `where` names it.
        """
        alpha, held = np.asarray(self.alpha), np.asarray(self.held_out)
        views, height, width = alpha.shape if alpha.ndim == 3 else (0, 0, 0)
        count, texels = held.shape[1] if held.ndim == 3 else 0, height * width
        kinds: dict[str, tuple[str, tuple[int, ...], float, float]] = {
            "alpha": ("f", (views, height, width), 0.0, 1.0),
            "terms": ("f", (views, self.ring.terms, height, width, 3), -LARGEST, LARGEST),
            "held_out": ("f", (len(self.held_out_angles), count, 3), 0.0, LARGEST),
            "held_out_texels": ("iu", (count,), 0, texels - 1),
        }
        arrays: dict[str, Any] = {}
        for name, (kind, shape, low, high) in kinds.items():
            array = np.asarray(getattr(self, name))
            if array.dtype.kind not in kind or array.shape != shape:
                raise InputError(where, name, f"{array.dtype} {array.shape}", "bake it again")
            if not np.all((array >= low) & (array <= high)):
                limits = f"not finite, or not from {low:g} to {high:g}"
                raise InputError(where, name, limits, "bake it again")
            arrays[name] = np.ascontiguousarray(array, np.float32 if kind == "f" else np.int64)
        if not alpha.size:
            raise InputError(where, "alpha", str(alpha.shape), "bake it again")
        return replace(self, **arrays)


def _folded(rows: NDArray[Any], width: int) -> NDArray[np.float32]:
    """Lay (n, c) values out as a picture (h, width, c), the end filled with zeros."""
    height = -(-len(rows) // width)
    picture = np.zeros((height * width, rows.shape[1]), np.float32)
    picture[: len(rows)] = rows
    return picture.reshape(height, width, -1)
