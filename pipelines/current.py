"""Is a baked scene up to date? If not, bake it; only then is anything of `bake` imported."""

from __future__ import annotations

import hashlib
import importlib.util
import json
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from formats.scene import Scene

MANIFEST_FORMAT = 1


def ensure(path: Path, scene: Scene, root: Path | None, build_folder: Path) -> Path:
    """Return the folder of a baked scene, baked now if the scene's or a source's bytes changed."""
    folder = build_folder / "scenes" / scene.name
    if not is_current(folder, scene, path):
        bake(path, root, build_folder)
    return folder


def bake(path: Path, root: Path | None, build_folder: Path) -> None:
    """Bake a scene, with progress on standard error; a price that it was baked by still holds."""
    from pipelines import output
    from pipelines.price_kept import bake_again

    with output.bars() as bar:
        bake_again(path, root=root, build_folder=build_folder, on_progress=bar)


def is_current(folder: Path, scene: Scene, path: Path) -> bool:
    """Tell whether a folder was baked from these files: these bytes of scene and of sources."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text())
        if manifest["format"] != MANIFEST_FORMAT or manifest["scene_sha256"] != digest(path):
            return False
        if manifest["code"] != code():
            return False
        sources: dict[str, str] = manifest["sources"]
        # The same words may name other files under another root
        if any(str(file.resolve()) not in sources for file in scene.sources.values()):
            return False
        return all(digest(Path(file)) == known for file, known in sources.items())
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def code() -> str:
    """Return the SHA-256 of the source that a bake runs, without importing it."""
    return _source("bake", "formats", "maths")


def plans() -> str:
    """Return the SHA-256 of the source that plans a bake, and puts its results together."""
    return _source("pipelines")


def _source(*packages: str) -> str:
    found = hashlib.sha256()
    for package in packages:
        spec = importlib.util.find_spec(package)
        if spec is None or spec.origin is None:
            continue
        for file in sorted(Path(spec.origin).parent.rglob("*.py")):
            found.update(file.name.encode() + b"\0" + file.read_bytes())
    return found.hexdigest()


def digest(path: Path) -> str:
    """Return the SHA-256 of a file, in hex. OSError where there is none, ValueError for a pipe."""
    # A pipe or a device would never end
    if path.is_fifo() or path.is_char_device():
        raise ValueError(f"{path} is not a regular file.")
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
