"""`bakelight transfer`: a mesh becomes one that shades and lights itself under any light."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pipelines.cli import build_option, file_path, jobs_option, json_option
from pipelines.price_cli import asked, bake_by_price, free, price_options, watch_of
from pipelines.single import folder_out, knob


@click.command()
@click.argument("source", metavar="MESH", type=file_path)
@folder_out
@knob(
    "--mode",
    "interreflected",
    "What vertices know: the light alone, what hides it, or what bounces too.",
    ("unshadowed", "shadowed", "interreflected"),
)
@knob("--l-max", 4, "Highest band of spherical harmonics.")
@knob("--rays", 256, "Rays of a vertex.")
@knob("--bounces", 2, "Of light from the mesh to itself.")
@knob("--edge", 0.03125, "Longest edge over the mesh's longest side; longer are halved; 0: none.")
@knob("--components", 24, "Numbers a vertex, in fours.")
@knob("--depth", "8", "Bits a number: 8, or 16 as half floats.", ("8", "16"))
@price_options
@build_option
@jobs_option
@json_option
def transfer(
    source: Path, out: Path, target_error: float | None, budget: float | None, build: Path,
    jobs: int, as_json: bool, **knobs: Any,
) -> None:  # fmt: skip
    """Bake what a mesh's vertices make of light: OBJ, PLY, STL, OFF, GLB, glTF."""
    from bake import transfer as stage
    from bake.store import Store
    from pipelines import bake_sprites, output

    output.use_threads(jobs)
    params = stage.Params(**{**knobs, "depth": int(knobs["depth"])})
    if ask := asked(target_error, budget):
        from pipelines.price_transfer import CHOSEN, TransferAsset

        subject = TransferAsset(source, params, free(CHOSEN))
        with output.bars() as bar:
            watch = watch_of(bar, source)
            bake_by_price(Store(build / "store"), subject, ask, out, as_json, watch)
        return
    inputs = bake_sprites.mesh_source(source)
    with output.bars() as bar:
        watch = None if bar is None else lambda fraction: bar(source.name, fraction)
        entry = Store(build / "store").run(stage.trace, inputs, params=params, on_progress=watch)
    if not as_json:
        from formats import report

        click.echo("\n".join(lines(report.read(entry.path))))
    output.delivered(entry, out, as_json)


def lines(data: dict[str, Any]) -> list[str]:
    """Return what the report of a transfer mesh says, in a few lines."""
    layout, quality = data["layout"], data["quality"]
    colours = "colours" if layout["channels"] == 3 else "grey"
    return [
        f"transfer: {quality['mode']}, {data['vertices']} vertices, {data['faces']} faces (of "
        f"{quality['faces_in']} in the file), l_max {layout['l_max']}, {layout['components']} "
        f"numbers of {layout['depth']} bits, {colours}, {quality['bytes'] / 1024:.0f} KiB",
        f"{100 * quality['hidden_share']:.3g} % of an even sky is hidden; standard error of a "
        f"coefficient {quality['sampling_error']:.2g} of {quality['vectors_rms']:.2g}; numbers "
        f"change the irradiance of far points of light by {100 * quality['irradiance_rms']:.2g} %",
    ]
