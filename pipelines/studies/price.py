"""Does a bake that is asked for by error or by seconds keep its word?

Assets that no law was fitted to: meshes of ours, blobs made here by chance, and files under
$BAKELIGHT_DATA, each as a shadow, a sprite, a mesh that lights itself, or a world of cubes. A
target is a multiple of the least error that the probe promises. What was reached is measured by
rays of their own; the cheapest setting that would have met the target is found by baking cheaper
ones. Seconds are processor seconds: the clock on the wall of a shared machine says little.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import process_time

from bake.store import Store
from formats.errors import InputError
from pipelines import price, price_scene
from pipelines.price import Ask, Point, Prices
from pipelines.studies.answer import PRICES, Answer, Panel, Row, lines_of, point
from pipelines.studies.interval import Interval
from pipelines.studies.price_cases import Case, cases, scene_files
from pipelines.studies.subjects import Setting

TAKES = ("mesh",)
FACTORS = (1.2, 1.6, 2.5)  # of the least error that is promised, in turn
SECONDS = (6.0, 12.0, 30.0)  # budgets of a scene: the first that is not refused


def measure(setting: Setting) -> Answer:
    """Buy every asset by error and by seconds."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as room:
        store = Store(Path(room) / "store")
        for n, case in enumerate(cases(setting, Path(room), store)):
            rows += bought(case, store, FACTORS[n % len(FACTORS)])
        for n, path in enumerate(scene_files(setting, Path(room))):
            rows += scene_bought(path, FACTORS[n % len(FACTORS)])
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
    spent, least, tried = _cheapest(case, prices, final, target)
    budget = prices.seconds + 2.5 * final.seconds + 2 * price.OVERHEAD
    started = process_time() - prices.seconds
    paid = 2 * budget  # a refusal counts as one that is not kept
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
            f"{case.name}, {case.kind}", case.kind, interval, series=case.kind, bake_seconds=spent,
            bytes=final.bytes, target=target, promised=deal.error,
            of_target=told.value / target, of_promised=told.value / deal.error,
            of_cheapest=spent / least, cheaper=tried, probe_seconds=prices.seconds,
            promised_seconds=final.seconds, of_budget=paid / budget, budget=budget,
            bakes=deal.bakes,
        )
    ]  # fmt: skip


def scene_bought(path: Path, factor: float) -> list[Row]:
    """Buy a whole scene by seconds, then by error; look for what would have done for each asset."""
    root = path.parent.parent
    with tempfile.TemporaryDirectory() as room:
        timely, budget = _in_time(path, root, Path(room))
    least = max(
        min(p.error for p in prices.points if p.tier == 0) for prices in timely.prices.values()
    )
    target = min(1.0, factor * least / price.SAFETY)
    with tempfile.TemporaryDirectory() as room:
        found = price_scene.bake(
            path, Ask(target), root=root, build_folder=Path(room), clock=process_time
        )
        spent = lowest = 0.0
        tried = 0
        for name, deal in found.deals.items():
            case, prices = Case("scene", name, found.subjects[name]), found.prices[name]
            final = next(p for p in prices.points if p.knobs == deal.knobs)
            own, cheapest, count = _cheapest(case, prices, final, target)
            spent, lowest, tried = spent + own, lowest + cheapest, tried + count
    worst = max(found.deals.values(), key=lambda deal: deal.reached.value if deal.reached else 0.0)
    told = worst.reached
    assert told is not None
    probing = sum(prices.seconds for prices in found.prices.values())
    return [
        point(
            path.stem, "scene", Interval(told.value, told.low, told.high), series="scene",
            bake_seconds=spent, target=target, promised=worst.error,
            of_target=told.value / target, of_promised=told.value / worst.error,
            of_cheapest=spent / lowest, cheaper=tried, probe_seconds=probing,
            of_budget=timely.seconds / budget, budget=budget,
            bakes=max(deal.bakes for deal in found.deals.values()),
        )
    ]  # fmt: skip


def _in_time(path: Path, root: Path, build: Path) -> tuple[price_scene.PricedBake, float]:
    """Bake a scene in some seconds; more where those are refused as too few."""
    for budget in SECONDS:
        ask = Ask(None, budget)
        try:
            found = price_scene.bake(path, ask, root=root, build_folder=build, clock=process_time)
        except InputError:
            if budget == SECONDS[-1]:
                raise
            continue
        return found, budget
    raise AssertionError


def _cheapest(case: Case, prices: Prices, final: Point, target: float) -> tuple[float, float, int]:
    """Return seconds of the chosen point, those of the cheapest that meets the target, and how many
    cheaper ones were tried."""
    spent, _ = _baked(case, final)
    least, tried = spent, _cheaper(prices, final)
    for cheaper in tried:
        seconds, error = _baked(case, cheaper)
        if error <= target:
            least = min(least, seconds)
    return spent, least, len(tried)


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
