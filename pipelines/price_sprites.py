"""What sprites of meshes under a ring of lights cost: rays a texel and terms, against renders.

The error is that of the sprite as stored, relit under lights of the ring that no fit saw, RMS over
texels as a share of the RMS of what should be there. Truth are renders with `TRUTH` rays a texel of
some spans of texels, at the sprite's own resolution: how fine that should be is another question.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bake import billboard as stage
from bake import mips
from bake.gather import fill, gather, render
from bake.rays import RayScene
from bake.shading import Shading, Surface
from formats.billboard import Billboard
from maths import circular_harmonics, sprite_packing
from maths import price as laws
from maths.price import Estimate
from pipelines import bake_sprites, price
from pipelines.price_chain import Chain

if TYPE_CHECKING:
    from bake.store import Store

Float = NDArray[np.float32]

CHOSEN = ("samples", "terms")
QUANTITY = "radiance under unseen lights of the ring, RMS over texels, as a share of its RMS"
POWER = 0.75  # of samples spread over a texel: -0.7 to -0.8 on meshes of ours
FEW, MANY, TRUTH = 4, 16, 100  # rays a texel
SAMPLES = (1, 2, 4, 8, 16, 24, 32, 48, 64, 96, 128, 192, 256)
MOST_TERMS = 13
SPANS, SPAN = 64, 24  # texels of the probe
AZIMUTHS = tuple(float(a) for a in 2 * np.pi * ((np.arange(6) * stage.GOLDEN + 0.29) % 1))
START = 0.25  # texel operations that a texel out of the mesh costs, of a ray's
LEAST = (0.0, 2e-8, 2e-8)  # seconds a texel, camera ray and shadow ray: a floor for a quick clock


@dataclass(frozen=True)
class Spans:
    """Some texels of a view: rows of `SPAN`, from texel first (n,) on, and what is true of them.

    radiance : (m, n, SPAN, 3), premultiplied, under each azimuth."""

    view: int
    first: NDArray[np.int64]
    radiance: Float

    def texels(self, width: int, border: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return rows and columns (n, SPAN) in a sprite of that width within a border."""
        row, column = np.divmod(self.first[:, None] + np.arange(SPAN), width)
        return row + border, column + border


class RingAsset(Chain):
    """A sprite by price; trace, pack : knobs that stay as they are, but for samples and terms."""

    def __init__(
        self, source: Path, trace: stage.Params, pack: mips.Params,
        free: tuple[str, ...] = CHOSEN,
    ) -> None:  # fmt: skip
        self.source, self.trace, self.pack, self.free = source, trace, pack, free
        self.name = str(source)
        self._truth: tuple[Spans, ...] = ()

    def probe(self, clock: price.Clock) -> price.Prices:
        """Light some texels with few rays and with many."""
        begun = clock()
        mesh = bake_sprites.mesh_source(self.source).load()
        self.trace.check()
        mesh = mesh.checked("billboard: mesh")
        scene = RayScene(mesh.vertices, mesh.faces)
        surface = Surface(mesh, scene, self.trace.transmission, self.trace.gloss)
        frame = stage.frame_of(mesh, self.trace)
        loaded = clock() - begun
        self._truth = truth_of(surface, frame, self.trace)
        size = self.trace.views * frame.width * frame.height
        points, tried = [], sum(len(spans.first) for spans in self._truth) * SPAN
        for knobs in self._offers():
            work, seconds, errors = [], [], []
            for samples in (FEW, MANY):
                params = self._params({"samples": samples, **knobs})
                made, spent = price.alone(partial(self._lit, surface, frame, params), clock)
                seconds.append(spent)
                work.append(_work(params, tried))
                errors.append(self._error(made, params).value)
            unit = np.maximum(laws.seconds_fitted(work, seconds), LEAST)
            law = laws.fitted([FEW, MANY], errors, POWER)
            texels = size * 4 / 3
            packing = loaded + PACKING * texels * sprite_packing.planes_of(
                knobs["terms"], self.pack.packing
            )
            tier = max(
                0, _planes(knobs, self.pack) - _planes({"terms": self.trace.terms}, self.pack)
            )
            for samples in SAMPLES if "samples" in self.free else (self.trace.samples,):
                params = self._params({"samples": samples, **knobs})
                total = packing + float(_work(params, size) @ unit)
                chosen = {"samples": samples, **knobs}
                bytes_ = int(4 * texels * _planes(knobs, self.pack))
                points.append(price.Point(chosen, law.error(samples), total, bytes_, tier))
        return price.Prices(QUANTITY, tuple(points), clock() - begun)

    def reached(self, store: Store, knobs: dict[str, Any]) -> Estimate:
        """Relight what is stored as the spans were lit."""
        if not self._truth:
            self.probe(lambda: 0.0)
        board = Billboard.load(self.baked(store, knobs)[-1])
        width, border = int(board.quality["size"][0]), mips.border_of(self.pack)
        made = [
            mips.decoded(board, view=spans.view)[:, *spans.texels(width, border)]
            for spans in self._truth
        ]
        return self._told(made, replace(self.trace, **knobs))

    def sprite(self, knobs: dict[str, Any]) -> bake_sprites.Sprite:
        """Return the stages that bake it with these knobs."""
        steps = bake_sprites.ring_of_mesh(replace(self.trace, **knobs), self.pack)
        return bake_sprites.Sprite(bake_sprites.mesh_source(self.source), steps)

    def _lit(
        self, surface: Surface, frame: stage.Frame, params: stage.Params
    ) -> list[tuple[Float, Float]]:
        return [lit(surface, frame, params, spans) for spans in self._truth]

    def _params(self, knobs: dict[str, Any]) -> stage.Params:
        return replace(self.trace, **knobs)

    def _offers(self) -> list[dict[str, int]]:
        """List terms, with as many lights as they take."""
        most = MOST_TERMS if "terms" in self.free and self.pack.unpack != "talk" else 0
        terms = [self.trace.terms, *range(self.trace.terms + 4, most + 1, 4)]
        return [{"terms": t, "lights": max(self.trace.lights, 16 * -(-3 * t // 16))}
                if t != self.trace.terms else {"terms": t, "lights": self.trace.lights}
                for t in terms]  # fmt: skip

    def _error(self, made: list[tuple[Float, Float]], params: stage.Params) -> Estimate:
        """Pack terms and coverage as the bake would, and relight them."""
        pack, found = self.pack, []
        planes = [sprite_packing.pack(terms, alpha, pack.packing) for terms, alpha in made]
        if pack.depth == "8":
            scales = sprite_packing.scales_of(np.concatenate(planes, axis=1))
            found = [
                sprite_packing.decode(sprite_packing.encode(p, scales)[0], scales) for p in planes
            ]
        return self._told(found or planes, params)

    def _told(self, planes: list[Any], params: stage.Params) -> Estimate:
        """Return the error of planes (P, n, SPAN, 4) of each of the spans."""
        basis = circular_harmonics.evaluate(np.asarray(AZIMUTHS), params.terms)
        squares, wholes = [], []
        for spans, each in zip(self._truth, planes, strict=True):
            Y = sprite_packing.unpack(each, params.terms, self.pack.packing, self.pack.unpack)
            relit = np.maximum(np.einsum("knwc,mk->mnwc", Y, basis), 0)
            squares.append(np.mean(np.square(relit - spans.radiance), axis=(0, 2, 3)))
            wholes.append(np.mean(np.square(spans.radiance, dtype=np.float64), axis=(0, 2, 3)))
        return laws.relative_rms(np.concatenate(squares), np.concatenate(wholes))


PACKING = 1.2e-7  # seconds a texel and plane, mip levels and codes: 2 cores


def truth_of(
    surface: Surface, frame: stage.Frame, params: stage.Params, spans: int = 0
) -> tuple[Spans, ...]:
    """Choose spans of texels, SPANS or as many as told, evenly, and render them."""
    views = sorted({v * params.views // min(params.views, 4) for v in range(min(params.views, 4))})
    texels = frame.width * frame.height
    count = max(1, min((spans or SPANS) // len(views), texels // SPAN))
    many = replace(params, samples=TRUTH)
    towards = circular_harmonics.ring_direction(np.asarray(AZIMUTHS), params.axis, params.elevation)
    suns = stage.suns(towards, TRUTH, params.sun_diameter)
    sky, share = stage.sky_of(TRUTH, params.sky_fill)
    found = []
    for view in views:
        turn = stage.world_from_sprite(view, params.views)
        held, even = (np.ascontiguousarray(d @ turn.T, np.float32) for d in (suns, sky))
        stride = (texels - SPAN) / max(1, count - 1) if count > 1 else 0.0
        first = np.unique(np.floor(np.arange(count) * stride).astype(np.int64))
        radiance = np.zeros((len(AZIMUTHS), len(first) * SPAN, 3), np.float32)
        hit = seen(surface, frame, many, view, first)
        if hit is not None:
            at, _, shading = hit
            made = render(surface.scene, shading, held, TRUTH)
            colours = [c.reshape(TRUTH, -1, 3) for c in shading.colours]
            made += fill(surface.scene, shading, even, colours) * np.float32(share / TRUTH)
            radiance[:, at] = made
        shape = (len(AZIMUTHS), len(first), SPAN, 3)
        found.append(Spans(view, first, radiance.reshape(shape)))
    return tuple(found)


def lit(
    surface: Surface, frame: stage.Frame, params: stage.Params, spans: Spans
) -> tuple[Float, Float]:
    """Bake spans alone: terms (K, n, SPAN, 3) and coverage (n, SPAN)."""
    size = len(spans.first) * SPAN
    terms, alpha = np.zeros((params.terms, size, 3), np.float32), np.zeros(size, np.float32)
    hit = seen(surface, frame, params, spans.view, spans.first)
    if hit is not None:
        at, covered, shading = hit
        turn = stage.world_from_sprite(spans.view, params.views)
        lights = stage.lights_of(replace(params, held_out=0))
        none = np.zeros(0, np.int64)
        terms[:, at] = gather(surface.scene, shading, lights, turn, params.samples, none).terms
        alpha[at] = covered
    return terms.reshape(params.terms, -1, SPAN, 3), alpha.reshape(-1, SPAN)


def seen(
    surface: Surface, frame: stage.Frame, params: stage.Params, view: int,
    first: NDArray[np.int64],
) -> tuple[NDArray[np.int64], Float, Shading] | None:  # fmt: skip
    """Return places among the spans' texels that see the mesh, their coverage and their hits."""
    found = []
    for n, start in enumerate(first):
        hit = stage.seen_texels(surface, frame, params, (view, int(start), int(start) + SPAN))
        if hit is not None:
            found.append((hit[0] - start + n * SPAN, hit[1], hit[2]))
    if not found:
        return None
    places, alpha, shadings = zip(*found, strict=True)
    joined = _joined(shadings, params.samples)
    return np.concatenate(places), np.concatenate(alpha), joined


def _joined(parts: Iterable[Shading], samples: int) -> Shading:
    """Put the hits (samples, texels) of several spans side by side."""
    parts = list(parts)

    def join(name: str) -> Any:
        values = [getattr(part, name) for part in parts]
        if values[0] is None or all(
            len(v) == 1 < len(p.normal) for v, p in zip(values, parts, strict=True)
        ):
            return values[0]
        rest = values[0].shape[1:]
        shaped = [v.reshape(samples, -1, *rest) for v in values]
        return np.ascontiguousarray(np.concatenate(shaped, axis=1)).reshape(-1, *rest)

    return Shading(**{field.name: join(field.name) for field in fields(Shading)})


def _work(params: stage.Params, texels: int) -> NDArray[np.float64]:
    """Return texels, camera rays and shadow rays."""
    lights = params.lights // stage.lights_of(params).turns
    return np.array([texels, texels * params.samples, texels * params.samples * lights], np.float64)


def _planes(knobs: dict[str, int], pack: mips.Params) -> int:
    return sprite_packing.planes_of(knobs["terms"], pack.packing)
