"""How should an occlusion volume be encoded: error of the shadow against bytes, lookups, seconds?

Far round lights of 10, 20, 30 and 45 degrees at random places, the share of each that is seen,
clamped to 0..1; RMS error over points outside the solid: anywhere in the volume, and in the middles
of 32^3 voxels, where an encoding of that very grid need not interpolate and a fit to it is at its
best. The truth is 4,096 rays a point of their own, turned otherwise than those of the bake. First
encodings of one traced volume of 32^3, then the two that are shipped, by their size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bake import compress, occlusion, occlusion_inside, occlusion_proof
from bake.rays import RayScene
from formats.mesh import Mesh
from formats.occlusion import Occlusion, OcclusionHarmonics
from maths import bc7, spherical_harmonics
from maths.occlusion_shadow import occlusion_place
from maths.principal_components import principal_components
from maths.trilinear import looked_up
from pipelines.studies import stages
from pipelines.studies.answer import PRICES, Answer, Panel, Picture, Row, Shot, point
from pipelines.studies.interval import rms as rms_of
from pipelines.studies.stages import processor_seconds
from pipelines.studies.subjects import Setting

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Lookup = Callable[[Array], Float]

TAKES = ("mesh",)
GRID, RAYS, L_MAX = 32, 1024, 7
DEGREES = tuple(round(float(np.degrees(radius))) for radius in occlusion_proof.RADII)
PLACES = ("anywhere", "voxels")
TALK = compress.Params()
CITED = 1  # of DEGREES: what points are drawn by
POINTS, FLOOR = (150, 1500), (24, 48)  # quick and full: points, and a picture's points a side


def measure(setting: Setting) -> Answer:
    """Measure encodings of one volume, then each knob of the shipped ones, on several meshes."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    for bench in benches(setting, "bust", "mushrooms", "knot"):
        rows += [*table(bench, setting), *front(bench, setting)]
        shots |= bench.shots
    ratios = {size: worst(rows, size) for size in (512, 128)}
    shares = {
        size: "to".join(f" {f(found[PLACES[0]].values()):.2f} " for f in (min, max))
        for size, found in ratios.items()
    }
    title = f"Bands in 512 KiB leave{shares[512]}of the talk's error in as many bytes, in 128 KiB"
    title += f"{shares[128].rstrip()} (lights of {DEGREES[0]} to {DEGREES[-1]} degrees)"
    first = str(rows[0]["subject"])
    return Answer(
        question="occlusion_encodings",
        title=title,
        truth=f"{occlusion_proof.RAYS} rays a point of their own",
        rows=rows,
        unit=f"RMS error of the seen share of lights of {DEGREES[CITED]} degrees",
        axes={"lookups": "lookups a pixel", **PRICES},
        shots=shots,
        panels=panels([row for row in rows if row["subject"] == first]),
        table=[row for row in rows if row["part"] in ("table", "size")],
        figures={f"bands_{size}": found for size, found in ratios.items()},
    )


def benches(setting: Setting, *names: str) -> Iterator[Bench]:
    """Give each mesh with its truth."""
    for name, mesh in setting.meshes(*names).items():
        yield Bench(name, mesh, *proofs(setting, name))


@lru_cache(maxsize=4)
def proofs(setting: Setting, name: str) -> tuple[dict[str, Points], Points]:
    """Return the truth of a mesh and that of its floor, once for all studies of a run."""
    mesh = setting.meshes(name)[setting.source.stem if setting.source else name]
    points = truth(mesh, setting.pick(*POINTS), setting.seed)
    return points, floor(mesh, setting.pick(*FLOOR))


@dataclass(frozen=True)
class Points:
    """p : (m, 3), where the volume is +-1.  lights, shadow : as in `occlusion_proof.Proof`."""

    p: Array
    lights: Float
    shadow: Float


def truth(mesh: Mesh, count: int, seed: int) -> dict[str, Points]:
    """Trace what points outside the solid see, by PLACES."""
    used, faces = np.unique(mesh.faces, return_inverse=True)
    vertices, faces = mesh.vertices[used], faces.reshape(-1, 3).astype(np.int64)
    box, _, _ = occlusion.box_of(vertices)
    scene = RayScene(vertices, faces)
    oriented = occlusion_inside.is_oriented(vertices, faces)
    rng = np.random.default_rng(seed)
    anywhere = np.asarray(box.centre) + rng.uniform(-2, 2, (2 * count, 3)) * box.half_extent
    voxels = box.voxel_centres(GRID)[rng.permutation(GRID**3)[: 2 * count]]
    found = {}
    for place, points in zip(PLACES, (anywhere, voxels), strict=True):
        unit = scene.to_unit(points)
        outside = np.flatnonzero(~occlusion_inside.inside(scene, unit, oriented=oriented))
        proof = occlusion_proof.trace(scene, unit, outside[:count], count, L_MAX + 1)
        found[place] = Points(box.to_object(points[proof.voxels]), proof.lights, proof.shadow)
    return found


def floor(mesh: Mesh, side: int) -> Points:
    """Trace what side x side points of a floor under a mesh see of the same lights, turned so that
    the first stands high."""
    used, faces = np.unique(mesh.faces, return_inverse=True)
    vertices, faces = mesh.vertices[used], faces.reshape(-1, 3).astype(np.int64)
    box, _, _ = occlusion.box_of(vertices)
    scene = RayScene(vertices, faces)
    across = 1.9 * (2 * (np.arange(side) + 0.5) / side - 1)
    x, z = np.meshgrid(across, across)
    place = np.stack([x, np.full_like(x, -1.05), z], axis=-1).reshape(-1, 3)
    points = np.asarray(box.centre) + place * box.half_extent
    every = np.arange(len(points))
    proof = occlusion_proof.trace(scene, scene.to_unit(points), every, len(points), L_MAX + 1)
    # Harmonic 1 goes with y: the light that stands highest comes first
    order = np.argsort(-proof.lights[CITED, :, 1])
    return Points(box.to_object(points), proof.lights[:, order], proof.shadow[:, order])


def left(points: Points, lookup: Lookup) -> Float:
    """Return the share (r, m, s) of each light that a lookup leaves points."""
    terms = lookup(points.p)
    hidden = points.lights[..., : terms.shape[1]] @ terms.T
    return np.asarray(np.clip(1 - hidden, 0, 1), np.float32)


def grey(share: Float) -> Picture:
    """Return shares (h, w) as a picture."""
    return np.repeat(np.rint(255 * share).astype(np.uint8)[..., None], 3, axis=2)


@dataclass(frozen=True)
class Bench:
    """A mesh, its truth, and the volumes traced so far with their seconds."""

    name: str
    mesh: Mesh
    truth: dict[str, Points]
    floor: Points | None = None
    shots: dict[tuple[str, str], Shot] = field(default_factory=dict)
    traced: dict[occlusion.Params, tuple[OcclusionHarmonics, float]] = field(default_factory=dict)

    def trace(self, **knobs: int) -> tuple[OcclusionHarmonics, float]:
        """Return the volume of those knobs, once, and the processor's seconds of its rays."""
        params = occlusion.Params(**{"grid": GRID, "rays": RAYS, "l_max": L_MAX, **knobs}, proof=0)
        if params not in self.traced:
            self.traced[params] = stages.run(
                occlusion.trace, self.mesh, OcclusionHarmonics.load, params=params
            )
        return self.traced[params]

    def row(self, part: str, encoding: str, lookup: Lookup, **more: float) -> Row:
        """Return one measurement; lookup : p (m, 3) to harmonics (m, K)."""
        told: Row = {}
        for place, points in self.truth.items():
            squares = np.square(left(points, lookup) - points.shadow, dtype=np.float64)
            rms = np.sqrt(np.mean(squares, axis=(1, 2)))
            told |= {f"{place}_{d}": float(e) for d, e in zip(DEGREES, rms, strict=True)}
            if place == PLACES[0]:
                error = rms_of(squares[CITED].mean(axis=0))
        knobs = "".join(f", {n} {more[n]:g}" for n in ("grid", "l_max", "rays") if n in more)
        knobs = "" if part == "table" else f", {more.get('kib', 0):.0f} KiB{knobs}"
        found = point(
            self.name,
            encoding + knobs,
            error,
            series=encoding if part != "table" else "others",
            bake_seconds=more.get("seconds"),
            bytes=round(1024 * more["kib"]) if "kib" in more else None,
            default=part == "grid" and encoding == "talk" and more.get("grid") == GRID,
            part=part,
            encoding=encoding,
        )
        if self.floor is not None:
            pictures = (left(self.floor, lookup), self.floor.shadow)
            side = round(len(self.floor.p) ** 0.5)
            made, seen = (grey(p[CITED, 0].reshape(side, side)) for p in pictures)
            self.shots[self.name, encoding + knobs] = Shot(made, seen)
        return found | more | told

    def shipped(self, part: str, params: compress.Params, **knobs: int) -> Row:
        """Return the measurement of what a bake with those knobs ships."""
        master, seconds = self.trace(**knobs)
        asset, more = processor_seconds(compress.compress, master, params=params)
        told = {"grid": len(master.terms), "l_max": master.l_max, "rays": knobs.get("rays", RAYS)}
        told |= {"numbers": asset.components, "lookups": lookups(asset)}
        measured = {"kib": asset.nbytes / 1024, "seconds": seconds + more}
        return self.row(part, params.encoding, asset.terms, **told, **measured)


def lookups(asset: Occlusion) -> int:
    """Return how many textures the pass reads a pixel."""
    return sum(len(grid) for grid in asset.grids)


def table(bench: Bench, setting: Setting) -> Iterator[Row]:
    """Encodings of one volume of 32^3, l_max 7; a quick run leaves out the slowest codes."""
    master, seconds = bench.trace()
    terms, outside = master.terms, ~master.inside
    told = {"grid": GRID, "l_max": L_MAX, "rays": RAYS}

    def row(name: str, stored: Float, numbers: int, bits: float) -> Row:
        kib = GRID**3 * numbers * bits / 8 / 1024
        costs = {"numbers": numbers, "lookups": -(-numbers // 4), "kib": kib, "seconds": seconds}
        return bench.row("table", name, even(stored), **told, **costs)

    for count, K in ((16, 25), (16, 36), (32, 64))[: setting.pick(2, 3)]:
        vectors = principal_components(terms[outside][:, :K], count).vectors.astype(np.float32)
        scores = terms[..., :K] @ vectors.T
        if count == 16:
            yield row(f"PCA 16 of {K}, RGBA8", rounded(scores) @ vectors, 16, 8)
        if K > 25:
            yield row(f"PCA {count} of {K}, BC7", in_blocks(scores) @ vectors, count, 2)
    yield row("SH 16, RGBA8", rounded(terms[..., :16]), 16, 8)
    for K in (36, 64)[: setting.pick(1, 2)]:
        yield row(f"SH {K}, BC7", in_blocks(terms[..., :K]), K, 2)
        mixed = np.concatenate([rounded(terms[..., :4]), in_blocks(terms[..., 4:K])], axis=-1)
        yield row(f"SH 4, RGBA8 + {K - 4}, BC7", mixed, K, (8 * 4 + 2 * (K - 4)) / K)
        yield row(f"SH {K}, float", terms[..., :K], K, 32)
    about = zonal(terms[..., :36])
    yield row("zonal, l <= 5", about, 8, 8)
    left = terms[..., :25] - about[..., :25]
    vectors = principal_components(left[outside], 8).vectors.astype(np.float32)
    rest = np.zeros_like(about)
    rest[..., :25] = left @ vectors.T @ vectors
    yield row("zonal + PCA 8 of the rest of 25", about + rest, 16, 8)


def front(bench: Bench, setting: Setting) -> Iterator[Row]:
    """The shipped encodings by their size: part names the knob that sets it."""
    bands = replace(TALK, encoding="bands")
    for grid in (16, 32, 64)[: setting.pick(2, 3)]:
        yield bench.shipped("grid", TALK, grid=grid, l_max=4)
    for l_max, size in ((3, 32), (4, 64), (5, 128), (6, 256), (7, 512), (8, 1024)):
        if not setting.quick or size in (128, 512):
            yield bench.shipped("size", replace(bands, size=size), l_max=l_max)


def even(volume: Float) -> Lookup:
    """Return the lookup of harmonics (n, n, n, K) on an even grid."""
    return lambda p: looked_up(volume, occlusion_place(p))


def codes(values: Float) -> tuple[NDArray[np.uint8], Float]:
    """Return codes of 8 bits (z, y, x, c) of each component's own range, and the scales (c,)."""
    scales = np.abs(values).max(axis=(0, 1, 2))
    shares = values / np.where(scales > 0, scales, 1)
    return np.asarray(np.rint(shares * 127) + 128, np.uint8), scales


def rounded(values: Float) -> Float:
    """Return what codes of 8 bits of values (z, y, x, c) stand for."""
    stored, scales = codes(values)
    return np.asarray((stored.astype(np.float32) - 128) / 127 * scales, np.float32)


def in_blocks(values: Float) -> Float:
    """Return what BC7 in mode 6 makes of values (z, y, x, c), c a multiple of 4."""
    stored, scales = codes(values)
    whole = [
        bc7.decode_volume(bc7.encode_volume(stored[..., a : a + 4]), *values.shape[1:3])
        for a in range(0, values.shape[3], 4)
    ]
    found = np.concatenate(whole, axis=-1).astype(np.float32)
    return np.asarray((found - 128) / 127 * scales, np.float32)


def zonal(terms: Float) -> Float:
    """Return the part of harmonics (..., K) that is symmetric about their own l = 1 direction."""
    K = terms.shape[-1]
    axis = terms[..., [3, 1, 2]].reshape(-1, 3).astype(np.float64)
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.where(length > 0, axis / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
    l_max = spherical_harmonics.l_max_of(K)
    Y = np.asarray(spherical_harmonics.evaluate(axis, l_max), np.float32).reshape(terms.shape)
    found = np.empty_like(terms)
    for band in range(l_max + 1):
        own = slice(band**2, (band + 1) ** 2)
        # Sum of squares of a band's Y, whatever the direction
        along = np.sum(terms[..., own] * Y[..., own], axis=-1) * (4 * np.pi / (2 * band + 1))
        found[..., own] = along[..., None] * Y[..., own]
    return found


def worst(rows: list[Row], size: int) -> dict[str, dict[str, float]]:
    """Return the errors of bands of a size over those of the talk's 512 KiB, the worst mesh's."""
    found: dict[str, dict[str, float]] = {}
    shipped = [row for row in rows if row["part"] == "grid" and row["encoding"] == "talk"]
    talk = {row["subject"]: row for row in shipped if row["grid"] == GRID}
    for place in PLACES:
        for degrees in DEGREES:
            name = f"{place}_{degrees}"
            found.setdefault(place, {})[str(degrees)] = max(
                float(row[name]) / float(talk[row["subject"]][name])
                for row in rows
                if row["part"] == "size" and size / 2 < float(row["kib"]) <= size
            )
    return found


def panels(rows: list[Row]) -> tuple[Panel, ...]:
    """Plot the error for lights of 10 and 30 degrees against each price, of one mesh."""
    sized = [row for row in rows if row["part"] == "size"]
    falls = [float(sized[0][f"anywhere_{d}"]) / float(sized[-1][f"anywhere_{d}"]) for d in (10, 30)]
    title = f"From {float(sized[0]['kib']):.0f} to {float(sized[-1]['kib']):.0f} KiB of bands "
    title += f"lights of 10 degrees gain {falls[0]:.1f} times, of 30 {falls[1]:.1f} times"
    y, logarithms = "RMS error of the shadow factor", ("log", "log")
    rows = [row | {"block": "BC7" if str(row["encoding"]).endswith("BC7") else ""} for row in rows]

    def lines(x: str, **parts: str) -> dict[str, list[tuple[float, float]]]:
        found: dict[str, list[tuple[float, float]]] = {}
        for degrees in (10, 30):
            for name, part in parts.items():
                points = {
                    (at, float(row[f"anywhere_{degrees}"]))
                    for row in rows
                    if name in (row["encoding"], row["block"]) and row["part"] in part.split()
                    if (at := nominal(row["kib"]) if x == "kib" else float(row[x]))
                }
                if points:
                    found[f"{name}, {degrees} degrees"] = sorted(points)
        return found

    sizes = {"talk": "grid", "bands": "size", "BC7": "table"}
    return (
        Panel("KiB", y, lines("kib", **sizes), None, logarithms, title=title),
        Panel("lookups a pixel", y, lines("lookups", **sizes), None, logarithms, joined=False),
    )


def nominal(kib: float | int | str) -> float:
    """Return the power of two that a size is within 4 % of, or 0.

    >>> nominal(505.0), nominal(128), nominal(288)
    (512.0, 128.0, 0.0)
    """
    exponent = float(np.log2(float(kib)))
    return 2.0 ** round(exponent) if abs(exponent - round(exponent)) < 0.06 else 0.0
