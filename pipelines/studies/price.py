"""Does a bake that is asked for by error or by seconds keep its word?

Assets that no law was fitted to: meshes of ours, blobs made here by chance, and files under
$BAKELIGHT_DATA, each as a shadow, a sprite, a mesh that lights itself, or a world of cubes. A
target is a multiple of the least error that the probe promises. What was reached is measured by
rays of their own; the cheapest setting that would have met the target is found by baking cheaper
ones. Seconds are processor seconds: the clock on the wall of a shared machine says little.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np

from bake import billboard, compress, dome, dome_renders, lightmap, mips, occlusion, transfer
from bake.store import Store
from formats.errors import BakelightError
from pipelines import lightmap as lightmaps
from pipelines import price
from pipelines.price import Ask, Point, Prices, Subject
from pipelines.price_dome import DomeAsset
from pipelines.price_lightmap import of_inputs
from pipelines.price_occlusion import OcclusionAsset
from pipelines.price_sprites import RingAsset
from pipelines.price_transfer import TransferAsset
from pipelines.studies.answer import PRICES, Answer, Panel, Row, lines_of, point
from pipelines.studies.interval import Interval
from pipelines.studies.subjects import MESHES, Setting

TAKES = ("mesh",)
GRID, TEXELS, DOME_TEXELS, EDGE = 12, 48, 32, 0.08
MOST_FACES = 60_000
FACTORS = (1.2, 1.6, 2.5)  # of the least error that is promised, in turn
BLOBS = 16
OUTSIDE = (
    "trimesh/models/Duck.glb", "trimesh/models/monkey.glb", "trimesh/models/rabbit.obj",
    "trimesh/models/teapot.stl", "trimesh/models/fuze.obj", "trimesh/models/boolean.glb",
    "trimesh/models/suzanne.ply", "odedstein/spot/spot_control_mesh.obj",
    "odedstein/spot/spot_low_resolution.obj", "trimesh/models/ballA.off",
    "trimesh/models/target.obj", "trimesh/models/quadknot.obj",
)  # fmt: skip
WORLDS = (
    "mmmm/vox/chr_cop1.vox", "mmmm/vox/chr_hazmat1.vox", "mmmm/vox/obj_street1.vox",
    "opengametools/demo/vox/chr_knight.vox", "opengametools/demo/vox/chr_old.vox",
    "opengametools/demo/vox/chr_rain.vox", "opengametools/demo/vox/chr_sword.vox",
    "vengi/data/tests/crabby.vox", "vengi/data/tests/robo.vox", "vengi/data/tests/rgb.vox",
    "vengi/data/tests/testao.vox", "vengi/data/tests/vox_glasses.vox",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """An asset of one kind."""

    kind: str
    name: str
    subject: Subject


def measure(setting: Setting) -> Answer:
    """Buy every asset by error and by seconds."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as room:
        store = Store(Path(room) / "store")
        for n, case in enumerate(cases(setting, Path(room), store)):
            rows += bought(case, store, FACTORS[n % len(FACTORS)])
    return answered(rows)


def answered(rows: list[Row]) -> Answer:
    """Return the answer of all purchases."""
    n = len(rows)
    within = sum(float(r["of_target"]) <= 1 for r in rows)
    worst = max(float(r["of_target"]) for r in rows)
    cheap = sum(float(r["of_cheapest"]) <= 2 for r in rows)
    timely = sum(float(r["of_budget"]) <= 1.2 for r in rows)
    return Answer(
        question="price",
        title=f"{within} of {n} reach the error that was asked for, none above {worst:.2f} times; "
        f"{timely} of {n} keep the budget within 20 %",
        truth="rays of their own, lights that no fit saw; for lightmaps, the spread of eight sets",
        rows=rows,
        unit="relative error, each kind's own",
        axes=PRICES,
        panels=(
            Panel(
                "error promised",
                "error reached",
                lines_of(rows, "promised", "error", "series"),
                None,
                ("log", "log"),
                joined=False,
            ),
        ),
        figures={
            "assets": n, "within_target": within, "worst_of_target": worst,
            "within_twice_cheapest": cheap, "within_budget": timely,
            "within_target_at_first": sum(r["bakes"] == 1 for r in rows),
        },
    )  # fmt: skip


def bought(case: Case, store: Store, factor: float) -> list[Row]:
    """Buy an asset by error, look for what would have done, and buy it by seconds."""
    begun = process_time()
    prices = case.subject.probe(process_time)
    usual = [p for p in prices.points if p.tier == 0]
    target = factor * min(p.error for p in usual) / price.SAFETY
    if target <= 0 or target > 1:
        return []
    ask = Ask(target)
    chosen = price.choose(prices, ask, case.name)
    _, deal = price.settle(case.subject, store, ask, prices, chosen, begun, clock=process_time)
    assert deal.reached is not None
    final = next(p for p in prices.points if p.knobs == deal.knobs)
    spent, _ = _baked(case, final)
    least = spent
    for cheaper in _cheaper(prices, final):
        seconds, error = _baked(case, cheaper)
        if error <= target:
            least = min(least, seconds)
    budget = prices.seconds + 2.5 * final.seconds + 2 * price.OVERHEAD
    started = process_time() - prices.seconds
    paid = 0.0
    offer = prices.for_seconds(price.SAFETY * (budget - prices.seconds) - price.OVERHEAD)
    if offer is not None:
        with tempfile.TemporaryDirectory() as room:
            found = price.settle(
                case.subject, Store(Path(room)), Ask(None, budget), prices, offer, started,
                clock=process_time,
            )[1]  # fmt: skip
        paid = found.spent
    told = deal.reached
    interval = Interval(told.value, told.low, told.high)
    return [
        point(
            case.name, case.kind, interval, series=case.kind, bake_seconds=spent,
            bytes=final.bytes, target=target, promised=deal.error,
            of_target=told.value / target, of_promised=told.value / deal.error,
            of_cheapest=spent / least, probe_seconds=prices.seconds,
            promised_seconds=final.seconds, of_budget=paid / budget, budget=budget,
            bakes=deal.bakes,
        )
    ]  # fmt: skip


def _baked(case: Case, wanted: Point) -> tuple[float, float]:
    """Bake a point from nothing; return seconds and the error that it reaches."""
    with tempfile.TemporaryDirectory() as room:
        store = Store(Path(room))
        begun = process_time()
        case.subject.bake(store, wanted.knobs, None)
        spent = process_time() - begun
        return spent, case.subject.reached(store, wanted.knobs).value


def _cheaper(prices: Prices, final: Point) -> list[Point]:
    """Return two cheaper points: the same but for fewer samples, and the cheapest of near error."""
    own = [p for p in prices.points if p.tier <= final.tier and p.seconds < 0.75 * final.seconds]
    near = sorted(own, key=lambda p: p.error)[:1]
    half = sorted(own, key=lambda p: abs(p.seconds - final.seconds / 2))[:1]
    return [p for n, p in enumerate([*near, *half]) if p not in [*near, *half][:n]]


def cases(setting: Setting, room: Path, store: Store) -> Iterator[Case]:
    """List assets, kinds in turn."""
    files = list(_files(setting, room))
    kinds = ("occlusion", "ring", "transfer", "occlusion", "ring", "dome")
    for n, file in enumerate(files):
        for kind in dict.fromkeys((kinds[n % 6], kinds[(n + 1) % 6])):
            yield Case(kind, file.stem, subject_of(kind, file))
    yield from _worlds(setting, store)


def subject_of(kind: str, file: Path) -> Subject:
    """Return a small asset of a kind, made from a mesh file."""
    if kind == "occlusion":
        return OcclusionAsset(file, occlusion.Params(grid=GRID), compress.Params())
    if kind == "ring":
        return RingAsset(file, billboard.Params(resolution=TEXELS), mips.Params(max_lod=1.0))
    if kind == "dome":
        fit = dome.Params(coverage=True, max_lod=1.0, bands=5, penalty=0.1)
        return DomeAsset(file, dome_renders.Params(resolution=DOME_TEXELS), fit, ("samples",))
    return TransferAsset(file, transfer.Params(edge=EDGE))


def _files(setting: Setting, room: Path) -> Iterator[Path]:
    if setting.source is not None:
        yield setting.source
        return
    blobs = [blob(room / f"blob_{n}.obj", n) for n in range(setting.pick(2, BLOBS))]
    data = Path(os.environ.get("BAKELIGHT_DATA", room)) / "meshes"
    outside = [data / name for name in OUTSIDE if (data / name).is_file()]
    own = sorted(MESHES.glob("*.glb"), key=lambda file: file.stat().st_size)[:12]
    for part in (blobs, outside[: setting.pick(1, 99)], own[: setting.pick(1, 99)]):
        yield from part


def _worlds(setting: Setting, store: Store) -> Iterator[Case]:
    if setting.source is not None:
        return
    sky = lightmaps.sky(store, MESHES.parent / "environments" / "soft_sky.hdr")
    data = Path(os.environ.get("BAKELIGHT_DATA", "none")) / "vox"
    for name in WORLDS[: setting.pick(1, 99)]:
        if not (data / name).is_file():
            continue
        try:
            cells = lightmaps.world(store, data / name, (), cell_size=None, grid=None)
        except BakelightError:
            continue
        params = lightmap.Params(texels=1)
        yield Case("lightmap", Path(name).stem, of_inputs(name, [cells, sky], params))


def blob(path: Path, seed: int, around: int = 36, down: int = 18) -> Path:
    """Write a closed lump of waves by chance as an OBJ file; later seeds are rougher."""
    rng = np.random.default_rng(seed)
    polar = np.pi * np.arange(1, down) / down
    turn = 2 * np.pi * np.arange(around) / around
    theta, phi = np.meshgrid(polar, turn, indexing="ij")
    toward = np.stack(
        [np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1
    )
    radius = np.ones(theta.shape)
    for _ in range(6):
        wave = rng.normal(size=3) * rng.uniform(2, 7)
        radius += (0.03 + 0.012 * seed) * np.sin(toward @ wave + rng.uniform(0, 6))
    stretch = rng.uniform(0.4, 1.0, 3)
    points = (np.maximum(radius, 0.2)[..., None] * toward * stretch).reshape(-1, 3)
    points = np.concatenate([points, [[0, stretch[1], 0], [0, -stretch[1], 0]]])
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    for i in range(down - 2):
        for j in range(around):
            a, b = i * around + j + 1, i * around + (j + 1) % around + 1
            lines.append(f"f {a} {b} {b + around} {a + around}")
    top, low, last = len(points) - 1, len(points), (down - 2) * around
    for j in range(around):
        a, b = j + 1, (j + 1) % around + 1
        lines += [f"f {top} {b} {a}", f"f {low} {last + a} {last + b}"]
    path.write_text("\n".join(lines) + "\n")
    return path
