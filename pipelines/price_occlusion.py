"""What occlusion volumes cost: rays, bands and components against the shadows of round lamps.

The error is that of the share of far round lamps of `DEGREES` that each place outside the solid
sees, RMS; a lamp in full view is 1. It is measured at the voxels' centres, against rays of their
own: how coarse a grid may be between them it cannot say, so the grid stays as it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bake import compress
from bake import occlusion as stage
from formats import occlusion as kind
from formats.occlusion import Occlusion, OcclusionHarmonics
from maths import price as laws
from maths.price import Estimate
from maths.principal_components import principal_components
from pipelines import bake_sprites, price
from pipelines.price_chain import Chain

if TYPE_CHECKING:
    from bake.store import Store
    from formats.mesh import Mesh

Float = NDArray[np.float32]

CHOSEN = ("rays", "l_max", "components")
DEGREES = 20.0
QUANTITY = f"share of far round lamps of {DEGREES:g} degrees seen, RMS over places; all seen is 1"
POWER = 0.75  # of rays into cones: measured by the study `sampling_pattern`
FEW, MANY = 128, 1024  # rays of the probes
MOST_RAYS = 1 << 15
PROBE_GRID = 10
PROBE_L_MAX = 8
TOLD = 0.3  # seconds of tracing that tell what a ray takes: else 87 s were promised as 3.3
BANDS = (2, 3, 4, 5, 6, 8)
PROOF = 128  # voxels that the check looks at
COMPONENTS = (16, 24, 32, 48)
LEAST = (0.0, 0.0, 5e-9, 0.0)  # seconds a ray: less than any machine that this runs on takes


@dataclass(frozen=True)
class OcclusionAsset(Chain):
    """A mesh's volume by price; trace, pack : knobs that stay as they are, but for rays, l_max and,
    of talk, components. free : those of them that may be chosen."""

    source: Path
    trace: stage.Params
    pack: compress.Params
    free: tuple[str, ...] = CHOSEN

    @property
    def name(self) -> str:
        """What errors name."""
        return str(self.source)

    def probe(self, clock: price.Clock) -> price.Prices:
        """Trace a small grid with few rays and with many, for all bands at once."""
        begun = clock()
        mesh = bake_sprites.mesh_source(self.source).load()
        loaded = clock() - begun
        grid = max(4, min(PROBE_GRID, self.trace.grid))
        runs = [(4, 4, FEW), (grid, 2, MANY)]
        runs += [(grid, PROBE_L_MAX, FEW), (grid, PROBE_L_MAX, MANY)]
        done = [self._timed(mesh, run, clock) for run in runs]
        spans = [s for _, s in done]
        # Rays that few triangles meet end before a busy machine's clock tells what they take
        while spans[-1] - spans[0] < TOLD and runs[-1][2] * 4 <= MOST_RAYS:
            runs.append((grid, PROBE_L_MAX, 4 * runs[-1][2]))
            spans.append(self._timed(mesh, runs[-1], clock)[1])
        work = [_work(n, l_max, rays) for n, l_max, rays in runs]
        unit = np.maximum(laws.seconds_fitted(work, spans), LEAST)
        begun_proof = clock()
        proof = self._timed(mesh, (grid, PROBE_L_MAX, (PROBE_L_MAX + 1) ** 2), clock, PROOF)[0]
        fixed = clock() - begun_proof + loaded
        few, many = (
            replace(
                found, proof_voxels=proof.proof_voxels, proof_lights=proof.proof_lights,
                proof_shadow=proof.proof_shadow,
            )
            for found, _ in done[-2:]
        )  # fmt: skip
        points = []
        for l_max in self._bands():
            laws_of, packing, size = self._laws(few, many, l_max, clock)
            for count, law in laws_of.items():
                for rays in self._rays(l_max):
                    spent = fixed + packing + float(_work(self.trace.grid, l_max, rays) @ unit)
                    knobs = {"rays": rays, "l_max": l_max, "components": count}
                    tier = max(0, -(-count // 4) - -(-self.pack.components // 4))
                    bytes_ = size(count) * self.trace.grid**3 // grid**3
                    points.append(price.Point(knobs, law.error(rays), spent, bytes_, tier))
        return price.Prices(QUANTITY, tuple(points), clock() - begun)

    def reached(self, store: Store, knobs: dict[str, Any]) -> Estimate:
        """Hold the codes against the rays of the proof."""
        traced, packed = self.baked(store, knobs)
        master, asset = OcclusionHarmonics.load(traced), Occlusion.load(packed)
        return error_of(master, _stored(master, asset))

    def sprite(self, knobs: dict[str, Any]) -> bake_sprites.Sprite:
        """Return the stages that bake it with these knobs."""
        trace = replace(self.trace, rays=knobs["rays"], l_max=knobs["l_max"], proof=PROOF)
        pack = replace(self.pack, components=knobs["components"])
        steps = (
            bake_sprites.Step(stage.trace, trace, OcclusionHarmonics.load),
            bake_sprites.Step(compress.compress, pack, Occlusion.load),
        )
        return bake_sprites.Sprite(bake_sprites.mesh_source(self.source), steps)

    def _timed(
        self, mesh: Mesh, run: tuple[int, int, int], clock: price.Clock, proof: int = 0
    ) -> tuple[OcclusionHarmonics, float]:
        grid, l_max, rays = run
        params = replace(self.trace, grid=grid, l_max=l_max, rays=rays, proof=proof)
        return price.timed(lambda: stage.trace(mesh, params=params), clock)

    def _bands(self) -> tuple[int, ...]:
        return BANDS if "l_max" in self.free else (self.trace.l_max,)

    def _counts(self, l_max: int) -> tuple[int, ...]:
        given = self.pack.components
        if self.pack.encoding == "bands" or "components" not in self.free:
            return (given,)
        return tuple(sorted({min(c, (l_max + 1) ** 2) for c in {*COMPONENTS, given}}))

    def _rays(self, l_max: int) -> tuple[int, ...]:
        if "rays" not in self.free:
            return (self.trace.rays,)
        return price.ladder(max(64, (l_max + 1) ** 2 + 1), MOST_RAYS)

    def _laws(
        self, few: OcclusionHarmonics, many: OcclusionHarmonics, l_max: int, clock: price.Clock
    ) -> tuple[dict[int, laws.Law], float, Callable[[int], int]]:
        """Return the law of each number of components, and seconds and bytes of packing."""
        parts = [low_bands(master, l_max) for master in (few, many)]
        errors: dict[int, list[float]] = {}
        counts, vectors = self._counts(l_max), None
        if self.pack.encoding == "talk":
            outside = parts[1].terms.reshape(-1, (l_max + 1) ** 2)[~parts[1].inside.ravel()]
            vectors = principal_components(outside, counts[-1]).vectors.astype(np.float32)
        for count in counts:
            own = None if vectors is None else vectors[:count]
            packed = [_packed(part, self.pack, own) for part in parts]
            pairs = zip(parts, packed, strict=True)
            errors[count] = [error_of(part, terms).value for part, terms in pairs]
        # What the bake itself does, whose report is the dearer part
        begun = clock()
        asset = compress.compress(parts[1], params=self.pack)
        spent = (clock() - begun) * max(1.0, (self.trace.grid / len(few.terms)) ** 3 / 4)
        values = asset.nbytes / max(1, asset.components)
        found = {c: laws.fitted([FEW, MANY], e, POWER) for c, e in errors.items()}
        return found, spent, lambda count: int(values * 4 * -(-count // 4))


def low_bands(master: OcclusionHarmonics, l_max: int) -> OcclusionHarmonics:
    """Return what a trace with fewer bands would have found."""
    K = (l_max + 1) ** 2
    if master.terms.shape[-1] <= K:
        return master
    return replace(
        master,
        terms=np.ascontiguousarray(master.terms[..., :K]),
        error=master.error[:K],
        proof_lights=np.ascontiguousarray(master.proof_lights[..., :K]),
    )


def error_of(master: OcclusionHarmonics, terms: Float) -> Estimate:
    """Return the error of coefficients (v, K) at the voxels of the proof."""
    lamp = int(np.argmin(np.abs(np.degrees(master.proof_radii) - DEGREES)))
    hidden = master.proof_lights[lamp] @ terms[master.proof_voxels].T
    apart = np.clip(1 - hidden, 0, 1) - master.proof_shadow[lamp]
    squares = np.mean(np.square(apart, dtype=np.float64), axis=0)
    return laws.relative_rms(squares, np.ones_like(squares))


def _packed(master: OcclusionHarmonics, pack: compress.Params, vectors: Float | None) -> Float:
    """Return the coefficients (v, K) that are left once packed; vectors : components of "talk"."""
    if vectors is None:
        return _stored(master, compress.compress(master, params=pack))
    scores = master.terms.reshape(-1, master.terms.shape[-1]) @ vectors.T
    scales = np.maximum(np.abs(scores).max(axis=0), 1e-30)
    codes = kind.encode(np.asarray(scores / scales, np.float32), pack.depth)
    return np.asarray((kind.decode(codes) * scales) @ vectors, np.float32)


def _stored(master: OcclusionHarmonics, asset: Occlusion) -> Float:
    """Return the coefficients (v, K) that codes stand for at the centres of voxels."""
    if asset.coarse is None and not asset.warp:
        found = asset.decoded().reshape(-1, len(asset.basis)) @ asset.basis.astype(np.float32)
        return np.asarray(found, np.float32)
    box = master.box
    return np.asarray(asset.terms(box.to_object(box.voxel_centres(len(master.terms)))), np.float32)


def _work(grid: int, l_max: int, rays: int) -> NDArray[np.float64]:
    """Return the work of a trace: itself, voxels, rays, and rays times coefficients."""
    voxels = float(grid**3)
    return np.array([1.0, voxels, voxels * rays, voxels * rays * (l_max + 1) ** 2])
