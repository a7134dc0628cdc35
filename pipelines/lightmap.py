"""`bakelight lightmap`: the light of a world of cubes that does not move, with its bounces."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipelines.cli import build_option, file_path, jobs_option, json_option
from pipelines.price_cli import (
    asked,
    bake_by_price,
    price_options,
    refuse_written,
    watch_of,
)  # fmt: skip
from pipelines.single import folder_out, knob

if TYPE_CHECKING:
    from bake.recipe import Entry, Input, Source
    from bake.store import Store
    from formats.voxels import Voxels

SKY_WIDTH = 256
"""Texels round the horizon of an environment."""


@click.command()
@click.argument("source", type=file_path)
@folder_out
@knob("--texels", 2, "Texels along a cell side.")
@knob("--rays", 1024, "Rays a texel, at most; as many again are aimed at what glows.")
@knob("--bounces", -1, "How often light is handed on; -1: all.")
@knob("--target", 0.02, "Relative error, RMS over texels, at which rays end; 0: cast all.")
@click.option("--environment", type=file_path, help="Lat-long map around the world: EXR, HDR.")
@knob("--sky", 1.0, "Factor on the environment.")
@click.option("--below", is_flag=True, help="Light the lowest side of the world, too.")
@click.option(
    "--emissive", multiple=True, metavar="WHAT=R,G,B", help="What glows, as for `voxels`."
)
@click.option("--cell-size", type=float, help="Metres of a cell of a .vox file.")
@click.option("--grid", type=int, help="Cells along a mesh's longest side.")
@price_options
@build_option
@jobs_option
@json_option
def lightmap(
    source: Path, out: Path, environment: Path | None, emissive: tuple[str, ...],
    cell_size: float | None, grid: int | None, target_error: float | None, budget: float | None,
    build: Path, jobs: int, as_json: bool, **knobs: Any,
) -> None:  # fmt: skip
    """Bake the light on the faces of a world of cubes: a baked folder, .vox, .xraw or a mesh."""
    from bake import lightmap as stage
    from bake.store import Store
    from pipelines import output

    output.use_threads(jobs)
    if environment is None:
        output.refuse(("sky",), "add --environment, or remove it")
    params = stage.Params(**knobs)
    params.check()
    store = Store(build / "store")
    with output.bars() as bar:
        watch = None if bar is None else lambda fraction: bar(source.name, fraction)
        inputs = [world(store, source, emissive, cell_size=cell_size, grid=grid)]
        inputs += [] if environment is None else [sky(store, environment)]
        if ask := asked(target_error, budget):
            from pipelines.price_lightmap import of_inputs

            refuse_written(("rays", "target"))
            subject = of_inputs(str(source), inputs, params)
            bake_by_price(store, subject, ask, out, as_json, watch_of(bar, source))
            return
        entry = store.run(stage.light, *inputs, params=params, on_progress=watch)
    if not as_json:
        from formats import report

        click.echo("\n".join(lines(report.read(entry.path))))
    output.delivered(entry, out, as_json)


def world(
    store: Store, source: Path, emissive: tuple[str, ...], *, cell_size: float | None,
    grid: int | None,
) -> Input:  # fmt: skip
    """Return a world as an input: a baked folder as it is, anything else baked first. InputError.

    emissive, cell_size, grid : as the options of `voxels`; None where not given.
    """
    from bake.recipe import Baked
    from formats.errors import InputError
    from formats.voxels import Voxels
    from pipelines import bake_sprites, voxels

    if source.is_dir():
        for name, value in (("emissive", emissive), ("cell-size", cell_size), ("grid", grid)):
            if value:
                remedy = "give it where the world is baked, not to its folder"
                raise InputError("command line", f"--{name}", value, remedy)
        return _folder(source)
    marked = tuple(voxels.parse_emissive(text) for text in emissive)
    knobs: dict[str, Any] = {"cell_size": cell_size, "grid": grid, "emissive": marked}
    given, step = voxels.chosen(source, knobs | {"emission_scale": 1.0, "solid": True})
    entry: Entry = bake_sprites.bake(store, bake_sprites.Sprite(given, (step,)))
    return Baked(entry, Voxels.load)


def sky(store: Store, path: Path) -> Input:
    """Return an environment as an input, resampled. InputError."""
    from bake import environment
    from bake.recipe import Baked, Source
    from formats.environment import Environment

    given = Source((path,), partial(environment.load, path))
    params = environment.Params(width=SKY_WIDTH)
    return Baked(store.run(environment.resample, given, params=params), Environment.load)


def load_folder(report: Path) -> Voxels:
    """Read the world whose folder holds this report. InputError, DamagedError."""
    from formats.voxels import Voxels

    return Voxels.load(report.parent)


def _folder(folder: Path) -> Source[Voxels]:
    from bake.recipe import Source
    from formats import report
    from formats.errors import InputError
    from formats.voxels import CELLS, KIND, LIGHT

    if not (folder / report.NAME).is_file() or report.read(folder).get("kind") != KIND:
        remedy = "name a folder that `bakelight voxels` made, a .vox file or a mesh"
        raise InputError(folder, "", "not a baked world of cubes", remedy)
    paths = tuple(folder / name for name in (report.NAME, CELLS, LIGHT))
    return Source(paths, partial(load_folder, paths[0]))


def lines(data: dict[str, Any]) -> list[str]:
    """Return what the report of a lightmap says, in a few lines."""
    layout, quality = data["layout"], data["quality"]
    width, height = layout["size"]
    used = quality["texels"] / (width * height)
    return [
        f"lightmap: {quality['texels']} texels on {layout['rectangles']} rectangles, atlas "
        f"{width} x {height}, {used:.0%} of it in use",
        f"light: {quality['rays']} rays a texel, {quality['bounces']} bounces, relative error "
        f"{quality['relative_error']:.2%} RMS (one standard error), "
        f"{quality['glowing_faces']} faces glow",
    ]
