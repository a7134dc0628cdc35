"""What domes cost: rays, lights and channels of a mesh, channels of photographs.

The error is that of the asset as stored, relit under lights that no fit saw, as seen (codes of
sRGB), RMS over texels as a share of its RMS. Truth of a mesh are renders of spans of texels under
lights of their own; photographs keep every `HELD`th from the fit, so that a dome that is asked for
by price is made of the others.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bake import billboard, dome, dome_knobs, dome_renders, dome_report, photographs
from bake.gather import fill, render
from bake.photographs import GRAZING, Photographs
from bake.rays import RayScene
from bake.shading import Surface
from formats.dome import Dome
from maths import hemispherical_harmonics as harmonics
from maths import price as laws
from maths.price import Estimate
from pipelines import bake_sprites, price, price_sprites
from pipelines.price_chain import Chain
from pipelines.price_sprites import FEW, MANY, SPAN, TRUTH, Spans

if TYPE_CHECKING:
    from bake.store import Store

Array = NDArray[np.float64]
Float = NDArray[np.float32]

CHOSEN = ("samples", "lights", "channels")
QUANTITY = "picture under unseen lights, as seen, RMS over texels, as a share of its RMS"
POWER = price_sprites.POWER
UNSEEN = 12  # lights of the truth
LIGHTS = (32, 64, 128)
CHANNELS = (4, 8, 16, 24, 32)
TEXEL_LIGHTS_A_SECOND = 5e6  # of a fit
HELD = 8


class DomeAsset(Chain):
    """A mesh under a dome by price; render, fit : knobs that stay as they are, but for those
    free."""

    def __init__(
        self, source: Path, render: dome_renders.Params, fit: dome.Params,
        free: tuple[str, ...] = CHOSEN,
    ) -> None:  # fmt: skip
        self.source, self.render, self.fit, self.free = source, render, fit, free
        self.name = str(source)
        self._truth: tuple[Spans, ...] = ()
        self._pictures: Float = np.zeros((0, 0, SPAN, 3), np.float32)
        self._unseen = unseen()
        self._width = 0

    def probe(self, clock: price.Clock) -> price.Prices:
        """Render and fit some texels: with few rays and many, few lights and many."""
        begun = clock()
        mesh = bake_sprites.mesh_source(self.source).load().checked("dome renders: mesh")
        sprite = self.render.sprite()
        scene = RayScene(mesh.vertices, mesh.faces)
        surface = Surface(mesh, scene, self.render.transmission, self.render.gloss)
        frame = billboard.frame_of(mesh, sprite)
        self._width = frame.width
        loaded = clock() - begun
        self._truth = price_sprites.truth_of(surface, frame, sprite)
        self._pictures = self._lit(
            surface, frame, replace(self.render, samples=TRUTH), self._unseen
        )[0]
        usual = self.render.lights
        tried = self._pictures.shape[1] * SPAN
        size = self.render.views * frame.width * frame.height
        work, seconds = [], []

        def made(samples: int, lights: int) -> Photographs:
            params = replace(self.render, samples=samples, lights=lights)
            towards = params.towards()
            (pictures, alpha), spent = price.alone(
                lambda: self._lit(surface, frame, params, towards), clock
            )
            work.append(_work(params, tried))
            seconds.append(spent)
            return Photographs(pictures, towards, "linear", coverage=alpha)

        few = made(FEW, usual)
        start = clock()
        first = dome.fit(few, params=replace(self.fit, max_lod=0.0))
        fitting = clock() - start
        known = {"bands": first.quality["bands"], "penalty": first.quality["penalty"]}

        def error(pictures: Photographs, channels: int) -> float:
            params = replace(self.fit, max_lod=0.0, channels=channels, **known)
            return self._error(pictures, dome.fit(pictures, params=params)).value

        given = self.fit.channels
        law = laws.fitted(
            [FEW, MANY], [self._error(few, first).value, error(made(MANY, usual), given)], POWER
        )
        floors = {(usual, given): law.floor}
        noise = law.error(FEW) ** 2 - law.floor**2
        choices = LIGHTS if "lights" in self.free and not self.render.directions else ()
        most = few
        for lights in (n for n in choices if n != usual):
            pictures = made(FEW, lights)
            floors[lights, given] = float(np.sqrt(max(0.0, error(pictures, given) ** 2 - noise)))
            most = pictures if lights > len(most.directions) else most
        if "channels" in self.free:
            for channels in (c for c in CHANNELS if c > given):
                lights = len(most.directions)
                floor = float(np.sqrt(max(0.0, error(most, channels) ** 2 - noise)))
                floors[lights, channels] = floor
        unit = np.maximum(laws.seconds_fitted(work, seconds), price_sprites.LEAST)
        points = []
        for (lights, channels), floor in floors.items():
            own = laws.Law(floor, law.scale, POWER)
            after = fitting + 2 * size * lights / TEXEL_LIGHTS_A_SECOND
            samples = price_sprites.SAMPLES if "samples" in self.free else (self.render.samples,)
            tier = max(0, -(-channels // 4) - -(-given // 4))
            for count in samples:
                params = replace(self.render, samples=count, lights=lights)
                spent = loaded + after + float(_work(params, size) @ unit)
                knobs = {"samples": count, "lights": lights, "channels": channels}
                bytes_ = int(size * 4 * -(-channels // 4) * 4 / 3)
                points.append(price.Point(knobs, own.error(count), spent, bytes_, tier))
        return price.Prices(QUANTITY, tuple(points), clock() - begun)

    def reached(self, store: Store, knobs: dict[str, Any]) -> Estimate:
        """Relight what is stored as the spans were lit."""
        if not self._truth:
            self.probe(lambda: 0.0)
        board = Dome.load(self.baked(store, knobs)[-1])
        width, border = self._width, int(board.quality["border"])
        found = [
            board.decoded(view=spans.view)[spans.texels(width, border)] for spans in self._truth
        ]
        return self._told(board, np.concatenate(found))

    def sprite(self, knobs: dict[str, Any]) -> bake_sprites.Sprite:
        """Return the stages that bake it with these knobs."""
        traced = replace(self.render, samples=knobs["samples"], lights=knobs["lights"])
        steps = bake_sprites.dome_of_mesh(traced, replace(self.fit, channels=knobs["channels"]))
        return bake_sprites.Sprite(bake_sprites.mesh_source(self.source), steps)

    def _lit(
        self, surface: Surface, frame: billboard.Frame, params: dome_renders.Params, towards: Array
    ) -> tuple[Float, Float]:
        """Render the spans of all views (N, n, SPAN, 3), and their coverage (n, SPAN)."""
        suns = billboard.suns(towards, params.samples, params.sun_diameter)
        sky, share = billboard.sky_of(params.samples, params.sky_fill)
        sprite, pictures, covered = params.sprite(), [], []
        for spans in self._truth:
            count = len(spans.first) * SPAN
            picture = np.zeros((len(towards), count, 3), np.float32)
            alpha = np.zeros(count, np.float32)
            hit = price_sprites.seen(surface, frame, sprite, spans.view, spans.first)
            if hit is not None:
                at, covering, shading = hit
                alpha[at] = covering
                turn = billboard.world_from_sprite(spans.view, params.views)
                ring, even = (np.ascontiguousarray(d @ turn.T, np.float32) for d in (suns, sky))
                lit = render(surface.scene, shading, ring, params.samples)
                colours = [c.reshape(params.samples, -1, 3) for c in shading.colours]
                part = np.float32(share / params.samples)
                lit += fill(surface.scene, shading, even, colours) * part
                picture[:, at] = lit * np.float32(np.pi)
            pictures.append(picture.reshape(len(towards), -1, SPAN, 3))
            covered.append(alpha.reshape(-1, SPAN))
        return np.concatenate(pictures, axis=1), np.concatenate(covered)

    def _error(self, pictures: Photographs, board: Dome) -> Estimate:
        rows, columns = pictures.pictures.shape[1:3]
        border = int(board.quality["border"])
        codes = board.decoded()[border : border + rows, border : border + columns]
        return self._told(board, codes)

    def _told(self, board: Dome, channels: Float) -> Estimate:
        return error_of(board, channels, self._unseen, self._pictures)


def unseen() -> Array:
    """Return lights of the hemisphere that no spiral of a bake has: one turned by a radian."""
    x, y, z = dome_knobs.spiral(UNSEEN, GRAZING).T
    c, s = np.cos(1.0), np.sin(1.0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=1)


def error_of(board: Dome, channels: Float, towards: Array, truth: Float) -> Estimate:
    """Return the error of channels (n, w, c) relit from (m, 3) against truth (m, n, w, 3)."""
    bands = round(board.components.shape[1] ** 0.5)
    series = np.repeat(harmonics.evaluate(towards, bands)[..., None], 3, axis=-1)
    relit = np.einsum("nwk,mkc->mnwc", channels, board.constants(series))
    made, wanted = (dome_knobs.seen(v, board.space) for v in (relit, truth))
    squares = np.mean(np.square(made - wanted), axis=(0, 2, 3))
    return laws.relative_rms(squares, np.mean(np.square(wanted), axis=(0, 2, 3)))


class PhotographsAsset(Chain):
    """Photographs under a dome by price; fit : knobs that stay as they are, but for channels.
    again : whoever asks then bakes it once more, from all photographs."""

    def __init__(
        self, source: Path, space: photographs.Space, fit: dome.Params, free: bool = True, *,
        again: bool = False,
    ) -> None:  # fmt: skip
        self.source, self.space, self.free = source, space, free
        self.name = str(source)
        self._given = bake_sprites.photographs_source(source, space)
        self._loaded: Photographs | None = None
        self.fit, self._bakes = fit, 1 + again

    def probe(self, clock: price.Clock) -> price.Prices:
        """Fit some rows of pixels with few channels and with many."""
        begun = clock()
        whole = self._load()
        loaded = clock() - begun
        self.fit = replace(self.fit, held_out=self.held())
        rows = _strip(whole)
        counts = CHANNELS if self.free else (self.fit.channels,)
        points: list[price.Point] = []
        known: dict[str, Any] = {}
        share = whole.pictures[0].size / rows.pictures[0].size
        for channels in counts:
            params = replace(self.fit, channels=channels, max_lod=0.0, **known)
            board, spent = price.timed(partial(dome.fit, rows, params=params), clock)
            if not known:
                known = {name: board.quality[name] for name in ("bands", "penalty")}
                choosing = spent
            error = self._error(rows, board).value
            lights = len(whole.directions)
            growing = 2 * whole.pictures[0].size / 3 * lights / TEXEL_LIGHTS_A_SECOND
            seconds = self._bakes * (loaded + choosing + (growing if share > 1 else 0.0))
            bytes_ = whole.pictures[0].size // 3 * 4 * -(-channels // 4)
            tier = max(0, -(-channels // 4) - -(-self.fit.channels // 4))
            points.append(price.Point({"channels": channels}, error, seconds, bytes_, tier))
        return price.Prices(QUANTITY, tuple(points), clock() - begun)

    def reached(self, store: Store, knobs: dict[str, Any]) -> Estimate:
        """Relight the photographs that were held out, all their rows."""
        return self._error(self._load(), Dome.load(self.baked(store, knobs)[-1]))

    def sprite(self, knobs: dict[str, Any]) -> bake_sprites.Sprite:
        """Return the stage that bakes it with these knobs."""
        step = bake_sprites.dome_step(replace(self.fit, **knobs))
        return bake_sprites.Sprite(self._given, (step,))

    def _load(self) -> Photographs:
        if self._loaded is None:
            self._loaded = self._given.load()
        return self._loaded

    def held(self) -> tuple[int, ...]:
        """Return the photographs that the fit does not see."""
        return self.fit.held_out or tuple(range(HELD // 2, len(self._load().directions), HELD))

    def _error(self, pictures: Photographs, board: Dome) -> Estimate:
        held = list(self.fit.held_out)
        rows, columns = pictures.pictures.shape[1:3]
        count = rows * columns
        channels = dome_report.decoded(board, pictures, np.arange(count))
        shaped = channels.reshape(rows, columns, -1)
        return error_of(board, shaped, pictures.directions[held], pictures.pictures[held])


def _strip(whole: Photographs) -> Photographs:
    """Return some rows of photographs, evenly."""
    rows, columns = whole.pictures.shape[1:3]
    count = min(rows, max(8, 8192 // columns))
    chosen = np.unique(np.linspace(0, rows - 1, count).round().astype(np.int64))
    cover = None if whole.coverage is None else whole.coverage[chosen]
    pictures = np.ascontiguousarray(whole.pictures[:, chosen])
    return Photographs(pictures, whole.directions, whole.space, coverage=cover)


def _work(params: dome_renders.Params, texels: int) -> Array:
    """Return texels, camera rays and shadow rays."""
    lights = len(params.directions) or params.lights
    rays = float(texels * params.samples)
    return np.array([texels, rays, rays * lights], np.float64)
