"""Every scene of the gallery imports, compiles and allocates its plan alone.

Its meshes and maps are replaced by tiny ones of the same names, so that baking takes no time; what
the player imports and makes hangs on the scene's words, not on what its files hold.
"""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from formats.effects import EFFECTS
from pipelines.bake_scene import bake_scene

ASSETS = Path(__file__).parents[2] / "assets"
GALLERY = sorted(path.stem for path in (ASSETS / "scenes").glob("*.toml"))
PROGRAMS = {"cells": 6}
"""Fewer than so many programs, where a scene is said to be simple."""
PLAY = """
import json, sys
from pathlib import Path
from runtime.player import Player
with Player(Path(sys.argv[1]), size=(64, 36), roaming=True) as player:
    player.frame(1.0)
    print(json.dumps({"profile": player.profile, "modules": sorted(sys.modules)}))
"""


def stand_ins(root: Path) -> None:
    """Put a tiny file in place of each mesh and map; the others are the gallery's own."""
    for source in ASSETS.rglob("*"):
        place = root / source.relative_to(ASSETS)
        if source.is_dir() or source.suffix in (".py", ".toml") or "__pycache__" in source.parts:
            continue
        place.parent.mkdir(parents=True, exist_ok=True)
        tiny = {".glb": root / "meshes/tent.glb", ".hdr": root / "environments/even.hdr"}
        shutil.copy(tiny.get(source.suffix, source), place)


def coarse(raw: dict[str, Any]) -> dict[str, Any]:
    """Return a scene with the same effects, lights and things, and as little to bake as it can."""
    raw = {**raw, "quality": "draft", "camera": still(raw["camera"])}
    for sprites in raw.get("billboards", []):
        if str(sprites.get("source", "")).endswith(".glb"):
            sprites |= {"resolution": 16, "samples": 1, "views": 1}
    for mesh in raw.get("meshes", []):
        if "shadow" in mesh:
            shadow = {k: v for k, v in mesh["shadow"].items() if k not in ("size", "l_max")}
            mesh["shadow"] = {**shadow, "grid": 4, "rays": 16, "l_max": 2, "components": 9}
            mesh["shadow"]["encoding"] = "talk"
        if mesh.get("lighting") == "transfer":
            mesh["transfer"] = {**mesh.get("transfer", {}), "rays": 8}
    if "voxels" in raw:
        raw["voxels"] |= {"texels": 1, "bounces": 0, "error": 0.5}
    return raw


def still(raw: Any) -> Any:
    """Return a camera that stays as it begins: proofs about each of its poses take seconds."""
    if isinstance(raw, dict) and "times" in raw:
        return raw["values"][0]
    return {name: still(value) for name, value in raw.items()} if isinstance(raw, dict) else raw


@pytest.mark.gpu
@pytest.mark.slow
@pytest.mark.parametrize("name", GALLERY)
def test_a_scene_of_the_gallery_is_its_plan_and_no_more(
    name: str, assets: Path, tmp_path: Path
) -> None:
    stand_ins(assets)
    raw = coarse(tomllib.loads((ASSETS / f"scenes/{name}.toml").read_text()))
    path = tmp_path / f"{name}.json"
    path.write_text(json.dumps(raw))
    folder = bake_scene(path, root=assets, build_folder=tmp_path / "build").folder
    played = subprocess.run(
        [sys.executable, "-c", PLAY, str(folder)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ,
    )
    found = json.loads(played.stdout)
    modules, profile = set(found["modules"]), found["profile"]
    # Sky and ground that no view of the scene's own sees are drawn for hands that walk around
    manifest = json.loads((folder / "manifest.json").read_text())
    called = {e["name"] for e in manifest["plan"]["effects"] if e["called"]}
    roaming = {n for n in ("sky", "ground") if n in profile["passes"]}
    assert set(profile["passes"]) == called | roaming
    prefix = "runtime.passes."
    imported = {m.removeprefix(prefix) for m in modules if m.startswith(prefix)}
    assert imported == set(profile["passes"])
    assert not [m for m in modules if m.split(".")[0] in ("bake", "embreex", "trimesh", "OpenEXR")]
    # Every program, texture, byte and draw belongs to one of them, or to what all share
    counts = profile["by_pass"]
    assert set(counts) <= {"start", "resolve", *profile["passes"]}
    for what in ("programs", "textures", "bytes", "draw_calls"):
        assert sum(row[what] for row in counts.values()) == profile[what]
    assert profile["programs"] < PROGRAMS.get(name, 100)
    # What is not called for has no asset either
    kinds = {kind for row in EFFECTS if row.name in called for kind in row.kinds}
    assert {asset.split("/")[0] for asset in manifest["assets"]} <= kinds
