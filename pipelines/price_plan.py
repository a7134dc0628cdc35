"""What a scene's assets would be bought at, told by a plan: from probes that are kept, or a prior.

Nothing is measured here, and nothing of `bake` is called.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from formats.plan import Plan
from formats.scene import Scene
from pipelines import price, price_cache
from pipelines.price import Ask, Point, Prices


@dataclass(frozen=True)
class Offer:
    """An asset's point, None where none will do. origin : "probe" or "prior"."""

    asset: str
    origin: str
    point: Point | None
    best: Point

    def as_dict(self) -> dict[str, Any]:
        """Return what --json says."""
        point = None if self.point is None else asdict(self.point)
        return {"asset": self.asset, "from": self.origin, "point": point, "best": asdict(self.best)}

    def line(self) -> str:
        """Return it in a line."""
        if self.point is None:
            told = f"out of reach; the best is {self.best.error:.2%} in {self.best.seconds:.1f} s"
        else:
            knobs = ", ".join(f"{name} {_short(value)}" for name, value in self.point.knobs.items())
            told = f"{knobs}: error {self.point.error:.2%}, {self.point.seconds:.1f} s"
        return f"{self.asset} ({self.origin}): {told}"


def offers(scene: Scene, plan: Plan, build_folder: Path, ask: Ask) -> list[Offer]:
    """Return what each asset that has a price would be bought at."""
    prices: dict[str, tuple[str, Prices]] = {}
    rest = 0.0
    for asset in plan.assets:
        if not has_price(scene, asset.name):
            rest += asset.seconds
            continue
        found = price_cache.known(build_folder, scene, asset.name)
        origin = "prior" if found is None else "probe"
        prices[asset.name] = origin, found or price_cache.prior(plan, asset)
    points: dict[str, Point | None]
    if ask.target is not None:
        points = {a: each.within(price.SAFETY * ask.target) for a, (_, each) in prices.items()}
    else:
        assert ask.budget is not None
        left = ask.budget - rest - sum(each.seconds for _, each in prices.values())
        shared = price.shared([each for _, each in prices.values()], left)
        points = dict.fromkeys(prices) if shared is None else dict(zip(prices, shared, strict=True))
    return [Offer(a, origin, points[a], each.best) for a, (origin, each) in prices.items()]


def has_price(scene: Scene, asset: str) -> bool:
    """Tell whether an asset of a plan can be bought by error or seconds."""
    kind, name = asset.split("/")
    if kind == "billboard":
        group = next(group for group in scene.billboards if group.name == name)
        return not group.pictured and not (group.photographed and group.dome is None)
    return kind in price_cache.PRIORS


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
