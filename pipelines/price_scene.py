"""A scene by price: every asset that has one is probed, and gets its share of error or seconds.

An error is asked of each asset, in its own quantity. Seconds are shared so that the largest error
is as small as they allow. What has no price (environments, meshes, cells, pictures) is
baked first, and its seconds count. Photographs are baked without those that the check needs, then
from all.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bake import cubes
from bake.lightmap import FIRST
from bake.recipe import Baked, Input
from bake.store import Store
from formats import scene as scenes
from formats.errors import InputError
from formats.plan import Plan
from pipelines import bake_cubes, bake_scene, bake_sprites, price, price_cache
from pipelines import plan as plans
from pipelines.price import Ask, Deal, Point, Prices, Subject
from pipelines.price_dome import DomeAsset, PhotographsAsset
from pipelines.price_kept import Knobs, applied
from pipelines.price_lightmap import LightmapAsset
from pipelines.price_occlusion import OcclusionAsset
from pipelines.price_plan import has_price
from pipelines.price_sprites import RingAsset
from pipelines.price_transfer import TransferAsset

if TYPE_CHECKING:
    from pipelines.bake_scene import Progress, SceneBake


@dataclass(frozen=True)
class PricedBake:
    """A scene's bake, and the deal of each asset that has a price. seconds : of all of it.
    subjects, prices : what was probed, and what that found."""

    done: SceneBake
    asked: Ask
    deals: dict[str, Deal]
    seconds: float
    subjects: dict[str, Subject]
    prices: dict[str, Prices]

    def as_dict(self) -> dict[str, Any]:
        """Return what the manifest and --json say."""
        return {
            "target_error": self.asked.target,
            "budget_seconds": self.asked.budget,
            "seconds": self.seconds,
            "assets": {name: deal.as_dict() for name, deal in self.deals.items()},
        }


def bake(
    path: Path, ask: Ask, *, root: Path | None = None, build_folder: Path = Path("build"),
    on_progress: Progress | None = None, clock: price.Clock = time.perf_counter,
) -> PricedBake:  # fmt: skip
    """Bake a scene as asked for. InputError where that cannot be, naming what can."""
    ask.check()
    begun = clock()
    scene = scenes.load(path, root)
    plan, store = plans.build(scene), Store(build_folder / "store")
    names = {asset.name for asset in plan.assets if has_price(scene, asset.name)}
    # First what has no price: a lightmap is made from it
    for name, _, run in bake_scene.jobs(scene, plan):
        if name not in names:
            run(store, None if on_progress is None else partial(on_progress, name))
    subjects = dict(subjects_of(scene, plan, store))
    prices = {name: subject.probe(clock) for name, subject in subjects.items()}
    for name, found in prices.items():
        price_cache.keep(build_folder, scene, name, found)
    left = None if ask.budget is None else ask.budget - (clock() - begun)
    points = choose(prices, ask, left, str(path))
    deals: dict[str, Deal] = {}
    # Each asset's own target; the seconds are shared out already
    own = Ask(ask.target)
    for name, subject in subjects.items():
        started = clock() - prices[name].seconds
        watch = None if on_progress is None else partial(on_progress, name)
        deals[name] = price.settle(
            subject, store, own, prices[name], points[name], started, watch=watch, clock=clock
        )[1]
    chosen = {name: deal.knobs for name, deal in deals.items()}
    told = {name: deal.as_dict() for name, deal in deals.items()}
    done = bake_scene.bake_scene(
        path, root=root, build_folder=build_folder, on_progress=on_progress,
        adjust=partial(applied, chosen=chosen), price=told,
    )  # fmt: skip
    return PricedBake(done, ask, deals, clock() - begun, subjects, prices)


def choose(prices: dict[str, Prices], ask: Ask, left: float | None, name: str) -> dict[str, Point]:
    """Return a point for each asset. left : seconds of the budget that are left."""
    if ask.target is not None:
        found = {
            asset: price.choose(each, Ask(ask.target), asset) for asset, each in prices.items()
        }
        spent = sum(point.seconds for point in found.values()) / price.SAFETY
        if left is not None and ask.budget is not None and spent > left:
            needed = ask.budget - left + spent
            remedy = f"error {ask.target:g} takes {needed:.1f} s"
            raise InputError(name, "--budget", ask.budget, remedy)
        return found
    assert left is not None
    assert ask.budget is not None
    points = price.shared(tuple(prices.values()), left)
    if points is None:
        least = sum(each.cheapest.seconds for each in prices.values()) / price.SAFETY
        remedy = f"the least is {ask.budget - left + least:.1f} s"
        raise InputError(name, "--budget", ask.budget, remedy)
    return dict(zip(prices, points, strict=True))


def subjects_of(
    scene: scenes.Scene, plan: Plan, store: Store | None
) -> Iterator[tuple[str, Subject]]:
    """List the assets of a plan that have a price; without a store, but for lightmaps."""
    meshes = {placed.name: placed for placed in scene.meshes}
    for asset in plan.assets:
        kind, name = asset.name.split("/")
        if not has_price(scene, asset.name):
            continue
        if kind == "billboard":
            group = next(group for group in scene.billboards if group.name == name)
            knobs: Any = [step.params for step in bake_sprites.of_scene(scene, group).steps]
            if group.photographed:
                yield asset.name, PhotographsAsset(group.source, "linear", *knobs, again=True)
                continue
            by: Any = DomeAsset if group.dome is not None else RingAsset
            yield asset.name, by(group.source, *knobs)
        elif kind == "occlusion":
            first, last = (step.params for step in bake_scene.occlusion_steps(meshes[name]).steps)
            yield asset.name, OcclusionAsset(meshes[name].source, first, last)
        elif kind == "transfer":
            params = bake_scene.transfer_stage(meshes[name])[2]
            yield asset.name, TransferAsset(meshes[name].source, params)
        elif store is not None:
            yield asset.name, _lightmap(scene, store)


def _lightmap(scene: scenes.Scene, store: Store) -> LightmapAsset:
    """Return the baked light of a world, whose own error stops its rays."""
    inputs: list[Input] = bake_scene.light_inputs(store, scene, True)
    params = bake_cubes.params(scene, True)
    assets = [each.load(each.entry.path) for each in inputs if isinstance(each, Baked)]
    rays = [FIRST]
    while 2 * rays[-1] <= params.rays:
        rays.append(2 * rays[-1])

    def light(count: int) -> Any:
        return cubes.light(*assets, params=replace(params, rays=count, target=0.0))

    def run(own: Store, knobs: Knobs, watch: price.Watch | None) -> Any:
        changed = applied(scene, {"lightmap/world": knobs})
        return bake_cubes.light(own, changed, inputs, True, watch)

    return LightmapAsset("lightmap/world", light, run, tuple(rays), stops=True)
