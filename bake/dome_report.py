"""How good a dome is: its error at unseen lights beside that of two other methods, and its limits.

References
----------
Malzbender, Gelb, Wolters 2001, Polynomial Texture Maps (18 numbers a pixel).
Gautron et al. 2004, A Novel Hemispherical Basis (plain harmonics of 3 bands, 27 numbers).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import dome_knobs, workers
from bake.dome_knobs import Knobs
from bake.photographs import GRAZING, Photographs
from formats import dome as kind
from formats.dome import Dome
from maths import hemispherical_harmonics as harmonics
from maths.principal_components import Components

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

TILE = 4096  # pixels
COMPARED = 1 << 17  # pixels and lights on which steps are compared
HSH_BANDS = 3
EXTREMES = 64  # lights under which the extremes are sought
WIDE_GAP = 35.0  # degrees from a light, from where on an answer is a guess
FARTHEST = 2.0  # times the range of the photographs, from where on a note is due


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fit before its codes. train, held : photographs. covered : pixels, None for all."""

    photographs: Photographs
    train: Indices
    held: Indices
    covered: Indices | None
    knobs: Knobs
    components: Components

    @property
    def lights(self) -> Array:
        """Directions (N, 3) that were fitted."""
        return self.photographs.directions[self.train]

    def pixels(self) -> Indices:
        """Return the covered pixels."""
        count = self.photographs.pictures[0].size // 3
        return np.arange(count) if self.covered is None else self.covered


def quality_of(fitted: Fitted, asset: Dome, samples: Array) -> dict[str, Any]:
    """Return what the report of a dome says. samples : pixels (n, N, 3) for leave-one-out errors
    of the other methods."""
    quality = described(fitted, samples)
    if len(fitted.held):
        quality |= beside(fitted, asset)
    lowest, highest, notes = extremes(fitted, asset)
    degrees, gap = largest_gap(fitted.lights)
    quality |= {"minimum": lowest, "maximum": highest, "largest_gap_degrees": degrees}
    quality["notes"] = [*quality["notes"], *gap, *notes]
    return quality


def described(fitted: Fitted, samples: Array) -> dict[str, Any]:
    """Return what the fit is, and its leave-one-light-out error beside that of two others."""
    knobs, components, space = fitted.knobs, fitted.components, fitted.photographs.space
    fit = harmonics.fit_weights(fitted.lights, knobs.bands, knobs.penalty)
    quality: dict[str, Any] = {
        "lights": len(fitted.train),
        "bands": knobs.bands,
        "penalty": knobs.penalty,
        "weight_exponent": knobs.exponent,
        "condition": min(fit.condition, 1e300),
        "amplification": knobs.amplification,
        "rank": components.rank,
        "leave_one_out_psnr": knobs.predicted,
        "notes": [*fitted.photographs.notes, *components.warnings, *knobs.notes],
    }
    for name, smoother in baselines(fitted.lights, fitted.lights).items():
        # Where a light alone determines a number, nothing can be left out
        if np.diag(smoother).max() < 1 - 1e-9:
            quality[f"leave_one_out_{name}_psnr"] = dome_knobs.linear_psnr(samples, smoother, space)
    return quality


def losses(
    fitted: Fitted, asset: Dome, pixels: Indices, steps: tuple[Float, Float, Float]
) -> dict[str, Any]:
    """Return what each step costs, dB, at held-out lights or else at those fitted: fewer channels,
    one less of them for coverage, and codes.

    pixels : some (n,). steps : their series (n, bands^2, 3), and channels (n, J), the second time
    without the one that coverage takes.
    """
    photographs, space = fitted.photographs, fitted.photographs.space
    lights = fitted.held if len(fitted.held) else fitted.train
    basis = harmonics.evaluate(photographs.directions[lights], fitted.knobs.bands)
    step = -(-len(pixels) * len(lights) // COMPARED)
    pixels = pixels[::step]
    series, wide, kept = (values[::step].reshape(len(pixels), -1) for values in steps)
    vectors = fitted.components.vectors.reshape(wide.shape[1], -1, 3)
    full = np.einsum("nj,kjc->nkc", basis, vectors).astype(np.float32)
    stored = decoded(asset, photographs, pixels)
    truth = photographs.pictures.reshape(len(photographs.pictures), -1, 3)

    def errors(n: int) -> list[float]:
        weights = np.kron(basis[n][:, None], np.eye(3)).astype(np.float32)
        few = full[n, : asset.channels]
        target = dome_knobs.seen(truth[lights[n], pixels], space)
        made = (series @ weights, wide @ full[n], kept @ few, stored @ few)
        return [dome_knobs.psnr_of(_square(dome_knobs.seen(v, space), target)) for v in made]

    found = np.mean(workers.map_tiles(errors, range(len(lights))), axis=0)
    names = ("loss_channels_db", "loss_coverage_db", "loss_bits_db")
    lost = {name: float(found[i] - found[i + 1]) for i, name in enumerate(names)}
    if not asset.coverage:
        del lost["loss_coverage_db"]
    return lost if len(fitted.held) else lost | {"fitted_psnr": float(found[3])}


def _square(a: Array, b: Array) -> float:
    return float(np.mean(np.square(a - b)))


def decoded(asset: Dome, photographs: Photographs, pixels: Indices) -> Float:
    """Return the channels (n, channels) that the codes give some pixels."""
    height, width = photographs.pictures.shape[1:3]
    border, (across, down) = int(asset.quality["border"]), asset.size
    row, column = np.divmod(pixels, width)
    view, row = np.divmod(row, height // asset.views)
    codes = asset.levels[0].reshape(asset.views, asset.planes, down, across, 4)
    chosen = np.moveaxis(codes[view, :, row + border, column + border], 1, 0)
    planes = kind.decode(chosen, asset.scales, asset.coverage)
    by_slot = np.moveaxis(planes, 0, 1).reshape(len(pixels), -1)
    return by_slot[:, kind.slots(asset.channels, asset.coverage)]


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


def beside(fitted: Fitted, asset: Dome) -> dict[str, Any]:
    """Return the PSNR at held-out lights of the stored dome, and of the other methods in floats."""
    photographs, held, train = fitted.photographs, fitted.held, fitted.train
    flat = photographs.pictures.reshape(len(photographs.pictures), -1, 3)
    lights, space = photographs.directions, photographs.space
    others = baselines(lights[train], lights[held])
    # Weights of 0 leave photographs out, where a copy of the rest would take their memory
    rows = np.zeros((len(others), len(held), len(flat)), np.float32)
    rows[:, :, train] = np.array(list(others.values()))
    ours = colours_of(asset, lights[held])
    pixels = fitted.pixels()

    def squares(start: int) -> Array:
        chosen = pixels[start : start + TILE]
        part = flat[:, chosen]
        target = dome_knobs.seen(part[held], space)
        made = [np.einsum("pj,jlc->lpc", decoded(asset, photographs, chosen), ours, optimize=True)]
        made += [np.tensordot(r, part, (1, 0)) for r in rows]
        errors = [np.square(dome_knobs.seen(v, space) - target).sum(axis=(1, 2)) for v in made]
        return np.array(errors)

    total = np.sum(workers.map_tiles(squares, range(0, len(pixels), TILE)), axis=0)
    means = total / (3 * len(pixels))
    found = [float(np.mean([dome_knobs.psnr_of(m) for m in method])) for method in means]
    names = ("held_out_psnr", *(f"held_out_{name}_psnr" for name in others))
    return {"held_out_lights": len(held), **dict(zip(names, found, strict=True))}


def colours_of(asset: Dome, directions: Array) -> Float:
    """Return the colours (channels, L, 3) by which channels count under suns of irradiance pi."""
    bands = round(asset.components.shape[1] ** 0.5)
    basis = harmonics.evaluate(directions, bands)
    return np.asarray(np.einsum("lj,kjc->klc", basis, asset.components), np.float32)


def extremes(fitted: Fitted, asset: Dome) -> tuple[float, float, list[str]]:
    """Return the lowest and highest relit values, before any clamp, over lights of the whole
    hemisphere, and a note where they leave the photographs' range far behind."""
    lights, photographs = dome_knobs.spiral(EXTREMES, 0.0), fitted.photographs
    weights, pixels = colours_of(asset, lights).reshape(asset.channels, -1), fitted.pixels()

    def of(start: int) -> tuple[Float, Float, float, float]:
        chosen = pixels[start : start + TILE]
        made = decoded(asset, photographs, chosen) @ weights
        seen = photographs.pictures.reshape(len(photographs.pictures), -1, 3)
        part = seen[:, chosen[0] : chosen[-1] + 1]
        return made.min(axis=0), made.max(axis=0), float(part.min()), float(part.max())

    found = workers.map_tiles(of, range(0, len(pixels), TILE))
    low = np.min([f[0] for f in found], axis=0).reshape(-1, 3).min(axis=1)
    high = np.max([f[1] for f in found], axis=0).reshape(-1, 3).max(axis=1)
    bottom, top = min(0.0, *(f[2] for f in found)), max(f[3] for f in found)
    # Above and below, as a share of the photographs' range
    beyond = np.maximum(high - top, bottom - low)
    worst, notes = int(np.argmax(beyond)), []
    if beyond[worst] > (FARTHEST - 1) * (top - bottom):
        notes.append(
            f"a light {place(lights[worst])} gives values from {low[worst]:.3g} to "
            f"{high[worst]:.3g}, and the photographs have {bottom:.3g} to {top:.3g}"
        )
    return float(low.min()), float(high.max()), notes


def largest_gap(lights: Array) -> tuple[float, list[str]]:
    """Return how far, in degrees, a light of the hemisphere can stand from all those fitted, and a
    note that names the place where that is far."""
    points = dome_knobs.spiral(2048, GRAZING)
    nearest = np.max(points @ lights.T, axis=1)
    worst = int(np.argmin(nearest))
    degrees = float(np.degrees(np.arccos(np.clip(nearest[worst], -1, 1))))
    if degrees <= WIDE_GAP:
        return degrees, []
    return degrees, [
        f"no light stands within {degrees:.0f} degrees of one {place(points[worst])}: "
        "answers there are a guess"
    ]


def place(direction: Array) -> str:
    """Return where a light stands, in words."""
    elevation = np.degrees(np.arcsin(np.clip(direction[2], -1, 1)))
    azimuth = np.degrees(np.arctan2(direction[1], direction[0])) % 360
    return f"at azimuth {azimuth:.0f}, elevation {elevation:.0f} degrees"
