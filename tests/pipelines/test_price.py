"""What is chosen for an error or for seconds, and what happens where a promise does not hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from bake.recipe import Entry
from bake.store import Store
from formats.errors import InputError
from maths.price import Estimate, Law
from pipelines import price
from pipelines.price import Ask, Point, Prices

LAW = Law(0.02, 0.8, 0.5)
COUNTS = price.ladder(16, 1 << 14)


def prices(factor: float = 1.0, law: Law = LAW) -> Prices:
    """Return points of one law, a millisecond a ray, and a dearer tier that halves the floor."""
    finer = Law(law.floor / 2, law.scale, law.power)
    points = [Point({"rays": n}, factor * law.error(n), n / 1000) for n in COUNTS]
    points += [Point({"rays": n, "x": 1}, factor * finer.error(n), n / 1000, 0, 1) for n in COUNTS]
    return Prices("of a law", tuple(points), 0.1)


def test_cheapest_of_the_error_is_bought() -> None:
    point = price.choose(prices(), Ask(0.05), "it")
    assert point.error <= price.SAFETY * 0.05
    cheaper = [p for p in prices().points if p.tier == 0 and p.seconds < point.seconds]
    assert all(p.error > price.SAFETY * 0.05 for p in cheaper)
    assert point.tier == 0


def test_what_costs_every_frame_is_bought_only_where_it_must_be() -> None:
    assert price.choose(prices(), Ask(0.015), "it").tier == 1
    assert price.choose(prices(), Ask(budget=9.0), "it", 9.0).tier == 0


def test_out_of_reach_is_refused_with_the_best() -> None:
    with pytest.raises(InputError, match=r"the best is 0\.01"):
        price.choose(prices(), Ask(0.005), "it")


def test_too_short_a_budget_is_refused_with_the_least() -> None:
    with pytest.raises(InputError, match=r"the least is 0\.4 s"):
        price.choose(prices(), Ask(budget=0.01), "it", 0.01)
    with pytest.raises(InputError, match=r"error 0\.05 takes"):
        price.choose(prices(), Ask(0.05, 0.2), "it", 0.1)


def test_budget_buys_the_least_error() -> None:
    point = price.choose(prices(), Ask(budget=1.0), "it", 1.0)
    # Steps of half an octave, and what the store takes
    assert 0.4 < point.seconds <= price.SAFETY - price.OVERHEAD


@pytest.mark.parametrize(
    ("ask", "flag"),
    [(Ask(0.0), "--target-error"), (Ask(2.0), "--target-error"), (Ask(None, -1.0), "--budget")],
)
def test_what_cannot_be_asked_for(ask: Ask, flag: str) -> None:
    with pytest.raises(InputError, match=flag):
        ask.check()


def test_seconds_are_shared_for_one_error() -> None:
    worse = prices(3.0)
    points = price.shared((prices(), worse), 6.0)
    assert points is not None
    assert sum(p.seconds for p in points) <= price.SAFETY * 6.0
    # The worse one gets more of them, and none could be better without the other being worse
    assert points[1].seconds > points[0].seconds
    assert price.shared((prices(), worse), 0.01) is None


@dataclass
class Told:
    """A subject whose bakes err by a factor of what its probe says."""

    factor: float
    name: str = "it"
    baked: list[dict[str, Any]] = field(default_factory=list)

    def probe(self, clock: price.Clock) -> Prices:
        return prices()

    def bake(self, store: Store, knobs: dict[str, Any], watch: price.Watch | None) -> Entry:
        self.baked.append(knobs)
        return Entry(Path("it"), "0" * 64, False, 0.0)

    def reached(self, store: Store, knobs: dict[str, Any]) -> Estimate:
        value = self.factor * LAW.error(knobs["rays"])
        return Estimate(value, 0.9 * value, 1.1 * value)


def test_a_miss_is_baked_again_with_the_law_set_right(tmp_path: Path) -> None:
    subject = Told(1.5)
    _, deal = price.buy(subject, Store(tmp_path), Ask(0.06))
    assert len(subject.baked) == deal.bakes == 2
    assert deal.reached is not None
    assert deal.reached.value <= 0.06
    assert deal.knobs["rays"] > subject.baked[0]["rays"]
    # The promise stays as it was made
    assert deal.error == pytest.approx(LAW.error(subject.baked[0]["rays"]))


def test_a_promise_that_holds_is_baked_once(tmp_path: Path) -> None:
    subject = Told(1.0)
    _, deal = price.buy(subject, Store(tmp_path), Ask(0.06))
    assert len(subject.baked) == deal.bakes == 1
    told = deal.as_dict()
    assert told["reached_error"] <= told["target_error"]
    assert any("promised" in line for line in deal.lines())
