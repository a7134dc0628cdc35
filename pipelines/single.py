"""Commands on one asset: bake it from one file, relight it, look into it, look after the store."""

from __future__ import annotations

from collections.abc import Callable
from math import radians
from pathlib import Path
from typing import Any, TypeVar

import click

from pipelines.cli import BUILD, build_option, file_path, json_option

folder_out = click.option(
    "-o", "--output", "out", type=file_path, required=True, help="Folder of the asset."
)


def add_to(group: click.Group) -> None:
    """Hang these commands under the program."""
    from pipelines.billboard import billboard
    from pipelines.doctor import doctor
    from pipelines.lightmap import lightmap
    from pipelines.occlusion import occlusion
    from pipelines.photographs import photographs
    from pipelines.transfer import transfer
    from pipelines.voxels import voxels

    commands = (
        billboard,
        doctor,
        environment,
        lightmap,
        occlusion,
        photographs,
        transfer,
        voxels,
        relight,
        inspect,
        store,
    )
    for command in commands:
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
    help="X,Y,Z towards the light, or X,Y,Z,R,G,B with its irradiance (default pi).",
)
@click.option(
    "--environment",
    "environments",
    multiple=True,
    metavar="FILE[,SCALE[,ROTATE]]",
    help="Lat-long map, EXR or HDR, around the sprite, turned by degrees about +y.",
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
    folder: Path,
    lights: tuple[str, ...],
    environments: tuple[str, ...],
    out: Path,
    view: int,
    exposure: float,
    as_json: bool,
) -> None:
    """Show a sprite under the sum of given lights, on the CPU, from the stored codes."""
    from formats.errors import InputError
    from pipelines import output, relit

    if not lights and not environments:
        remedy = "give at least one --light or --environment"
        raise InputError("command line", "--light", "none", remedy)
    suns = [relit.parse_light(text) for text in lights]
    maps = [relit.parse_environment(text) for text in environments]
    picture = relit.relight(folder, suns, maps, view=view)
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
