"""A scene by price: every asset that has one is probed, and gets its share of error or seconds.

An error is asked of each asset, in its own quantity. Seconds are shared so that the largest error
is as small as they allow. What has no price (environments, meshes, cells, photographs, pictures) is
baked first, and its seconds count.
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
from pipelines.price_dome import DomeAsset
from pipelines.price_lightmap import LightmapAsset
from pipelines.price_occlusion import OcclusionAsset
from pipelines.price_plan import has_price
from pipelines.price_sprites import RingAsset
from pipelines.price_transfer import TransferAsset

if TYPE_CHECKING:
    from pipelines.bake_scene import Progress, SceneBake

Knobs = dict[str, Any]


@dataclass(frozen=True)
class PricedBake:
    """A scene's bake, and the deal of each asset that has a price. seconds : of all of it."""

    done: SceneBake
    asked: Ask
    deals: dict[str, Deal]
    seconds: float

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
    on_progress: Progress | None = None,
) -> PricedBake:  # fmt: skip
    """Bake a scene as asked for. InputError where that cannot be, naming what can."""
    ask.check()
    clock = time.perf_counter
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
            subject, store, own, prices[name], points[name], started, watch=watch
        )[1]
    chosen = {name: deal.knobs for name, deal in deals.items()}
    told = {name: deal.as_dict() for name, deal in deals.items()}
    done = bake_scene.bake_scene(
        path, root=root, build_folder=build_folder, on_progress=on_progress,
        adjust=partial(applied, chosen=chosen), price=told,
    )  # fmt: skip
    return PricedBake(done, ask, deals, clock() - begun)


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
            first, last = (step.params for step in bake_sprites.of_scene(scene, group).steps)
            by: Any = DomeAsset if group.dome is not None else RingAsset
            yield asset.name, by(group.source, first, last)
        elif kind == "occlusion":
            first, last = (step.params for step in bake_scene.occlusion_steps(meshes[name]).steps)
            yield asset.name, OcclusionAsset(meshes[name].source, first, last)
        elif kind == "transfer":
            params = bake_scene.transfer_stage(meshes[name])[2]
            yield asset.name, TransferAsset(meshes[name].source, params)
        elif store is not None:
            yield asset.name, _lightmap(scene, store)


def applied(scene: scenes.Scene, chosen: dict[str, Knobs]) -> scenes.Scene:
    """Return a scene with the knobs that were chosen for its assets."""
    for asset, knobs in chosen.items():
        kind, name = asset.split("/")
        if kind == "billboard":
            groups = [_group(g, knobs) if g.name == name else g for g in scene.billboards]
            scene = replace(scene, billboards=tuple(groups))
        elif kind == "lightmap":
            assert scene.voxels is not None
            scene = replace(scene, voxels=replace(scene.voxels, error=knobs["error"]))
        else:
            own = [_mesh(m, kind, knobs) if m.name == name else m for m in scene.meshes]
            scene = replace(scene, meshes=tuple(own))
    return scene


def _group(group: Any, knobs: Knobs) -> Any:
    lit = {name: value for name, value in knobs.items() if name != "samples"}
    under = "ring" if group.dome is None else "dome"
    changed = {under: replace(getattr(group, under), **lit)}
    return replace(group, samples=knobs["samples"], **changed)


def _mesh(placed: Any, kind: str, knobs: Knobs) -> Any:
    name = "shadow" if kind == "occlusion" else "transfer"
    return replace(placed, **{name: replace(getattr(placed, name), **knobs)})


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
