"""From a scene file to a folder that the player reads: only the kinds that the plan calls for."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bake import billboard, environment, mips, recipe, sources
from bake.recipe import Baked, Entry, Source
from bake.store import Store, seconds_of
from formats import scene as scenes
from formats import seal
from formats.coefficients import Coefficients
from formats.effects import largest_lod
from formats.errors import DamagedError, InputError
from formats.mesh import Mesh
from formats.plan import Plan
from formats.sprites import Billboards
from pipelines.current import MANIFEST_FORMAT, code, digest
from pipelines.deliver import copy, publish
from pipelines.plan import build

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class SceneBake:
    """What baking a scene did: its folder, plan, and each asset's entry by name."""

    folder: Path
    plan: Plan
    entries: dict[str, Entry]

    @property
    def baked(self) -> int:
        """Number of assets that were not in the store before."""
        return sum(not entry.hit for entry in self.entries.values())


def bake_scene(
    path: Path,
    *,
    root: Path | None = None,
    build_folder: Path = Path("build"),
    only: str | None = None,
    on_progress: Progress | None = None,
) -> SceneBake:
    """Bake a scene into build/scenes/NAME; what the store has is not baked again.

    only : a kind ("billboard", "environment") to bake alone, without writing the scene's folder.
    Raises InputError, MachineError, DamagedError.
    """
    scene = scenes.load(path, root)
    folder = build_folder / "scenes" / scene.name
    _require_own(folder)
    store = Store(build_folder / "store")
    plan = build(scene)
    entries: dict[str, Entry] = {}
    for name, kind, run in _jobs(scene, plan):
        if only in (None, kind):
            watch = None if on_progress is None else partial(on_progress, name)
            entries[name] = run(store, watch)
    if only is None:
        _assemble(folder, scene, path, plan, entries)
    return SceneBake(folder, plan, entries)


Watch = Callable[[float], None]
Run = Callable[[Store, Watch | None], Entry]


def _jobs(scene: scenes.Scene, plan: Plan) -> Iterator[tuple[str, str, Run]]:
    """List (name, kind, how to bake it) of the assets that the plan names."""
    groups = {group.name: group for group in scene.billboards}
    for asset in plan.assets:
        _, name = asset.name.split("/")
        if asset.kind == "billboard":
            yield asset.name, asset.kind, partial(_billboard, scene, groups[name])
        else:
            yield asset.name, asset.kind, partial(_environment, scene.lights[int(name)])


def _billboard(scene: scenes.Scene, group: Billboards, store: Store, watch: Watch | None) -> Entry:
    return bake_billboard(store, group.source, *stage_params(scene, group), watch)


def bake_billboard(
    store: Store,
    source: Path,
    trace: billboard.Params,
    pack: mips.Params,
    watch: Watch | None = None,
) -> Entry:
    """Bake one mesh: rays, then mips and codes, each its own entry."""
    mesh = _mesh(source)
    master = located(store, billboard.trace, mesh, params=trace)
    packed = located(store, mips.pack, Baked(master, Coefficients.load), params=pack)
    # What the player reads is there already: do not even check the float master
    if not (packed.hit and master.hit):
        master = store.run(billboard.trace, mesh, params=trace, on_progress=watch)
    return store.run(mips.pack, Baked(master, Coefficients.load), params=pack)


def located(store: Store, stage: Callable[..., Any], *inputs: Any, params: Any) -> Entry:
    """Return where an entry is or would be, and whether it is there, without checking its bytes."""
    contents = recipe.of(stage, inputs, params)
    key = recipe.key(contents)
    path = store.folder / f"{contents['stage']}-{key}"
    return Entry(path, key, path.is_dir(), seconds_of(path))


def known_seconds(scene: scenes.Scene, build_folder: Path) -> Callable[[str], float | None]:
    """Return a look-up of what baking an asset took when it was last baked as it is now."""
    if not (build_folder / "store").is_dir():
        # A look must not make folders
        return lambda asset: None
    store = Store(build_folder / "store")
    groups = {group.name: group for group in scene.billboards}

    def seconds(asset: str) -> float | None:
        kind, name = asset.split("/")
        if kind != "billboard":
            return None
        trace, pack = stage_params(scene, groups[name])
        master = located(store, billboard.trace, _mesh(groups[name].source), params=trace)
        packed = located(store, mips.pack, Baked(master, Coefficients.load), params=pack)
        return master.seconds + packed.seconds if master.hit and packed.hit else None

    return seconds


def _mesh(source: Path) -> Source[Mesh]:
    sources.check_file(source)
    return Source(sources.files(source), partial(sources.load, source))


def stage_params(scene: scenes.Scene, group: Billboards) -> tuple[billboard.Params, mips.Params]:
    """Turn what a scene says of a set of sprites into the knobs of the two stages."""
    trace = billboard.Params(
        resolution=group.resolution,
        views=group.views,
        samples=group.samples,
        axis=group.ring.axis,
        elevation=float(np.radians(group.ring.elevation)),
        lights=group.ring.lights,
        terms=group.ring.terms,
        sun_diameter=float(np.radians(group.sun_diameter)),
        sky_fill=group.sky_fill,
        transmission=group.transmission,
        gloss=group.gloss,
    )
    scale = mips.FILTERS[mips.Params().filter].lens_scale
    lod = largest_lod(scene, group, group.resolution / group.height, scale)
    # Whole levels: a small change of the lens then bakes nothing anew
    pack = mips.Params(
        max_lod=float(min(7, np.ceil(lod))),
        packing="full" if group.packing == "full" else "twelve",
        unpack="talk" if group.packing == "talk" else "chroma",
    )
    return trace, pack


def _environment(light: scenes.Light, store: Store, watch: Watch | None) -> Entry:
    """Bake an environment as its file has it: the player turns it."""
    if not isinstance(light, scenes.EnvironmentLight):
        raise TypeError(f"{light!r} is not an environment")
    source = Source((light.source,), partial(environment.load, light.source))
    return store.run(environment.resample, source, params=environment.Params(), on_progress=watch)


def _assemble(
    folder: Path, scene: scenes.Scene, path: Path, plan: Plan, entries: dict[str, Entry]
) -> None:
    """Publish the scene's sealed folder; one that is there, intact and says the same stays."""
    assets = {name: f"assets/{entry.key[:32]}" for name, entry in entries.items()}
    manifest = {
        "format": MANIFEST_FORMAT,
        "name": scene.name,
        "scene": scene.raw,
        "scene_sha256": digest(path),
        "code": code(),
        "sources": _sources(scene),
        "plan": plan.as_dict(),
        "assets": assets,
        "keys": sorted(entry.key for entry in entries.values()),
    }
    text = json.dumps(manifest, indent=1, sort_keys=True, allow_nan=False) + "\n"
    if _says(folder, text):
        return

    def fill(temporary: Path) -> None:
        for name, entry in entries.items():
            copy(entry.path, temporary / assets[name])
        (temporary / "manifest.json").write_text(text)
        seal.seal(temporary)

    publish(folder, fill)


def _require_own(folder: Path) -> None:
    """Refuse to replace what is no baked scene."""
    try:
        names = {entry.name for entry in folder.iterdir()}
    except FileNotFoundError:
        return
    except OSError:
        names = {"?"}
    if not names & {"manifest.json", seal.NAME} and not names <= {"assets"}:
        remedy = "move it away, or choose another folder with --build"
        raise InputError(folder, "", "is not a baked scene", remedy)


def _says(folder: Path, text: str) -> bool:
    """Tell whether a scene's folder is intact and holds this manifest."""
    try:
        seal.verify(folder)
        return (folder / "manifest.json").read_text() == text
    except (DamagedError, OSError):
        return False


def keys_in_use(build_folder: Path) -> set[str]:
    """Return the store keys that the scenes in build/scenes were baked from, at every stage."""
    keys: set[str] = set()
    for manifest in (build_folder / "scenes").glob("*/manifest.json"):
        with suppress(OSError, ValueError, KeyError):
            keys |= set(json.loads(manifest.read_text())["keys"])
    pending = list(keys)
    while pending:
        # An entry's recipe names the entries that it was made from
        for path in (build_folder / "store").glob(f"*-{pending.pop()}/recipe.json"):
            with suppress(OSError, ValueError, KeyError):
                inputs = json.loads(path.read_text())["inputs"]
                found = {each["entry"] for each in inputs if "entry" in each} - keys
                keys |= found
                pending += found
    return keys


def _sources(scene: scenes.Scene) -> dict[str, str]:
    """Return the digest of every source file, by its path."""
    named = [group.source for group in scene.billboards]
    files = [file for source in named for file in sources.files(source)]
    files += [light.source for light in scene.lights if isinstance(light, scenes.EnvironmentLight)]
    return {str(f.resolve()): digest(f) for f in dict.fromkeys(files)}
