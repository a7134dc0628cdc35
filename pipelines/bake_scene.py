"""From a scene file to a folder that the player reads: only the kinds that the plan calls for."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from bake import environment, mesh, sources
from bake.recipe import Entry, Source, Stage
from bake.store import Store
from formats import photograph_files, seal
from formats import scene as scenes
from formats.errors import DamagedError, InputError
from formats.meshes import KINDS, PlacedMesh
from formats.plan import Plan
from formats.sprites import Billboards
from pipelines import bake_sprites, reports
from pipelines.current import MANIFEST_FORMAT, code, digest, plans
from pipelines.deliver import copy, publish, sweep
from pipelines.plan import build

Progress = Callable[[str, float], None]
MADE_FROM = {"lightmap": ("voxels", "environment"), "faces": ("voxels",)}
"""Kinds that are inputs of another."""


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
    adjust: Callable[[scenes.Scene], scenes.Scene] | None = None,
    price: dict[str, Any] | None = None,
    store: Store | None = None,
) -> SceneBake:
    """Bake a scene into build/scenes/NAME; what the store has is not baked again.

    only : a kind ("billboard", "environment") to bake alone, with what it is made from, without
    writing the scene's folder. adjust : sets knobs that the file leaves open or has otherwise.
    price : what the manifest says of them. store : another one than build/store.
    Raises InputError, MachineError, DamagedError.
    """
    # Digests of before anything is read: what changes during the bake is baked again next time
    text = _digest_or_none(path)
    scene = scenes.load(path, root)
    seen = {"scene_sha256": text, "code": code(), "plans": plans(), "sources": sources_of(scene)}
    scene = scene if adjust is None else adjust(scene)
    folder = build_folder / "scenes" / scene.name
    _require_own(folder)
    store = store or Store(build_folder / "store")
    plan = build(scene)
    entries: dict[str, Entry] = {}
    for name, kind, run in jobs(scene, plan):
        if only in (None, kind) or kind in MADE_FROM.get(str(only), ()):
            watch = None if on_progress is None else partial(on_progress, name)
            entries[name] = run(store, watch)
    if only is None:
        # What was baked is measured now: less may be called for, never more
        measured = reports.of_entries((name, entry.path) for name, entry in entries.items())
        plan = build(scene, reports=measured)
        needed = {asset.name for asset in plan.assets}
        taken = {name: entry for name, entry in entries.items() if name in needed}
        _assemble(folder, scene, seen, plan, taken, price)
    return SceneBake(folder, plan, entries)


Watch = bake_sprites.Watch
Run = Callable[[Store, Watch | None], Entry]


def jobs(scene: scenes.Scene, plan: Plan) -> Iterator[tuple[str, str, Run]]:
    """List (name, kind, how to bake it) of the assets that the plan names."""
    groups = {group.name: group for group in scene.billboards}
    for asset in plan.assets:
        _, name = asset.name.split("/")
        if asset.kind == "billboard":
            yield asset.name, asset.kind, partial(_billboard, scene, groups[name])
        elif asset.kind == "occlusion":
            placed = next(placed for placed in scene.meshes if placed.name == name)
            yield asset.name, asset.kind, partial(_occlusion, placed)
        elif asset.kind == "transfer":
            placed = next(placed for placed in scene.meshes if placed.name == name)
            yield asset.name, asset.kind, partial(_transfer, placed)
        elif asset.kind == "voxels":
            yield asset.name, asset.kind, partial(_voxels, scene, name)
        elif asset.kind in ("lightmap", "faces"):
            yield asset.name, asset.kind, partial(_light, scene, asset.kind == "lightmap")
        elif asset.kind == "mesh":
            source = next(placed.source for placed in scene.meshes if placed.name == name)
            yield asset.name, asset.kind, partial(_mesh, source)
        else:
            yield asset.name, asset.kind, partial(_environment, scene.lights[int(name)])


def _billboard(scene: scenes.Scene, group: Billboards, store: Store, watch: Watch | None) -> Entry:
    return bake_sprites.bake(store, bake_sprites.of_scene(scene, group), watch)


def _occlusion(placed: PlacedMesh, store: Store, watch: Watch | None) -> Entry:
    return bake_sprites.bake(store, occlusion_steps(placed), watch)


def occlusion_steps(placed: PlacedMesh) -> bake_sprites.Sprite:
    """Rays, then components, each an entry of its own."""
    from bake import compress, occlusion
    from formats.occlusion import Occlusion, OcclusionHarmonics

    shadow = placed.shadow
    if shadow is None:
        raise TypeError(f"{placed.name} has no shadow")
    rays = occlusion.Params(grid=shadow.grid, l_max=shadow.l_max, rays=shadow.rays)
    pack = compress.Params(encoding=shadow.encoding, components=shadow.components, size=shadow.size)
    steps = (
        bake_sprites.Step(occlusion.trace, rays, OcclusionHarmonics.load),
        bake_sprites.Step(compress.compress, pack, Occlusion.load),
    )
    return bake_sprites.Sprite(bake_sprites.mesh_source(placed.source), steps)


def _transfer(placed: PlacedMesh, store: Store, watch: Watch | None) -> Entry:
    stage, source, params = transfer_stage(placed)
    return store.run(stage, source, params=params, on_progress=watch)


def transfer_stage(placed: PlacedMesh) -> tuple[Stage, Source[Any], Any]:
    from bake import transfer

    knobs = placed.transfer
    params = transfer.Params(
        mode="interreflected" if knobs.bounces else "shadowed",
        l_max=knobs.l_max,
        rays=knobs.rays,
        bounces=max(knobs.bounces, 1),
        edge=knobs.edge,
        components=knobs.components,
    )
    return transfer.trace, bake_sprites.mesh_source(placed.source), params


def _voxels(scene: scenes.Scene, name: str, store: Store, watch: Watch | None) -> Entry:
    from pipelines import bake_cubes

    assert scene.voxels is not None
    return bake_sprites.bake(store, bake_cubes.cells(scene.voxels, name), watch)


def _light(scene: scenes.Scene, lit: bool, store: Store, watch: Watch | None) -> Entry:
    """Bake faces, and light where nothing moves, of cells that are baked before."""
    from pipelines import bake_cubes

    return bake_cubes.light(store, scene, light_inputs(store, scene, lit), lit, watch)


def light_inputs(store: Store, scene: scenes.Scene, lit: bool) -> list[Any]:
    from pipelines import bake_cubes

    assert scene.voxels is not None
    worlds = [f"voxels/{name}" for name in bake_cubes.names(scene.voxels)]
    maps = [f"environment/{number}" for number in bake_cubes.maps_of(scene)] if lit else []
    found = [[_located(store, scene, name)[-1] for name in part] for part in (worlds, maps)]
    return bake_cubes.inputs(*found)


def _mesh(path: Path, store: Store, watch: Watch | None) -> Entry:
    stage, source, params = _mesh_stage(path)
    return store.run(stage, source, params=params, on_progress=watch)


def _mesh_stage(path: Path) -> tuple[Stage, Source[Any], Any]:
    sources.check_file(path)
    source = Source(sources.files(path), partial(sources.load, path))
    return mesh.prepare, source, mesh.Params()


def known_reports(scene: scenes.Scene, build_folder: Path) -> reports.Reports:
    """Return the reports of the assets that the store has, as they would be baked now."""
    if not (build_folder / "store").is_dir():
        # A look must not make folders
        return {}
    store = Store(build_folder / "store")
    names = [f"billboard/{group.name}" for group in scene.billboards]
    names += [f"{KINDS[placed.lighting]}/{placed.name}" for placed in scene.meshes]
    names += [f"occlusion/{placed.name}" for placed in scene.meshes if placed.shadow]
    names += ["voxels/world"] if scene.voxels is not None else []
    lights = [isinstance(light, scenes.EnvironmentLight) for light in scene.lights]
    names += [f"environment/{i}" for i, environment in enumerate(lights) if environment]
    last = {name: _located(store, scene, name)[-1] for name in names}
    return reports.of_entries((name, entry.path) for name, entry in last.items() if entry.hit)


def known_seconds(scene: scenes.Scene, build_folder: Path) -> Callable[[str], float | None]:
    """Return a look-up of what baking an asset took when it was last baked as it is now."""
    if not (build_folder / "store").is_dir():
        return lambda asset: None
    store = Store(build_folder / "store")

    def seconds(asset: str) -> float | None:
        entries = _located(store, scene, asset)
        return sum(e.seconds for e in entries) if all(e.hit for e in entries) else None

    return seconds


def _located(store: Store, scene: scenes.Scene, asset: str) -> tuple[Entry, ...]:
    """Return where each stage of an asset's bake is or would be."""
    kind, name = asset.split("/")
    if kind == "billboard":
        group = next(group for group in scene.billboards if group.name == name)
        return bake_sprites.located(store, bake_sprites.of_scene(scene, group))
    if kind in ("voxels", "lightmap", "faces"):
        return _located_cubes(store, scene, kind, name)
    if kind == "occlusion":
        placed = next(placed for placed in scene.meshes if placed.name == name)
        return bake_sprites.located(store, occlusion_steps(placed))
    if kind == "transfer":
        placed = next(placed for placed in scene.meshes if placed.name == name)
        stage, source, params = transfer_stage(placed)
    elif kind == "mesh":
        placed = next(placed for placed in scene.meshes if placed.name == name)
        stage, source, params = _mesh_stage(placed.source)
    else:
        light = scene.lights[int(name)]
        assert isinstance(light, scenes.EnvironmentLight)
        stage, source, params = _environment_stage(light)
    step = bake_sprites.Step(stage, params, lambda path: path)
    return bake_sprites.located(store, bake_sprites.Sprite(source, (step,)))


def _located_cubes(store: Store, scene: scenes.Scene, kind: str, name: str) -> tuple[Entry, ...]:
    from pipelines import bake_cubes

    assert scene.voxels is not None
    if kind == "voxels":
        return bake_sprites.located(store, bake_cubes.cells(scene.voxels, name))
    lit = kind == "lightmap"
    return (bake_cubes.located(store, scene, light_inputs(store, scene, lit), lit),)


def _environment(light: scenes.Light, store: Store, watch: Watch | None) -> Entry:
    """Bake an environment as its file has it: the player turns it."""
    if not isinstance(light, scenes.EnvironmentLight):
        raise TypeError(f"{light!r} is not an environment")
    stage, source, params = _environment_stage(light)
    return store.run(stage, source, params=params, on_progress=watch)


def _environment_stage(light: scenes.EnvironmentLight) -> tuple[Stage, Source[Any], Any]:
    source = Source((light.source,), partial(environment.load, light.source))
    return environment.resample, source, environment.Params()


def _assemble(
    folder: Path, scene: scenes.Scene, seen: dict[str, Any], plan: Plan, entries: dict[str, Entry],
    price: dict[str, Any] | None,
) -> None:  # fmt: skip
    """Publish the scene's sealed folder; one that is there, intact and says the same stays."""
    assets = {name: f"assets/{entry.key[:32]}" for name, entry in entries.items()}
    manifest = {
        "format": MANIFEST_FORMAT,
        "name": scene.name,
        "scene": scene.raw,
        **seen,
        "root": "" if scene.root is None else str(scene.root.resolve()),
        "plan": plan.as_dict(),
        "assets": assets,
        # As they were planned: keys of this file are sorted
        "order": list(assets),
        "keys": sorted(entry.key for entry in entries.values()),
        **({} if price is None else {"price": price}),
    }
    text = json.dumps(manifest, indent=1, sort_keys=True, allow_nan=False) + "\n"
    sweep(folder)
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
    """Return the store keys that the scenes in build/scenes were baked from, at every stage.

    Raises OSError where a scene's folder cannot be read.
    """
    keys: set[str] = set()
    folder = build_folder / "scenes"
    # A folder that cannot be read is no folder without scenes
    for name in os.listdir(folder) if folder.exists() else ():
        with suppress(FileNotFoundError, NotADirectoryError, ValueError, KeyError, TypeError):
            keys |= set(json.loads((folder / name / "manifest.json").read_text())["keys"])
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


def _digest_or_none(path: Path) -> str:
    """Return the digest of a scene file; "" where loading it says what is wrong with it."""
    try:
        return digest(path)
    except (OSError, ValueError):
        return ""


def sources_of(scene: scenes.Scene) -> dict[str, str]:
    """Return the digest of every source file, by its path."""
    files: list[Path] = []
    for group in scene.billboards:
        listed = photograph_files.files if group.photographed else sources.files
        files += [group.source] if group.pictured else listed(group.source)
    files += [file for placed in scene.meshes for file in sources.files(placed.source)]
    if scene.voxels is not None:
        from pipelines import bake_cubes

        files += bake_cubes.files(scene.voxels)
    files += [light.source for light in scene.lights if isinstance(light, scenes.EnvironmentLight)]
    return {str(f.resolve()): digest(f) for f in dict.fromkeys(files)}
