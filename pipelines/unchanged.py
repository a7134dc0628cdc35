"""Is there nothing to bake? Told from bytes alone, before numpy or a scene's schema is imported."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bake import machine
from formats import seal
from formats.errors import DamagedError
from formats.scene_file import root_of
from pipelines import current

RECIPE, TIMINGS = "recipe.json", "timings.json"


@dataclass(frozen=True)
class Kept:
    """An asset that the store has, as `bake.recipe.Entry` tells of one."""

    path: Path
    key: str
    seconds: float
    hit: bool = True


@dataclass(frozen=True)
class Unchanged:
    """A baked scene that is up to date: its folder, and each asset's entry by name."""

    folder: Path
    entries: dict[str, Kept]


def look(path: Path, root: Path | None, build_folder: Path) -> Unchanged | None:
    """Return what baking a scene would find, if it would bake nothing; None where it might.

    Nothing may have changed: a byte of the scene, of its sources or of the code, a library that a
    bake used, the class of machine, a byte of the scene's folder or of an asset's in the store.
    """
    folder = build_folder / "scenes" / path.stem
    try:
        manifest = json.loads((folder / "manifest.json").read_bytes())
        if not _same(manifest, path, root):
            return None
        seal.verify(folder)
        # Sets may share an entry
        named = {asset: Path(manifest["assets"][asset]).name for asset in manifest["order"]}
        entries = {path.name[-64:]: path for path in (build_folder / "store").absolute().iterdir()}
        keys = {key[:32]: key for key in manifest["keys"]}
        kept = {name: _kept(entries[keys[name]], keys[name]) for name in set(named.values())}
        found = {asset: kept[name] for asset, name in named.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, DamagedError):
        return None
    return Unchanged(folder, found)


def _same(manifest: dict[str, Any], path: Path, root: Path | None) -> bool:
    """Tell whether a manifest was written for these bytes, by this code."""
    where = root_of(path) if root is None else root
    return (
        manifest["format"] == current.MANIFEST_FORMAT
        and "price" not in manifest
        and where is not None
        and manifest["root"] == str(where.resolve())
        and manifest["scene_sha256"] == current.digest(path)
        and all(current.digest(Path(file)) == has for file, has in manifest["sources"].items())
        and manifest["code"] == current.code()
        and manifest["plans"] == current.plans()
    )


def _kept(folder: Path, key: str) -> Kept:
    """Return the entry of a key, checked; LookupError where it would be baked anew."""
    seal.verify(folder)
    recipe = (folder / RECIPE).read_bytes()
    made = json.loads(recipe)
    libraries = made["libraries"]
    same = libraries == machine.versions(libraries) and made["machine"] == machine.name()
    if hashlib.sha256(recipe).hexdigest() != key or not same:
        raise LookupError(key)
    try:
        seconds = float(json.loads((folder / TIMINGS).read_bytes())["seconds"])
    except (OSError, ValueError, LookupError, TypeError):
        seconds = 0.0
    return Kept(folder, key, seconds)
