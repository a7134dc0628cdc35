"""The plan of a scene: effects called for and left out, what must be baked, and what that costs."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from formats import effects, motion, photograph_files, picture_files
from formats.plan import LINES, AssetPlan, EffectPlan, LightPlan, Plan
from formats.scene import Billboards, EnvironmentLight, PlacedMesh, Scene, VoxelWorld
from pipelines import pass_times

if TYPE_CHECKING:
    from rich.console import Console

Seconds = Callable[[str], float | None]  # asset, such as billboard/oak -> measured seconds

FEW = 3  # moving things that a plan names
# Estimates, replaced by measured seconds where there are any
LIGHT_SAMPLES_A_SECOND = 1e8  # texels times samples times lights: 2 cores, mesh of 70,000 faces
BILLBOARD_START = 0.5  # seconds: reading a mesh, building its tree
PIXEL_LIGHTS_A_SECOND = 5e6  # of photographs' fit, decoding included: 72 of 402 x 395 in 2.5 s
PICTURE_START = 0.1  # seconds
PICTURE_TEXELS_A_SECOND = 2e6  # decoding and mip levels
TYPICAL_PICTURE = 256  # texels a side, where a plan is made without its sources
DOME_KNOBS = 1.5  # seconds: choosing a dome's smoothness, whatever its size
ENVIRONMENT_SECONDS = 0.5
MESH_SECONDS = 1.0
TRANSFER_BYTE_RAYS_A_SECOND = 6e7  # of a mesh's bytes times a vertex's rays: 70,000 faces in 20 s
OCCLUSION_START = 1.5  # seconds: reading a mesh, components, the proof of the report
OCCLUSION_RAYS_A_SECOND = 1e8  # of voxels times rays asked for: far voxels get fewer
ENVIRONMENT_BYTES = 64 * 32 * 8  # RGBA16F
VOXELS_SECONDS = 1.0
FACES_SECONDS = 1.0
LIGHTMAP_SECONDS = 20.0  # of a town of 64 cells a side at 2 % error
LIGHTMAP_BYTES = 512 * 512 * 8  # RGBA16F
TYPICAL_PHOTOGRAPHS = 64  # where a plan is made without its sources
MARGIN = 1.5  # texture over object, each side, with room for blur
MIPS = 4 / 3
TARGET_BYTES = 8 + 4  # a pixel: RGBA16F and depth
SAMPLES = 4  # of both, besides, where meshes have edges
# Bytes a pixel of what a pass adds to colour, depth and the picture
TARGETS = {
    "surface": TARGET_BYTES * SAMPLES,
    "transfer": TARGET_BYTES * SAMPLES,
    "voxels": TARGET_BYTES * SAMPLES,
    "ground": 8,
    "occlusion": 4,
    "film": 4 + TARGET_BYTES,
    "defocus": 68,
    "radial_blur": 8,
    "bloom": 11,
}


def build(
    scene: Scene,
    *,
    lines: int = LINES,
    reports: effects.Reports | None = None,
    seconds: Seconds | None = None,
    milliseconds: Mapping[str, float] | None = None,
) -> Plan:
    """Decide, collect and price.

    lines : height of the picture in pixels. reports : of assets baked already, by asset. seconds :
    measured time of an asset's bake, None where it is not known. milliseconds : measured, of the
    passes. Raises InputError where [force] asks for what the scene does not describe.
    """
    decided = effects.decide(scene, reports, lines)
    lights = effects.lights(scene, reports)
    kinds = {kind for effect in decided if effect.called for kind in effect.kinds}
    sprites = sum(len(b.instances()) for b in scene.billboards) if "billboard" in kinds else 0
    if any(effect.called and effect.name == "particles" for effect in decided):
        sprites += sum(each.most for each in scene.particles)
    assets = _assets(scene, kinds, lights, seconds)
    moving = motion.moving(scene)
    return Plan(
        scene=scene.name,
        lines=lines,
        effects=tuple(_priced(effect, assets, lines, milliseconds or {}) for effect in decided),
        assets=assets,
        sprites=sprites,
        lights=lights,
        still=not moving,
        motion=_motion(moving),
    )


def _motion(moving: tuple[str, ...]) -> str:
    """Name what moves, the first few."""
    if not moving:
        return ""
    more = f" and {len(moving) - FEW} more" if len(moving) > FEW else ""
    return f"{', '.join(moving[:FEW])}{more} change{'s' * (len(moving) == 1)}"


def _priced(
    effect: EffectPlan, assets: tuple[AssetPlan, ...], lines: int, milliseconds: Mapping[str, float]
) -> EffectPlan:
    """Add what an effect costs: nothing where it is not called for."""
    if not effect.called:
        return effect
    own = [asset for asset in assets if asset.kind in effect.kinds]
    size = sum(asset.bytes for asset in own) + TARGETS.get(effect.name, 0) * pass_times.pixels(
        lines
    )
    spent = milliseconds.get(effect.name, pass_times.estimate(effect.name, lines))
    return replace(
        effect,
        seconds=sum(asset.seconds for asset in own),
        bytes=size,
        milliseconds=spent,
        timed="measured" if effect.name in milliseconds else "estimate",
    )


def _assets(
    scene: Scene, kinds: set[str], lights: tuple[LightPlan, ...], seconds: Seconds | None
) -> tuple[AssetPlan, ...]:
    written = {path: text for text, path in scene.sources.items()}
    found = []

    def add(kind: str, name: str, source: object, estimate: float, size: int) -> None:
        asset = f"{kind}/{name}"
        known = seconds(asset) if seconds else None
        text = written.get(source, str(source))  # type: ignore[call-overload]
        price = estimate if known is None else known
        found.append(AssetPlan(asset, kind, text, price, known is not None, size))

    if "environment" in kinds:
        for light in lights:
            if light.type == "environment" and light.kept:
                lit = scene.lights[light.index]
                assert isinstance(lit, EnvironmentLight)
                name = str(light.index)
                add("environment", name, lit.source, ENVIRONMENT_SECONDS, ENVIRONMENT_BYTES)
    if scene.voxels is not None:
        for name, source in _cubes(scene.voxels):
            size = source.stat().st_size if source.is_file() else 1 << 20
            if "voxels" in kinds:
                add("voxels", name, source, VOXELS_SECONDS, 8 * size)
        for kind, spent in (("lightmap", LIGHTMAP_SECONDS), ("faces", FACES_SECONDS)):
            if kind in kinds:
                add(kind, "world", scene.voxels.source, spent, LIGHTMAP_BYTES)
    if "mesh" in kinds:
        for mesh in scene.meshes:
            if mesh.lighting == "direct":
                add("mesh", mesh.name, mesh.source, MESH_SECONDS, _mesh_bytes(mesh))
    if "transfer" in kinds:
        for mesh in scene.meshes:
            if mesh.lighting == "transfer":
                # About 40 bytes of a file a vertex, whose numbers come on top
                size = _mesh_bytes(mesh)
                spent = MESH_SECONDS + size * mesh.transfer.rays / TRANSFER_BYTE_RAYS_A_SECOND
                more = size * mesh.transfer.components // 40
                add("transfer", mesh.name, mesh.source, spent, size + more)
    if "occlusion" in kinds:
        for mesh in scene.meshes:
            if (shadow := mesh.shadow) is not None:
                work = shadow.grid**3 * shadow.rays / OCCLUSION_RAYS_A_SECOND
                add("occlusion", mesh.name, mesh.source, OCCLUSION_START + work, shadow.bytes)
    if "billboard" in kinds:
        for billboards in scene.billboards:
            size = _bytes(billboards)
            add("billboard", billboards.name, billboards.source, _seconds(billboards), size)
    return tuple(found)


def _cubes(world: VoxelWorld) -> list[tuple[str, Path]]:
    return [("world", world.source), *((body.name, body.source) for body in world.bodies)]


def _mesh_bytes(mesh: PlacedMesh) -> int:
    """Estimate of a mesh's vertices and textures: its file's size, textures decoded."""
    size = mesh.source.stat().st_size if mesh.source.is_file() else 1 << 20
    return int(size * MIPS * 2)


def _seconds(billboards: Billboards) -> float:
    """Estimate of a bake, seconds."""
    width, height = _size(billboards)
    if billboards.pictured:
        return PICTURE_START + width * height / PICTURE_TEXELS_A_SECOND
    if billboards.photographed:
        lights = _photographs(billboards)
        start = DOME_KNOBS if billboards.dome else BILLBOARD_START
        return start + width * height * lights / PIXEL_LIGHTS_A_SECOND
    texels = billboards.views * width * height
    under = billboards.dome or billboards.ring
    lights = 0 if under is None else under.lights
    work = texels * billboards.samples * lights / LIGHT_SAMPLES_A_SECOND
    fit = DOME_KNOBS + texels * lights / PIXEL_LIGHTS_A_SECOND if billboards.dome else 0.0
    return BILLBOARD_START + work + fit


def _bytes(billboards: Billboards) -> int:
    """Estimate of a set's textures as if the object were as wide as it is high."""
    if billboards.pictured:
        width, height = _size(billboards)
        return int(width * height * MARGIN**2 * 8 * MIPS)
    if billboards.dome is not None:
        planes = -(-billboards.dome.channels // 4)
    else:
        terms = 0 if billboards.ring is None else billboards.ring.terms
        planes = terms if billboards.packing == "full" else 3 + -(-(terms - 5) // 4)
    width, height = _size(billboards)
    return int(billboards.views * planes * width * height * MARGIN**2 * 4 * MIPS)


def _size(billboards: Billboards) -> tuple[int, int]:
    """Width and height in texels, of photographs those of the first."""
    if billboards.pictured:
        if not billboards.source.is_file():
            return (billboards.resolution or TYPICAL_PICTURE,) * 2
        return picture_files.baked_size(billboards.source, billboards.resolution)
    if billboards.photographed and billboards.source.is_file():
        return photograph_files.size(billboards.source)
    return billboards.resolution, billboards.resolution


def _photographs(billboards: Billboards) -> int:
    if not billboards.source.is_file():
        return TYPICAL_PHOTOGRAPHS
    return len(photograph_files.files(billboards.source)) - 1


def as_json(plan: Plan) -> str:
    """The plan as JSON, indented."""
    return json.dumps(plan.as_dict(), indent=2, allow_nan=False)


def show(plan: Plan, console: "Console | None" = None) -> None:
    """Print the plan; in colour only on a terminal and without NO_COLOR."""
    from rich.console import Console

    console = console or Console()
    columns = ("effect", "called for", "because", "at most", "codes", "bake s", "MB", "ms a frame")
    rows = [(effect.called, _effect(effect)) for effect in plan.effects]
    _table(console, f"{plan.scene} at {plan.lines} lines", columns, rows)
    if plan.lights:
        numbers = ["?" if light.codes is None else f"{light.codes:.3g}" for light in plan.lights]
        kept = [(light.kept, "kept" if light.kept else "left out") for light in plan.lights]
        lights = [
            (on, (f"{light.index} {light.type}", word, light.reason, codes))
            for (on, word), light, codes in zip(kept, plan.lights, numbers, strict=True)
        ]
        _table(console, "lights", ("light", "", "because", "codes"), lights)
    if plan.assets:
        assets = [(True, _asset(asset)) for asset in plan.assets]
        _table(console, "to bake", ("asset", "source", "seconds", "from", "MB"), assets)
    console.print(summary(plan), highlight=False)


def _table(
    console: "Console",
    title: str,
    columns: tuple[str, ...],
    rows: Sequence[tuple[bool, tuple[str, ...]]],
) -> None:
    """Print rows, those that count bold."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    # Reasons give way to what is short, down to a width in which they can be read
    table = Table(title=title, title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0))
    for name in columns:
        long = name in ("because", "source")
        kept = name in ("effect", "asset", "codes", "bake s", "MB")
        table.add_column(name, overflow="fold", no_wrap=kept, min_width=13 if long else None)
    for counts, row in rows:
        table.add_row(*(escape(cell) for cell in row), style="bold" if counts else "dim")
    console.print(table)


def _effect(effect: EffectPlan) -> tuple[str, ...]:
    bounds = (effect.name, "yes" if effect.called else "no", effect.reason, _bound(effect))
    if not effect.called:
        return (*bounds, f"{effect.codes:.3g}", "", "", "")
    spent = f"{effect.milliseconds:,.1f}"
    if effect.timed == "estimate":
        spent = f"~{effect.milliseconds:,.0f}" if effect.milliseconds else ""
    price = (f"{effect.seconds:.1f}", f"{effect.bytes / 1e6:.1f}", spent)
    return (*bounds, f"{effect.codes:.3g}", *price)


def _asset(asset: AssetPlan) -> tuple[str, ...]:
    origin = "measured" if asset.known else "estimate"
    size = f"{asset.bytes / 1e6:.1f}"
    return (asset.name, asset.source, f"{asset.seconds:.1f}", origin, size)


def summary(plan: Plan) -> str:
    """Cost in a few lines: bake from nothing, memory, what a frame draws, and what is left out."""
    passes = [name for name in plan.called if name not in ("environment", "depth_of_field")]
    width = round(plan.lines * 16 / 9)
    targets = 1 + SAMPLES if {"surface", "transfer", "voxels"} & set(plan.called) else 1
    memory = (plan.bytes + width * plan.lines * TARGET_BYTES * targets) / 1e6
    measured = all(e.timed == "measured" for e in plan.effects if e.milliseconds > 0)
    moves = "Nothing moves: one frame is enough." if plan.still else f"It moves: {plan.motion}."
    return (
        f"Bake from nothing: {plan.seconds:.1f} s. Graphics memory: about {memory:.0f} MB. "
        f"A frame: {len(passes)} passes ({', '.join(passes)}), {plan.sprites} sprites, "
        f"{plan.milliseconds:.0f} ms ({'measured' if measured else 'estimate'}). {moves} "
        f"All that is left out changes no pixel by more than {plan.left_out:.2g} 8-bit codes."
    )


def _bound(effect: EffectPlan) -> str:
    if effect.bound is None:
        return ""
    number = f"{effect.bound:,.0f}" if effect.bound >= 1000 else f"{effect.bound:.3g}"
    return f"{number} {effect.unit}"
