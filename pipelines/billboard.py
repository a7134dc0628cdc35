"""`bakelight billboard`: a mesh becomes a relit sprite, under a ring of lights or under a dome."""

from __future__ import annotations

from dataclasses import fields
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipelines.cli import build_option, file_path, jobs_option, json_option
from pipelines.price_cli import asked, bake_by_price, free, price_options, watch_of
from pipelines.single import folder_out, knob

if TYPE_CHECKING:
    from pipelines.bake_sprites import Step

ANGLES = {"elevation": "elevation", "sun_diameter": "sun_diameter", "field_of_view": "perspective"}
"""Knobs of a stage that the command line has in degrees."""
RING_ALONE = ("axis", "elevation", "lights_per_sample", "terms", "packing", "depth")
DOME_ALONE = ("bands", "penalty", "channels")


@click.command()
@click.argument("source", type=file_path)
@folder_out
@knob("--resolution", 512, "Texels along the longer side.")
@knob("--samples", 16, "Rays a texel.")
@knob("--views", 1, "1 to 16 sides, evenly about +y.")
@knob("--axis", "view", "Axis of the ring of lights.", ("view", "up"))
@knob("--elevation", 30.0, "Degrees above the ring's plane.")
@knob("--lights", 64, "Directions on the ring, or over the dome.")
@knob("--lights-per-sample", 0, "How many of them each ray of a texel sees, in turn; 0 chooses.")
@knob("--terms", 5, "Circular harmonics kept, odd.")
@knob("--sun-diameter", 0.53, "Degrees each light subtends.")
@knob("--sky-fill", 0.0, "Even sky, share of the light's irradiance.")
@knob("--transmission", 0.35, "Light let through by double-sided faces.")
@knob("--gloss", 0.0, "Strength of the GGX lobe.")
@knob("--perspective", 0.0, "Degrees of view; 0: orthographic.")
@knob("--packing", "chroma", "How terms share textures.", ("chroma", "talk", "full"))
@knob("--max-lod", 4.0, "Coarsest mip for the lens; sizes the border.")
@click.option("--filter", "mip_filter", help="Mip filter; default: the most like a lens.")
@knob("--depth", "8", "Bits a channel.", ("8", "16"))
@click.option("--dome", is_flag=True, help="Lights from the whole hemisphere, not from a ring.")
@knob("--bands", 0, "Dome: bands of harmonics; 0 chooses by held-out error.")
@knob("--penalty", 0.0, "Dome: smoothness; 0 chooses by held-out error.")
@knob("--channels", 16, "Dome: numbers a pixel, one of them coverage.")
@price_options
@build_option
@jobs_option
@json_option
def billboard(
    source: Path,
    out: Path,
    dome: bool,
    target_error: float | None,
    budget: float | None,
    build: Path,
    jobs: int,
    as_json: bool,
    **knobs: Any,
) -> None:
    """Bake a relit sprite from a mesh: OBJ, PLY, STL, OFF, GLB, glTF."""
    from bake.store import Store
    from pipelines import bake_sprites, output

    output.use_threads(jobs)
    if dome:
        output.refuse(RING_ALONE, "remove it: a dome has no such knob")
    else:
        output.refuse(DOME_ALONE, "add --dome, or remove it")
    steps = dome_steps(knobs) if dome else ring_steps(knobs)
    if ask := asked(target_error, budget):
        from pipelines import price_dome, price_sprites

        by = price_dome.DomeAsset if dome else price_sprites.RingAsset
        chosen = price_dome.CHOSEN if dome else price_sprites.CHOSEN
        subject = by(source, steps[0].params, steps[1].params, free(chosen))
        with output.bars() as bar:
            watch = watch_of(bar, source)
            bake_by_price(Store(build / "store"), subject, ask, out, as_json, watch)
        return
    sprite = bake_sprites.Sprite(bake_sprites.mesh_source(source), steps)
    with output.bars() as bar:
        watch = None if bar is None else lambda fraction: bar(source.name, fraction)
        entry = bake_sprites.bake(Store(build / "store"), sprite, watch)
    output.delivered(entry, out, as_json)


def ring_steps(knobs: dict[str, Any]) -> tuple[Step, ...]:
    """Return the stages that bake a mesh under a ring with these options."""
    from bake import billboard as stage
    from bake import mips
    from pipelines import bake_sprites

    packing: dict[str, Any] = {
        "packing": "full" if knobs["packing"] == "full" else "twelve",
        "unpack": "talk" if knobs["packing"] == "talk" else "chroma",
    }
    pack = mips.Params(**_lens(knobs), depth=knobs["depth"], **packing)
    return bake_sprites.ring_of_mesh(stage.Params(**_of(stage.Params, knobs)), pack)


def dome_steps(knobs: dict[str, Any]) -> tuple[Step, ...]:
    """Return the stages that bake a mesh under a dome with these options."""
    from bake import dome, dome_renders
    from pipelines import bake_sprites

    render = dome_renders.Params(**_of(dome_renders.Params, knobs))
    fit = dome.Params(coverage=True, **{name: knobs[name] for name in DOME_ALONE}, **_lens(knobs))
    return bake_sprites.dome_of_mesh(render, fit)


def _of(params: type[Any], knobs: dict[str, Any]) -> dict[str, Any]:
    """Return what the options say of the fields of a stage's knobs, angles in radians."""
    names = {field.name for field in fields(params)}
    plain = {name: knobs[name] for name in names & set(knobs) - set(ANGLES)}
    return plain | {n: radians(knobs[knob]) for n, knob in ANGLES.items() if n in names}


def _lens(knobs: dict[str, Any]) -> dict[str, Any]:
    """Return the knobs that every mip chain has."""
    chosen = {} if knobs["mip_filter"] is None else {"filter": knobs["mip_filter"]}
    return {"max_lod": knobs["max_lod"], **chosen}
