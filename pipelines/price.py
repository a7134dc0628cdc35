"""Asking by price: knobs for an error or for seconds, by what a short probe of the asset measured.

A probe returns all points that are for sale, each with its knobs, error and seconds. Errors come
from a law fitted to the asset itself (`maths.price`), seconds from timing it. What was baked is
then held against rays that no fit saw; where it falls short, the law is set right and the asset is
baked again, once.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from bake import workers
from formats.errors import InputError
from maths.price import Estimate

if TYPE_CHECKING:
    from bake.recipe import Entry
    from bake.store import Store

Watch = Callable[[float], None]
Clock = Callable[[], float]
Result = TypeVar("Result")

SAFETY = 0.9  # of a target that is aimed at, and of the seconds that are left
OVERHEAD = 0.25  # seconds a bake of the store and of the check, whatever is baked
AGAIN = 1  # times that a bake which missed is done again
LARGEST_ERROR = 1.0


@dataclass(frozen=True)
class Ask:
    """target : relative error, or None. budget : seconds of wall time, or None."""

    target: float | None = None
    budget: float | None = None

    def check(self) -> None:
        """Raise InputError for what cannot be asked for."""
        if self.target is not None and not 0 < self.target <= LARGEST_ERROR:
            remedy = "write a relative error over 0, up to 1, such as 0.05"
            raise InputError("command line", "--target-error", self.target, remedy)
        if self.budget is not None and not 0 < self.budget < float("inf"):
            raise InputError("command line", "--budget", self.budget, "write seconds over 0")

    def __bool__(self) -> bool:
        return self.target is not None or self.budget is not None


@dataclass(frozen=True)
class Point:
    """What is for sale: knobs, and the error and seconds of them. bytes : for the player. tier : 0
    for at most the numbers a texel, voxel or vertex that were asked for; more cost every frame."""

    knobs: dict[str, Any]
    error: float
    seconds: float
    bytes: int = 0
    tier: int = 0


@dataclass(frozen=True)
class Prices:
    """All points of an asset. quantity : what the error is of. seconds : that the probe took."""

    quantity: str
    points: tuple[Point, ...]
    seconds: float

    @property
    def best(self) -> Point:
        """The least error, cheaply."""
        return min(self.points, key=lambda p: (p.error, p.seconds))

    @property
    def cheapest(self) -> Point:
        """The fewest seconds, with the least error among them, in tier 0."""
        usual = [point for point in self.points if point.tier == 0]
        return min(usual, key=lambda p: (p.seconds, p.error))

    def within(self, error: float) -> Point | None:
        """The cheapest bake of at most this error, of those that are cheapest to draw."""
        found = [p for p in self.points if p.error <= error]
        return min(found, key=lambda p: (p.tier, p.seconds, p.bytes, p.error)) if found else None

    def for_seconds(self, seconds: float) -> Point | None:
        """The least error in at most these seconds, and no dearer to draw than asked for."""
        found = [p for p in self.points if p.seconds <= seconds and p.tier == 0]
        return min(found, key=lambda p: (p.error, p.seconds)) if found else None

    def front(self) -> list[Point]:
        """Points of tier 0 that no other beats in both, by rising seconds."""
        kept: list[Point] = []
        usual = [point for point in self.points if point.tier == 0]
        for point in sorted(usual, key=lambda p: (p.seconds, p.error)):
            if not kept or point.error < kept[-1].error:
                kept.append(point)
        return kept

    def scaled(self, factor: float) -> Prices:
        """The same points with all errors times a factor."""
        return replace(self, points=tuple(replace(p, error=p.error * factor) for p in self.points))


class Subject(Protocol):
    """An asset that can be baked by price."""

    @property
    def name(self) -> str:
        """What errors name."""

    def probe(self, clock: Clock) -> Prices:
        """Measure what its knobs would cost. InputError for what cannot be baked."""

    def bake(self, store: Store, knobs: dict[str, Any], watch: Watch | None) -> Entry:
        """Bake it with these knobs."""

    def reached(self, store: Store, knobs: dict[str, Any]) -> Estimate:
        """Hold what was baked with these knobs against rays of their own."""


@dataclass(frozen=True)
class Deal:
    """What was promised and what came of it. error : promised; reached : measured, None before."""

    quantity: str
    asked: Ask
    knobs: dict[str, Any]
    error: float
    seconds: float
    probe_seconds: float
    reached: Estimate | None = None
    spent: float = 0.0
    bakes: int = 0
    load: float = field(default_factory=lambda: os.getloadavg()[0])

    def as_dict(self) -> dict[str, Any]:
        """Return what report.json and --json say."""
        told: dict[str, Any] = {
            "quantity": self.quantity,
            "target_error": self.asked.target,
            "budget_seconds": self.asked.budget,
            "knobs": self.knobs,
            "promised_error": self.error,
            "promised_seconds": self.seconds,
            "probe_seconds": self.probe_seconds,
            "seconds": self.spent,
            "bakes": self.bakes,
            "machine_load": round(self.load, 1),
        }
        if self.reached is not None:
            told["reached_error"] = self.reached.value
            told["reached_interval"] = [self.reached.low, self.reached.high]
        return told

    def lines(self) -> list[str]:
        """Return it in a few lines."""
        knobs = ", ".join(f"{name} {value}" for name, value in self.knobs.items())
        found = [
            f"chosen: {knobs}",
            f"promised: error {self.error:.2%}, {self.seconds:.1f} s "
            f"(probe {self.probe_seconds:.1f} s)",
        ]
        if self.reached is not None:
            found.append(
                f"reached: error {self.reached.value:.2%} "
                f"({self.reached.low:.2%} to {self.reached.high:.2%}), {self.spent:.1f} s"
            )
        return [*found, f"error: {self.quantity}"]


def choose(prices: Prices, ask: Ask, name: str, left: float | None = None) -> Point:
    """Return the point to buy. left : seconds of the budget that are left.

    Both asked for: the cheapest that meets the error, refused where it is over the budget.
    InputError that names the best there is, and its price: a bake that falls short of what was
    asked for would only look like an answer.
    """
    if left is not None:
        left = SAFETY * left - OVERHEAD
    if ask.target is not None:
        point = prices.within(SAFETY * ask.target)
        if point is None:
            best = prices.best
            remedy = f"the best is {best.error / SAFETY:.2g}, in {best.seconds:.1f} s"
            raise InputError(name, "--target-error", ask.target, remedy)
        if left is not None and point.seconds > left:
            needed = prices.seconds + (point.seconds + OVERHEAD) / SAFETY
            remedy = f"error {ask.target:g} takes {needed:.1f} s"
            raise InputError(name, "--budget", ask.budget, remedy)
        return point
    point = prices.for_seconds(float("inf") if left is None else left)
    if point is None:
        least = prices.seconds + (prices.cheapest.seconds + OVERHEAD) / SAFETY
        remedy = f"the least is {least:.1f} s, for an error of {prices.cheapest.error:.2g}"
        raise InputError(name, "--budget", ask.budget, remedy)
    return point


def shared(prices: Sequence[Prices], left: float) -> tuple[Point, ...] | None:
    """Return a point each such that the largest error is as small as the seconds left allow.

    None where even the cheapest of all take longer.
    """
    left = SAFETY * left - OVERHEAD * len(prices)
    if sum(p.cheapest.seconds for p in prices) > left:
        return None
    for level in sorted({point.error for each in prices for point in each.front()}):
        # Assets that cannot come so low take their best
        points = tuple(
            next((p for p in each.front() if p.error <= level), each.front()[-1]) for each in prices
        )
        if sum(point.seconds for point in points) <= left:
            return points
    return tuple(each.cheapest for each in prices)


def buy(
    subject: Subject, store: Store, ask: Ask, watch: Watch | None = None,
    clock: Clock = time.perf_counter,
) -> tuple[Entry, Deal]:  # fmt: skip
    """Probe, choose, bake and check one asset. InputError where nothing for sale will do."""
    ask.check()
    begun = clock()
    prices = subject.probe(clock)
    left = None if ask.budget is None else ask.budget - (clock() - begun)
    point = choose(prices, ask, subject.name, left)
    return settle(subject, store, ask, prices, point, begun, watch=watch, clock=clock)


def settle(
    subject: Subject, store: Store, ask: Ask, prices: Prices, point: Point, begun: float, *,
    watch: Watch | None = None, clock: Clock = time.perf_counter,
) -> tuple[Entry, Deal]:  # fmt: skip
    """Bake a chosen point and check it; where it misses the target, once more with a law set right.

    begun : when the probe did, by the clock.
    """
    promised = point
    for attempt in range(AGAIN + 1):
        entry = subject.bake(store, point.knobs, watch)
        reached = subject.reached(store, point.knobs)
        if ask.target is None or reached.value <= ask.target or attempt == AGAIN:
            break
        factor = reached.value / max(point.error, 1e-12)
        better = prices.scaled(factor).within(SAFETY * ask.target)
        best = prices.best
        better = better or replace(best, error=best.error * factor)
        late = ask.budget is not None and clock() - begun + better.seconds > ask.budget
        if better.knobs == point.knobs or late:
            break
        point = better
    deal = Deal(
        quantity=prices.quantity, asked=ask, knobs=point.knobs, error=promised.error,
        seconds=promised.seconds, probe_seconds=prices.seconds, reached=reached,
        spent=clock() - begun, bakes=attempt + 1,
    )  # fmt: skip
    return entry, deal


def ladder(least: int, most: int, steps: int = 2) -> tuple[int, ...]:
    """Return even counts from least to most, `steps` an octave: dense enough to pay little extra.

    >>> ladder(16, 64)
    (16, 22, 32, 46, 64)
    """
    found, n = [], 0
    while (count := 2 * round(least / 2 * 2 ** (n / steps))) <= most:
        found.append(count)
        n += 1
    return tuple(dict.fromkeys(found))


def timed(function: Callable[[], Result], clock: Clock) -> tuple[Result, float]:
    """Call a function; return its result and seconds, over 0."""
    begun = clock()
    found = function()
    return found, max(clock() - begun, 1e-6)


def alone(function: Callable[[], Result], clock: Clock) -> tuple[Result, float]:
    """As `timed`, of what runs on one thread here and on all of them in a bake."""
    found, seconds = timed(function, clock)
    return found, seconds / workers.count() if clock is time.perf_counter else seconds
