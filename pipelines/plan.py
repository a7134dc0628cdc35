"""The plan of a scene: effects called for and left out, what must be baked, and what that costs."""

import json
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from formats import effects
from formats.plan import LINES, AssetPlan, EffectPlan, Plan
from formats.scene import Billboards, EnvironmentLight, Scene

if TYPE_CHECKING:
    from rich.console import Console

Seconds = Callable[[str], float | None]  # asset, such as billboard/oak -> measured seconds

# Estimates, replaced by measured seconds where there are any
LIGHT_SAMPLES_A_SECOND = 1e8  # texels times samples times lights: 2 cores, mesh of 70,000 faces
BILLBOARD_START = 0.5  # seconds: reading a mesh, building its tree
ENVIRONMENT_SECONDS = 0.5
ENVIRONMENT_BYTES = 64 * 32 * 8  # RGBA16F
MARGIN = 1.5  # texture over object, each side, with room for blur
MIPS = 4 / 3
TARGET_BYTES = 8 + 4  # a pixel: RGBA16F and depth


def build(
    scene: Scene,
    *,
    lines: int = LINES,
    reports: effects.Reports | None = None,
    seconds: Seconds | None = None,
) -> Plan:
    """Decide, collect and price.

    lines : height of the picture in pixels. reports : of assets baked already, by asset. seconds :
    measured time of an asset's bake, None where it is not known. Raises InputError where [force]
    asks for what the scene does not describe.
    """
    decided = effects.decide(scene, reports, lines)
    kinds = {kind for effect in decided if effect.called for kind in effect.kinds}
    sprites = sum(len(b.instances()) for b in scene.billboards) if "billboard" in kinds else 0
    return Plan(scene.name, lines, decided, _assets(scene, kinds, seconds), sprites)


def _assets(scene: Scene, kinds: set[str], seconds: Seconds | None) -> tuple[AssetPlan, ...]:
    written = {path: text for text, path in scene.sources.items()}
    found = []

    def add(kind: str, name: str, source: object, estimate: float, size: int) -> None:
        asset = f"{kind}/{name}"
        known = seconds(asset) if seconds else None
        text = written.get(source, str(source))  # type: ignore[call-overload]
        price = estimate if known is None else known
        found.append(AssetPlan(asset, kind, text, price, known is not None, size))

    if "environment" in kinds:
        for i, light in enumerate(scene.lights):
            if isinstance(light, EnvironmentLight) and np.max(light.scale.extremes[1]) > 0:
                add("environment", str(i), light.source, ENVIRONMENT_SECONDS, ENVIRONMENT_BYTES)
    if "billboard" in kinds:
        for billboards in scene.billboards:
            size = _bytes(billboards)
            add("billboard", billboards.name, billboards.source, _seconds(billboards), size)
    return tuple(found)


def _seconds(billboards: Billboards) -> float:
    """Estimate of a bake, seconds."""
    work = billboards.views * billboards.resolution**2 * billboards.samples * billboards.ring.lights
    return BILLBOARD_START + work / LIGHT_SAMPLES_A_SECOND


def _bytes(billboards: Billboards) -> int:
    """Estimate of a set's textures as if the object were as wide as it is high."""
    terms = billboards.ring.terms
    planes = terms if billboards.packing == "full" else 3 + -(-(terms - 5) // 4)
    texels = billboards.views * planes * (MARGIN * billboards.resolution) ** 2
    return int(texels * 4 * MIPS)


def as_json(plan: Plan) -> str:
    """The plan as JSON, indented."""
    return json.dumps(plan.as_dict(), indent=2, allow_nan=False)


def show(plan: Plan, console: "Console | None" = None) -> None:
    """Print the plan; in colour only on a terminal and without NO_COLOR."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = console or Console()
    table = Table(title=f"{plan.scene} at {plan.lines} lines", title_justify="left")
    for name in ("effect", "called for", "because", "at most"):
        table.add_column(name, overflow="fold")
    for effect in plan.effects:
        style = "bold" if effect.called else "dim"
        called = "yes" if effect.called else "no"
        table.add_row(effect.name, called, escape(effect.reason), _bound(effect), style=style)
    console.print(table)
    if plan.assets:
        table = Table(title="to bake", title_justify="left")
        for name in ("asset", "source", "seconds", "from", "MB"):
            table.add_column(name, overflow="fold")
        for asset in plan.assets:
            origin = "measured" if asset.known else "estimate"
            size = f"{asset.bytes / 1e6:.1f}"
            table.add_row(asset.name, escape(asset.source), f"{asset.seconds:.1f}", origin, size)
        console.print(table)
    console.print(summary(plan), highlight=False)


def summary(plan: Plan) -> str:
    """Cost in one line: bake from nothing, memory, and what a frame draws."""
    passes = [name for name in plan.called if name not in ("environment", "depth_of_field")]
    width = round(plan.lines * 16 / 9)
    memory = (plan.bytes + width * plan.lines * TARGET_BYTES) / 1e6
    return (
        f"Bake from nothing: {plan.seconds:.1f} s. Graphics memory: about {memory:.0f} MB. "
        f"A frame: {len(passes)} passes ({', '.join(passes)}), {plan.sprites} sprites."
    )


def _bound(effect: EffectPlan) -> str:
    if effect.bound is None:
        return ""
    number = f"{effect.bound:,.0f}" if effect.bound >= 1000 else f"{effect.bound:.3g}"
    return f"{number} {effect.unit}"
