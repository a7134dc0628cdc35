"""Ways to show a sprite under any sun of the hemisphere: what the study `normal_map` compares.

Each returns a function from a direction (3,) to premultiplied linear radiance (h, w, 3) under a sun
of irradiance pi, from what 8 bits hold. A ring and a dome also take directions (n, 3) of suns which
share that irradiance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import billboard, dome, dome_report, mips
from bake.photographs import Photographs, Space
from formats.mesh import Mesh
from maths import circular_lights, hemispherical_lights, sprite_packing
from maths.colour import srgb_decode, srgb_encode
from pipelines.studies import normal_mapped

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Relit = Callable[[Array], Float]


def finer(
    mesh: Mesh, knobs: billboard.Params, common: normal_mapped.NormalMapped, texels: float
) -> Relit:
    """Return the normal map with `texels` times the texels, lit alike, shown at the common size."""
    larger = replace(knobs, resolution=round(knobs.resolution * texels**0.5))
    fine = normal_mapped.trace(mesh, larger)
    lit = replace(fine, sun=common.sun, ambient=common.ambient)
    return lambda d: normal_mapped.shown(lit.relit(d), fine.frame, common.frame)


def polynomials(training: Photographs, space: Space) -> Relit:
    """Return a polynomial texture map in 8 bits, a scale and a bias for each of 18 numbers."""
    values = in_space(training, space).pictures
    fit = np.linalg.pinv(dome_report.polynomial(training.directions))
    made = np.einsum("kn,nhwc->khwc", fit, values, optimize=True)
    low, high = (f(made, axis=(1, 2), keepdims=True) for f in (np.min, np.max))
    step = np.maximum(high - low, 1e-9) / 255
    stored = np.rint((made - low) / step) * step + low

    def relit(direction: Array) -> Float:
        basis = dome_report.polynomial(direction)
        return radiance(np.einsum("k,khwc->hwc", basis, stored), space)

    return relit


def in_space(training: Photographs, space: Space) -> Photographs:
    """Return linear photographs as they are, or as they would be stored: a fit of these cannot add
    lights, but spends its error where eyes see it."""
    if space == "linear":
        return training
    stored = srgb_encode(np.clip(training.pictures, 0, 1)).astype(np.float32)
    return replace(training, pictures=stored, space=space)


def radiance(values: NDArray[np.floating[Any]], space: Space) -> Float:
    """Return values of either space as linear ones, not below 0."""
    linear = srgb_decode(np.clip(values, 0, 1)) if space == "stored" else np.maximum(values, 0)
    return np.asarray(linear, np.float32)


def ring(mesh: Mesh, knobs: billboard.Params) -> Relit:
    """Return the sprite of `bakelight billboard`: 5 terms in 3 RGBA8 planes, 8-bit codes."""
    params = mips.Params(max_lod=0.0)
    master = billboard.trace(mesh, params=replace(knobs, held_out=0))
    board, border = mips.pack(master, params=params), mips.border_of(params)
    rows, columns = (slice(border, border + n) for n in master.alpha.shape[1:])
    planes = mips.decoded(board)[:, rows, columns]
    Y = sprite_packing.unpack(planes, board.ring.terms, board.packing, board.unpack)

    def relit(direction: Array) -> Float:
        each = circular_lights.project_sun(
            np.atleast_2d(direction),
            np.full(3, np.pi),
            board.ring.terms,
            axis=board.ring.axis,
            elevation=board.ring.elevation,
            one_sided=board.ring.one_sided,
        )
        light = each.mean(axis=0)
        return np.asarray(np.maximum(np.einsum("khwc,kc->hwc", Y, light), 0), np.float32)

    return relit


def hemisphere(training: Photographs, space: Space) -> Relit:
    """Return a dome of 15 channels and coverage in 4 RGBA8 planes, 8-bit codes."""
    made = dome.fit(in_space(training, space), params=dome.Params(coverage=True))
    left, top = (round(a - b) for a, b in zip(made.pivot, training.pivot, strict=True))
    height, width = training.pictures.shape[1:3]
    channels = made.decoded()[top : top + height, left : left + width]
    bands = round(made.components.shape[1] ** 0.5)

    def relit(direction: Array) -> Float:
        each = hemispherical_lights.project_sun(np.atleast_2d(direction), np.full(3, np.pi), bands)
        light = each.mean(axis=0)
        return radiance(channels @ made.constants(light), space)

    return relit
