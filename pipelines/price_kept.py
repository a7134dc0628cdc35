"""The knobs that a price chose for a scene, and baking the scene again with them.

A scene that was baked by price keeps its knobs while its file and its code change, until it is
baked without a price.
"""

from __future__ import annotations

import json
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from formats import scene as scenes

if TYPE_CHECKING:
    from pipelines.bake_scene import Progress, SceneBake

Knobs = dict[str, Any]


def bake_again(
    path: Path, *, root: Path | None, build_folder: Path, on_progress: Progress | None = None
) -> SceneBake:
    """Bake a scene with the knobs of the price that it was baked by, if it was."""
    from pipelines.bake_scene import bake_scene

    told = of_folder(build_folder / "scenes" / path.stem)
    chosen = {asset: deal["knobs"] for asset, deal in told.items()}
    return bake_scene(
        path, root=root, build_folder=build_folder, on_progress=on_progress,
        adjust=partial(applied, chosen=chosen), price=told or None,
    )  # fmt: skip


def of_folder(folder: Path) -> dict[str, dict[str, Any]]:
    """Return what a baked scene's manifest says of its price, but for what was measured then."""
    try:
        price = json.loads((folder / "manifest.json").read_text())["price"]
        found = {
            str(asset): {k: v for k, v in deal.items() if not k.startswith("reached_")}
            for asset, deal in price.items()
        }
        # What is no table of knobs is nothing to bake with
        return found if all(isinstance(deal["knobs"], dict) for deal in found.values()) else {}
    except (OSError, ValueError, KeyError, AttributeError, TypeError):
        return {}


def applied(scene: scenes.Scene, chosen: dict[str, Knobs]) -> scenes.Scene:
    """Return a scene with the knobs that were chosen for its assets, where it still has them."""
    for asset, knobs in chosen.items():
        kind, name = asset.split("/")
        if kind == "billboard":
            groups = [_group(g, knobs) if g.name == name else g for g in scene.billboards]
            scene = replace(scene, billboards=tuple(groups))
        elif kind == "lightmap" and scene.voxels is not None:
            scene = replace(scene, voxels=_set(scene.voxels, {"error": knobs["error"]}))
        else:
            own = [_mesh(m, kind, knobs) if m.name == name else m for m in scene.meshes]
            scene = replace(scene, meshes=tuple(own))
    return scene


def _group(group: Any, knobs: Knobs) -> Any:
    if group.pictured:
        return group
    traced = {} if group.photographed else {k: v for k, v in knobs.items() if k == "samples"}
    lit = {k: v for k, v in knobs.items() if k != "samples"}
    under = "ring" if group.dome is None else "dome"
    return replace(group, **traced, **{under: _set(getattr(group, under), lit)})


def _mesh(placed: Any, kind: str, knobs: Knobs) -> Any:
    name = "shadow" if kind == "occlusion" else "transfer"
    table = getattr(placed, name)
    return placed if table is None else replace(placed, **{name: _set(table, knobs)})


def _set(table: Any, knobs: Knobs) -> Any:
    """Set those knobs that the table has: a ring that has become a dome has others."""
    names = {field.name for field in fields(table)}
    return replace(table, **{k: v for k, v in knobs.items() if k in names})
