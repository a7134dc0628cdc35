"""Commands on one asset: bake it from one file, relight it, look into it, look after the store."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from math import radians
from pathlib import Path
from typing import Any, TypeVar

import click

from pipelines.cli import BUILD, build_option, file_path, jobs_option, json_option

folder_out = click.option(
    "-o", "--output", "out", type=file_path, required=True, help="Folder of the asset."
)


def add_to(group: click.Group) -> None:
    """Hang these commands under the program."""
    from pipelines.photographs import photographs

    for command in (billboard, environment, photographs, relight, inspect, store):
        group.add_command(command)


Command = TypeVar("Command", bound=Callable[..., Any])


def knob(
    flag: str, default: Any, text: str, choices: tuple[str, ...] = ()
) -> Callable[[Command], Command]:
    """Return an option that shows its default."""
    kind = click.Choice(choices) if choices else type(default)
    return click.option(flag, type=kind, default=default, show_default=True, help=text)


@click.command()
@click.argument("source", type=file_path)
@folder_out
@knob("--resolution", 512, "Texels along the longer side.")
@knob("--samples", 16, "Rays a texel.")
@knob("--views", 1, "1 to 16 sides, evenly about +y.")
@knob("--axis", "view", "Axis of the ring of lights.", ("view", "up"))
@knob("--elevation", 30.0, "Degrees above the ring's plane.")
@knob("--lights", 64, "Directions on the ring.")
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
@build_option
@jobs_option
@json_option
def billboard(source: Path, out: Path, build: Path, jobs: int, as_json: bool, **knobs: Any) -> None:
    """Bake a relit sprite from a mesh: OBJ, PLY, STL, OFF, GLB, glTF."""
    from bake import billboard as stage
    from bake import mips
    from bake.store import Store
    from pipelines import bake_scene, output

    output.use_threads(jobs)
    angles = {
        "elevation": "elevation",
        "sun_diameter": "sun_diameter",
        "field_of_view": "perspective",
    }
    turned: dict[str, Any] = {name: radians(knobs[knob]) for name, knob in angles.items()}
    names = {field.name for field in fields(stage.Params)} & set(knobs) - set(angles)
    trace = stage.Params(**{name: knobs[name] for name in names}, **turned)
    packing = {
        "packing": "full" if knobs["packing"] == "full" else "twelve",
        "unpack": "talk" if knobs["packing"] == "talk" else "chroma",
    }
    chosen = {} if knobs["mip_filter"] is None else {"filter": knobs["mip_filter"]}
    pack = mips.Params(max_lod=knobs["max_lod"], depth=knobs["depth"], **packing, **chosen)
    with output.bars() as bar:
        watch = None if bar is None else lambda fraction: bar(source.name, fraction)
        entry = bake_scene.bake_billboard(Store(build / "store"), source, trace, pack, watch)
    output.delivered(entry, out, as_json)


@click.command()
@click.argument("source", type=file_path)
@folder_out
@click.option("--width", type=int, default=64, show_default=True, help="Texels round the horizon.")
@click.option("--rotate", type=float, default=0.0, show_default=True, help="Degrees about +y.")
@build_option
@json_option
def environment(
    source: Path, out: Path, width: int, rotate: float, build: Path, as_json: bool
) -> None:
    """Bake an environment light from a lat-long map: EXR, HDR, PNG, JPEG."""
    from functools import partial

    from bake import environment as stage
    from bake.recipe import Source
    from bake.store import Store
    from pipelines import output

    params = stage.Params(width=width, rotate=radians(rotate))
    inputs = Source((source,), partial(stage.load, source))
    output.delivered(
        Store(build / "store").run(stage.resample, inputs, params=params), out, as_json
    )


@click.command()
@click.argument("folder", type=file_path)
@click.option(
    "--light",
    "lights",
    multiple=True,
    required=True,
    help="X,Y,Z towards the light, or X,Y,Z,R,G,B with its irradiance (default pi).",
)
@click.option(
    "-o",
    "--output",
    "out",
    type=file_path,
    required=True,
    help="Picture: .png (with alpha) or .exr.",
)
@click.option(
    "--view", type=click.IntRange(0), default=0, show_default=True, help="Which of the baked sides."
)
@click.option("--exposure", type=float, default=0.0, show_default=True, help="EV.")
@json_option
def relight(
    folder: Path, lights: tuple[str, ...], out: Path, view: int, exposure: float, as_json: bool
) -> None:
    """Show a sprite under given lights, on the CPU, from the stored codes."""
    from pipelines import output, relit

    picture = relit.relight(folder, [relit.parse_light(text) for text in lights], view=view)
    relit.write(out, picture, exposure)
    output.wrote(out, as_json)


@click.command()
@click.argument("path", type=file_path)
@json_option
def inspect(path: Path, as_json: bool) -> None:
    """Tell what a baked folder or file is and how good; verify its seal."""
    from pipelines import inspection, output

    output.inspected(inspection.inspect(path), as_json)


@click.group()
def store() -> None:
    """Look after the store of baked assets."""


@store.command()
@build_option
@json_option
def verify(build: Path, as_json: bool) -> None:
    """Check every byte of every entry; exit code 4 where one is damaged."""
    from bake.store import Store
    from formats.errors import DamagedError
    from pipelines import output

    findings = Store(_existing(build)).verify()
    output.found(findings, as_json)
    if findings:
        remedy = "bake again: damaged entries are set aside and replaced"
        raise DamagedError(build / "store", "entries", f"{len(findings)} damaged", remedy)


@store.command()
@click.option("--dry-run", is_flag=True, help="Only tell what would go.")
@build_option
@json_option
def gc(build: Path, dry_run: bool, as_json: bool) -> None:
    """Remove entries that no scene in build/scenes uses; scene folders keep their own copies."""
    from bake.store import Store
    from pipelines import output
    from pipelines.bake_scene import keys_in_use

    removed = Store(_existing(build)).gc(keys_in_use(build), dry_run=dry_run)
    output.removed(removed, dry_run, as_json)


def _existing(build: Path) -> Path:
    """Return the store of a build folder; a look must not make one."""
    if not (build / "store").is_dir():
        from formats.errors import InputError

        raise InputError(
            build / "store", "", "no such folder", "name the build folder with --build"
        )
    return build / "store"


__all__ = ["BUILD", "add_to"]
