"""Which examination a file gets, by its suffix; scenes are looked at with the files they name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from formats.errors import BakelightError, InputError
from pipelines import doctor_meshes, doctor_pictures
from pipelines.diagnosis import Diagnosis

PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".exr", ".hdr")


def examine(path: Path) -> Diagnosis:
    """Look at one file. InputError for what is not there, no file, or cannot be read."""
    if path.is_dir():
        remedy = "name a file; 'bakelight inspect' looks into baked folders"
        raise InputError(path, "", "a folder", remedy)
    if not path.is_file():
        raise InputError(path, "", "no such file", "check the path")
    return _by_suffix(path)(path)


def _by_suffix(path: Path) -> Callable[[Path], Diagnosis]:
    from bake import sources

    suffix = path.suffix.lower()
    if suffix in sources.SUFFIXES:
        return doctor_meshes.mesh
    if suffix in PICTURES:
        return doctor_pictures.light_or_picture
    found: dict[str, Callable[[Path], Diagnosis]] = {
        ".lp": doctor_pictures.photographs,
        ".vox": doctor_meshes.voxels,
        ".xraw": doctor_meshes.voxels,
        ".ktx2": doctor_pictures.texture,
        ".dds": doctor_pictures.texture,
        ".toml": scene,
        ".json": scene,
    }
    return found.get(suffix, doctor_pictures.unknown)


def scene(path: Path) -> Diagnosis:
    """Load a scene, plan it, and look at every file that it names."""
    from formats import scene as scenes
    from pipelines import plan

    loaded = scenes.load(path)
    told = Diagnosis(str(path), "scene")
    made = plan.build(loaded, lines=1080)
    called = [e.name for e in made.effects if e.called]
    told.facts.append(f"calls for {', '.join(called)}")
    told.facts.append(f"{len(loaded.sources)} files, {len(loaded.lights)} lights")
    for light in made.lights:
        if not light.kept:
            told.find("note", f"light {light.index} ({light.type}) is left out: {light.reason}",
                      light.codes or 0.0, "codes", "as it says")  # fmt: skip
    for name, file in sorted(loaded.sources.items()):
        try:
            found = examine(file)
        except BakelightError as error:
            told.find("fault", f"{name}: {error}", 1, "", "refused")
            continue
        for finding in found.findings:
            if finding.level != "note":
                told.find(finding.level, f"{name}: {finding.what}", finding.measure, finding.unit,
                          finding.bake)  # fmt: skip
    return told.finished()
