"""Photographs under a dome of lights become sixteen channels, relit by sixteen constants.

Each pixel is fitted with smooth hemispherical harmonics, and all pixels' series are brought down to
the few colours that keep most of their energy. Beside its own error at lights that it has not seen,
the report tells that of a polynomial texture map (18 numbers a pixel) and of plain hemispherical
harmonics of 3 bands (27), made from the same photographs.

References
----------
Malzbender, Gelb, Wolters 2001, Polynomial Texture Maps.
Ponchio, Corsini, Scopigno 2018, A Compact Representation of Relightable Images for the Web (PCA).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import dome_knobs, workers
from bake.dome_knobs import Knobs
from bake.photographs import Photographs
from formats.dome import Dome, coded
from formats.errors import InputError
from maths import hemispherical_harmonics as harmonics
from maths.principal_components import Components, principal_components

Array = NDArray[np.float64]
Float = NDArray[np.float32]

TILE = 4096  # pixels
SAMPLE = 1024  # pixels that choose the knobs
FITTED_SAMPLE = 1 << 18  # pixels and lights on which steps are compared where none is held out
HSH_BANDS = 3
FEWEST_LIGHTS = 6  # a polynomial texture map has as many unknowns a colour


@dataclass(frozen=True)
class Params:
    """Knobs. held_out : indices of photographs that no fit sees. bands, penalty : of the harmonics,
    0 chooses by held-out error inside the other photographs. channels : kept, four a plane."""

    held_out: tuple[int, ...] = ()
    bands: int = 0
    penalty: float = 0.0
    channels: int = 16

    def check(self, lights: int) -> None:
        """Raise InputError for the first knob that is out of its range."""
        ranges = {"bands": (0, 8), "channels": (1, 64), "penalty": (0, 100)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError("dome", name, value, f"choose from {low} to {high}")
        if not all(0 <= n < lights for n in self.held_out):
            raise InputError("dome", "held_out", list(self.held_out), f"there are {lights} lights")
        left = lights - len(set(self.held_out))
        if left < FEWEST_LIGHTS:
            remedy = f"a dome needs {FEWEST_LIGHTS} or more to fit"
            raise InputError("dome", "lights", left, remedy)


def fit(
    photographs: Photographs, *, params: Params, progress: workers.Progress = workers.silent
) -> Dome:
    """Fit, compress and quantise. InputError for knobs out of range and too few photographs."""
    lights = photographs.directions
    params.check(len(lights))
    held = np.array(sorted(set(params.held_out)), np.int64)
    train = np.setdiff1d(np.arange(len(lights)), held)
    samples = sample_of(photographs.pictures, train)
    knobs = dome_knobs.choose(
        samples, lights[train], photographs.space, params.bands, params.penalty
    )
    C = series_of(photographs, train, knobs, progress)
    flat = C.reshape(len(C), -1)
    components = principal_components(flat, params.channels)
    scores = flat @ components.vectors.T.astype(np.float32)
    codes, scales = coded(scores.reshape(*photographs.pictures.shape[1:3], -1))
    vectors = components.vectors.reshape(params.channels, -1, 3)
    dome = Dome(codes, scales, vectors, photographs.space)
    quality = described(photographs, train, knobs, components, samples)
    quality |= losses(photographs, held, C, scores, dome)
    if len(held):
        quality |= beside(photographs, train, held)
    return replace(dome, quality=quality)


def sample_of(pictures: Float, train: NDArray[np.int64]) -> Array:
    """Return some pixels (pixels, N, 3), evenly spread by the golden ratio."""
    flat = pictures.reshape(len(pictures), -1, 3)
    count = flat.shape[1]
    steps = (np.arange(min(SAMPLE, count)) + 0.5) * 0.6180339887498949 % 1
    chosen = np.arange(count) if count <= SAMPLE else (steps * count).astype(np.int64)
    return np.asarray(flat[train[:, None], chosen].transpose(1, 0, 2), np.float64)


def series_of(
    photographs: Photographs, train: NDArray[np.int64], knobs: Knobs, progress: workers.Progress
) -> Float:
    """Return the coefficients (pixels, bands^2, 3) of every pixel."""
    flat = photographs.pictures.reshape(len(photographs.pictures), -1, 3)
    lights, K = photographs.directions[train], knobs.bands**2
    C = np.empty((flat.shape[1], K, 3), np.float32)
    matrix = harmonics.fit_weights(lights, knobs.bands, knobs.penalty).matrix.astype(np.float32)

    def tile(start: int) -> None:
        part = flat[train, start : start + TILE]
        if knobs.exponent == 0:
            # Single precision: 72 products round to 1e-6, and a code is 4e-3
            made = matrix @ part.reshape(len(train), -1)
            C[start : start + TILE] = made.reshape(K, -1, 3).transpose(1, 0, 2)
            return
        for a in range(0, part.shape[1], 256):
            x = part[:, a : a + 256].transpose(1, 0, 2)
            weights = dome_knobs.weights_of(x, knobs.exponent)
            fitted = harmonics.fit_each(x, lights, knobs.bands, knobs.penalty, weights)
            C[start + a : start + a + len(x)] = fitted

    workers.map_tiles(tile, range(0, len(C), TILE), progress)
    return C


def described(
    photographs: Photographs,
    train: NDArray[np.int64],
    knobs: Knobs,
    components: Components,
    samples: Array,
) -> dict[str, Any]:
    """Return what the fit is, and its leave-one-light-out error beside that of two others."""
    lights = photographs.directions[train]
    fit = harmonics.fit_weights(lights, knobs.bands, knobs.penalty)
    quality: dict[str, Any] = {
        "lights": len(train),
        "bands": knobs.bands,
        "penalty": knobs.penalty,
        "weight_exponent": knobs.exponent,
        "condition": min(fit.condition, 1e300),
        "rank": components.rank,
        "leave_one_out_psnr": knobs.predicted,
        "notes": [*photographs.notes, *components.warnings],
    }
    for name, smoother in baselines(lights, lights).items():
        # Where a light alone determines a number, nothing can be left out
        if np.diag(smoother).max() < 1 - 1e-9:
            quality[f"leave_one_out_{name}_psnr"] = dome_knobs.linear_psnr(
                samples, smoother, photographs.space
            )
    return quality


def losses(
    photographs: Photographs, held: NDArray[np.int64], C: Float, scores: Float, dome: Dome
) -> dict[str, Any]:
    """Return the PSNR at held-out lights, or else at those fitted, and what each step costs, dB."""
    lights = held if len(held) else np.arange(len(photographs.directions))
    basis = harmonics.evaluate(photographs.directions[lights], round(C.shape[1] ** 0.5))
    constants = dome.constants(photographs.directions[lights])
    stored = dome.decoded().reshape(scores.shape)
    # Held-out lights are few and count whole; of the others some pixels do
    step = 1 if len(held) else -(-len(C) * len(lights) // FITTED_SAMPLE)
    truth = photographs.pictures.reshape(len(photographs.pictures), -1, 3)

    def errors(n: int) -> list[float]:
        weights = constants[n].astype(np.float32)
        target = dome_knobs.seen(truth[lights[n], ::step], photographs.space)
        series = np.matmul(basis[n].astype(np.float32), C[::step])
        made = (series, scores[::step] @ weights, stored[::step] @ weights)
        return [
            dome_knobs.mean_psnr([(dome_knobs.seen(v, photographs.space), target)]) for v in made
        ]

    found = np.mean(workers.map_tiles(errors, range(len(lights))), axis=0)
    name = "held_out_psnr" if len(held) else "fitted_psnr"
    return {
        name: float(found[2]),
        "loss_channels_db": float(found[0] - found[1]),
        "loss_bits_db": float(found[1] - found[2]),
    }


def baselines(lights: Array, seen_from: Array) -> dict[str, Array]:
    """Return what each other method makes of samples at `lights` (N, 3): (M, N) matrices, that give
    its values at `seen_from` (M, 3)."""
    hsh = harmonics.fit_weights(lights, HSH_BANDS, 0.0).matrix
    return {
        "ptm_18": polynomial(seen_from) @ np.linalg.pinv(polynomial(lights)),
        "hsh_27": harmonics.evaluate(seen_from, HSH_BANDS) @ hsh,
    }


def polynomial(directions: Array) -> Array:
    """Return the basis of polynomial texture maps at (..., 3): x^2, y^2, xy, x, y, 1."""
    x, y = directions[..., 0], directions[..., 1]
    return np.stack([x * x, y * y, x * y, x, y, np.ones_like(x)], axis=-1)


def beside(
    photographs: Photographs, train: NDArray[np.int64], held: NDArray[np.int64]
) -> dict[str, Any]:
    """Return the PSNR of the other methods at held-out lights, dB, in floats."""
    flat = photographs.pictures.reshape(len(photographs.pictures), -1)
    lights = photographs.directions
    quality: dict[str, Any] = {"held_out_lights": len(held)}
    for name, rows in baselines(lights[train], lights[held]).items():
        errors = []
        for row, light in zip(rows, held, strict=True):
            # Weights of 0 leave photographs out, where a copy of the rest would take their memory
            weights = np.zeros(len(flat), np.float32)
            weights[train] = row
            a, b = (dome_knobs.seen(v, photographs.space) for v in (weights @ flat, flat[light]))
            errors.append(dome_knobs.mean_psnr([(a, b)]))
        quality[f"held_out_{name}_psnr"] = float(np.mean(errors))
    return quality
