"""What studies of relit sprites share: the error at held-out lights with its interval, and what a
sprite looks like under one of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import billboard, dome_renders, mips
from formats.billboard import Billboard
from formats.coefficients import Coefficients
from formats.mesh import Mesh
from maths import circular_harmonics, sprite_packing
from maths.colour import srgb_encode
from pipelines.studies.answer import Picture, Shot
from pipelines.studies.interval import Interval, rms

Float = NDArray[np.float32]

UNIT = "RMS error at held-out lights, share of the brightest value"
AZIMUTH = 0.7  # of the light that pictures are taken under
BACKDROP = 0.18  # what pictures stand before, linear


def held_out(master: Coefficients, terms: Float | None = None) -> Interval:
    """Return the error of terms (K, h, w, 3) of view 0 at the held-out lights, over the brightest
    value there; the spread is that between lights."""
    made = billboard.held_out_relit(master, master.terms[0] if terms is None else terms)
    apart = (made - master.held_out).astype(np.float64) / (float(master.held_out.max()) or 1.0)
    return rms(np.mean(np.square(apart), axis=(1, 2)))


def stored(board: Billboard, master: Coefficients) -> Float:
    """Return the terms (K, h, w, 3) that the codes of a sprite give, without its border."""
    border = int(board.quality["border"])
    rows, columns = (slice(border, border + n) for n in master.alpha.shape[1:])
    planes = mips.decoded(board)[:, rows, columns]
    return sprite_packing.unpack(planes, master.ring.terms, board.packing, board.unpack)


def rendered(
    mesh: Mesh, master: Coefficients, azimuth: float = AZIMUTH, elevation: float | None = None
) -> Float:
    """Return the sprite (h, w, 3) under one light of its ring, traced: premultiplied radiance under
    unit irradiance."""
    ring = master.ring
    height = ring.elevation if elevation is None else elevation
    towards = circular_harmonics.ring_direction(np.array([azimuth]), ring.axis, height)[0]
    params = dome_renders.Params(
        resolution=max(master.alpha.shape[1:]),
        samples=16,
        directions=((float(towards[0]), float(towards[1]), float(towards[2])),),
    )
    picture = dome_renders.render(mesh, params=params).pictures[0]
    return np.asarray(picture / np.float32(np.pi), np.float32)


@dataclass(frozen=True, eq=False)
class Stage:
    """One sprite under one light: radiance (h, w, 3) as traced, alpha (h, w), the azimuth."""

    truth: Float
    alpha: Float
    azimuth: float = AZIMUTH

    def shot(self, terms: Float) -> Shot:
        """Return what terms (K, h, w, 3) make of it beside the truth."""
        return self.shot_of(relit(terms, self.azimuth))

    def shot_of(self, radiance: Float) -> Shot:
        """Return radiance (h, w, 3) beside the truth."""
        peak = peak_of(self.truth)
        return Shot(seen(radiance, self.alpha, peak), seen(self.truth, self.alpha, peak))


def stage(mesh: Mesh, master: Coefficients) -> Stage:
    """Render the truth that a sprite's pictures are compared with."""
    return Stage(rendered(mesh, master), master.alpha[0])


def relit(terms: Float, azimuth: float = AZIMUTH) -> Float:
    """Return terms (K, h, w, 3) under one light of the ring, clamped at 0."""
    basis = circular_harmonics.evaluate(np.asarray(azimuth), len(terms)).astype(np.float32)
    return np.asarray(np.maximum(np.einsum("khwc,k->hwc", terms, basis), 0))


def seen(radiance: Float, alpha: Float, peak: float) -> Picture:
    """Return premultiplied radiance (h, w, 3) before a grey backdrop, as a screen shows it."""
    over = 0.9 * radiance / (peak or 1.0) + BACKDROP * (1 - alpha[..., None])
    return np.asarray(np.rint(255 * srgb_encode(np.clip(over, 0, 1))), np.uint8)


def peak_of(radiance: Float) -> float:
    """Return what all but a thousandth of the lit values stay below."""
    lit = radiance[radiance > 0]
    return float(np.quantile(lit, 0.999)) if lit.size else 1.0
