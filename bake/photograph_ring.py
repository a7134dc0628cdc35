"""Photographs whose lights lie near one elevation become circular harmonics, as meshes do.

The lights within a tolerance of the elevation are taken; each pixel is fitted on their azimuths by
least squares, with the gates of `maths.circular_fit`. A light nearer to the axis than the ring
counts g^h in harmonic h, as it does when the sprite is lit. Lights over the ring are brighter on
most things, those under it darker: where it tells lights left out better, the fit has a term in the
height of lights over the ring, which is then dropped, so that what is left is that of the ring.

References
----------
Evans 2004, Making Pretty Pictures with D3D (case 2: the sprite may be rendered or photographed).
Frisch, Waugh 1933, Partial Time Regressions (a term fitted along, and dropped).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bake import dome, workers
from bake import photograph_ring_report as report
from bake.photographs import Photographs
from formats.billboard import Ring
from formats.coefficients import Coefficients
from formats.errors import InputError
from maths import circular_fit, circular_harmonics
from maths.circular_fit import Fit

Array = NDArray[np.float64]
Float = NDArray[np.float32]

TILE = 1 << 12  # pixels at once: 10 MB of a hundred photographs in double precision
COMPARED = 8  # one pixel of so many is kept for what packing and codes cost
LEAST_SLOPE = 0.3  # of the heights' spread that azimuths must leave unexplained, for a term in it
FEWEST_NEAR = 3  # lights near the ring that decide on that term


@dataclass(frozen=True)
class Params:
    """Knobs. elevation, tolerance : radians over the picture's plane, and how far from it a light
    may stand. terms : circular harmonics, odd. held_out : indices of photographs no fit sees."""

    elevation: float = float(np.pi / 6)
    tolerance: float = float(np.pi / 18)
    terms: int = 5
    held_out: tuple[int, ...] = ()

    def check(self, lights: int) -> None:
        """Raise InputError for the first knob that is out of its range."""
        ranges = {"elevation": (0, 1.5), "tolerance": (0, np.pi / 2), "terms": (1, 33)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError("ring", name, value, f"choose from {low:g} to {high:g}")
        if self.terms % 2 == 0:
            raise InputError("ring", "terms", self.terms, "terms must be odd: 1, 3, 5, ...")
        if not all(0 <= n < lights for n in self.held_out):
            raise InputError("ring", "held_out", list(self.held_out), f"there are {lights} lights")


def fit(
    photographs: Photographs, *, params: Params, progress: workers.Progress = workers.silent
) -> Coefficients:
    """Fit the photographs near the ring; the sprite stands on the middle of its lower edge.

    Memory beside the photographs: 12 bytes a pixel and term. InputError for knobs out of range,
    photographs that are not linear, and too few lights near the ring.
    """
    photographs = photographs.checked()
    params.check(len(photographs.directions))
    if photographs.space != "linear":
        raise InputError("ring", "space", photographs.space, "light adds up in linear space only")
    train, held = lights_of(photographs.directions, params)
    lights = photographs.directions[train]
    samples = dome.sample_of(photographs.pictures, train)
    sloped = has_slope(samples, lights, params)
    made, matrix = fitted(lights, params, sloped)
    terms = terms_of(photographs, train, matrix, progress)
    rows, width = photographs.pictures.shape[1:3]
    shape = (photographs.views, rows // photographs.views, width)
    ring = Ring("view", params.elevation, params.terms, True, len(train))
    alpha = np.ones((rows, width)) if photographs.coverage is None else photographs.coverage
    seen = held if len(held) else train
    texels = _some(shape[1], width)
    truth = photographs.pictures.reshape(len(photographs.pictures), -1, 3)
    master = Coefficients(
        terms=np.moveaxis(terms.reshape(params.terms, *shape, 3), 0, 1),
        alpha=np.asarray(alpha, np.float32).reshape(shape),
        ring=ring,
        metres_per_texel=photographs.metres_per_texel,
        pivot=photographs.pivot,
        height=photographs.height,
        held_out=truth[seen[:, None], texels] / np.float32(np.pi),
        held_out_texels=texels,
        held_out_angles=tuple(float(t) for t in _angles(photographs.directions[seen])),
    ).checked("ring")
    quality = {
        **report.described(photographs, train, made),
        **report.errors(photographs, train, held, master),
        **report.others_left_out(samples, lights),
        "leave_one_out_psnr": left_out_psnr(samples, lights, params, sloped),
        "height_term": sloped,
        "size": [width, shape[1]],
    }
    return replace(master, quality=quality)


def lights_of(directions: Array, params: Params) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return indices of the lights (n, 3) near the ring: those to fit, and those held out.

    InputError where fewer lie there than terms, and one to leave out.
    """
    elevations = np.arcsin(np.clip(directions[:, 2], -1, 1))
    # 1e-9: lights of a file that says 45 degrees are on a ring of 45 with tolerance 0
    near = np.abs(elevations - params.elevation) <= params.tolerance + 1e-9
    left_out = np.isin(np.arange(len(directions)), params.held_out)
    train, held = np.flatnonzero(near & ~left_out), np.flatnonzero(near & left_out)
    if len(train) <= params.terms:
        counts = [np.count_nonzero(np.abs(elevations - e) <= params.tolerance) for e in elevations]
        most = int(np.argmax(counts))
        found, asked = f"{len(train)} lights", f"{np.degrees(params.elevation):.4g} degrees"
        remedy = (
            f"{params.terms} terms need {params.terms + 1}; most, {counts[most]}, lie about "
            f"{np.degrees(elevations[most]):.0f}: choose that elevation, a larger tolerance or "
            "fewer terms"
        )
        within = f"{found} within {np.degrees(params.tolerance):.4g} of {asked}"
        raise InputError("ring", "lights", within, remedy)
    return train, held


def fitted(lights: Array, params: Params, sloped: bool) -> tuple[Fit, Array]:
    """Return the fit of samples under lights (n, 3), and its matrix (K, n) for all pixels.

    sloped : fit a term in the lights' height over the ring along, and drop it.
    """
    sine = np.hypot(lights[:, 0], lights[:, 1])
    gains = np.minimum(1.0, sine / np.cos(params.elevation))
    made = circular_fit.fit_weights(_angles(lights), params.terms, gains=gains)
    if not sloped:
        return made, made.matrix
    height = lights[:, 2] - np.sin(params.elevation)
    harmonics = circular_harmonics.harmonic_of(params.terms)
    basis = circular_harmonics.evaluate(made.angles, params.terms)
    basis *= made.gains[:, None] ** harmonics
    own = made.matrix @ height
    left = height - basis @ own
    square = float(left @ left)
    # Lights on a tilted ring rise with their azimuth: nothing tells the two apart
    if square <= LEAST_SLOPE**2 * float(height @ height) or square < 1e-12:
        return made, made.matrix
    return made, made.matrix - np.outer(own, left / square)


def has_slope(samples: Array, lights: Array, params: Params) -> bool:
    """Tell whether a term in the lights' height predicts those nearest to the ring better."""
    off = np.abs(np.arcsin(np.clip(lights[:, 2], -1, 1)) - params.elevation)
    near = np.flatnonzero(off <= params.tolerance / 2 + 1e-9)
    if len(near) < FEWEST_NEAR or len(lights) <= params.terms + 2:
        return False
    plain, sloped = (left_out_psnr(samples, lights, params, s, near) for s in (False, True))
    return sloped > plain


def left_out_psnr(
    samples: Array,
    lights: Array,
    params: Params,
    sloped: bool,
    among: NDArray[np.int64] | None = None,
) -> float:
    """Return the mean PSNR, as seen, at lights from fits of all others to samples (pixels, n, 3).

    among : indices of the lights that are left out in turn; None for all.
    """
    rows = report.lit(lights, params.terms, params.elevation)
    found = []
    for n in range(len(lights)) if among is None else among:
        others = np.delete(np.arange(len(lights)), n)
        weights = rows[n] @ fitted(lights[others], params, sloped)[1]
        made = np.einsum("n,pnc->pc", weights, samples[:, others])
        found.append(report.psnr(made, samples[:, n]))
    return float(np.mean(found))


def terms_of(
    photographs: Photographs, train: NDArray[np.int64], fit: Array, progress: workers.Progress
) -> Float:
    """Return the coefficients (K, pixels, 3) per unit irradiance. fit : (K, n) of `train`."""
    flat = photographs.pictures.reshape(len(photographs.pictures), -1)
    terms = np.empty((len(fit), flat.shape[1]), np.float32)

    def tile(start: int) -> None:
        own = slice(start, start + 3 * TILE)
        # Summed in double precision: codes must not depend on the kernel of BLAS
        terms[:, own] = fit @ flat[train, own].astype(np.float64) / np.pi

    workers.map_tiles(tile, range(0, flat.shape[1], 3 * TILE), progress)
    return terms.reshape(len(terms), -1, 3)


def _angles(lights: Array) -> Array:
    return np.asarray(np.arctan2(lights[:, 1] + 0.0, lights[:, 0] + 0.0))


def _some(height: int, width: int) -> NDArray[np.int64]:
    """Return one texel of COMPARED of the first view, spread over rows and columns."""
    row, column = np.divmod(np.arange(height * width), width)
    return np.flatnonzero((column + 3 * row) % COMPARED == 0)
