"""`bakelight occlusion`: a mesh becomes volumes that let it cast soft shadows while it moves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipelines.cli import build_option, file_path, jobs_option, json_option
from pipelines.price_cli import asked, bake_by_price, free, price_options, watch_of
from pipelines.single import folder_out, knob

if TYPE_CHECKING:
    from pipelines.bake_sprites import Step


@click.command()
@click.argument("source", metavar="MESH", type=file_path)
@folder_out
@knob("--grid", 32, "Voxels a side.")
@click.option(
    "--l-max",
    type=int,
    help="Highest band of spherical harmonics.  [default: 4; of bands 7 at 512 KiB, 5 at 128]",
)
@knob("--rays", 1024, "Rays of a voxel beside the mesh; far ones get fewer.")
@knob(
    "--adaptive", 0.0, "Stop a voxel at this share of its truncation error, such as 0.125; 0: no."
)
@knob(
    "--encoding",
    "talk",
    "talk: the main components of each voxel; bands: every harmonic, on two coarser grids.",
    ("talk", "bands"),
)
@knob("--components", 16, "Of talk: numbers a voxel, four a volume.")
@knob("--size", 512, "Of bands: KiB, at most.")
@knob("--depth", "8", "Bits a number: 8, or 16 as half floats.", ("8", "16"))
@price_options
@build_option
@jobs_option
@json_option
def occlusion(
    source: Path, out: Path, target_error: float | None, budget: float | None, build: Path,
    jobs: int, as_json: bool, **knobs: Any,
) -> None:  # fmt: skip
    """Bake the soft shadows that a mesh casts around it: OBJ, PLY, STL, OFF, GLB, glTF."""
    from bake.store import Store
    from pipelines import bake_sprites, output

    output.use_threads(jobs)
    if knobs["encoding"] == "bands":
        output.refuse(("components",), "remove it: only --encoding talk has it")
    elif target_error is None and budget is None:
        output.refuse(("size",), "add --encoding bands, or remove it")
    if ask := asked(target_error, budget):
        from pipelines.price_occlusion import CHOSEN, OcclusionAsset

        trace, pack = (step.params for step in steps(knobs))
        subject = OcclusionAsset(source, trace, pack, free(CHOSEN))
        with output.bars() as bar:
            watch = watch_of(bar, source)
            bake_by_price(Store(build / "store"), subject, ask, out, as_json, watch)
        return
    sprite = bake_sprites.Sprite(bake_sprites.mesh_source(source), steps(knobs))
    with output.bars() as bar:
        watch = None if bar is None else lambda fraction: bar(source.name, fraction)
        entry = bake_sprites.bake(Store(build / "store"), sprite, watch)
    if not as_json:
        from formats import report

        click.echo("\n".join(lines(report.read(entry.path))))
    output.delivered(entry, out, as_json)


def steps(knobs: dict[str, Any]) -> tuple[Step, ...]:
    """Return the stages that bake a mesh's occlusion with these options: rays, then codes."""
    from bake import compress
    from bake import occlusion as stage
    from formats.occlusion import Occlusion, OcclusionHarmonics
    from pipelines.bake_sprites import Step

    packing = ("encoding", "components", "size")
    pack = compress.Params(**{name: knobs[name] for name in packing}, depth=int(knobs["depth"]))
    if knobs["l_max"] is None:
        pack.check()
        knobs["l_max"] = 4 if pack.encoding == "talk" else compress.l_max_for(pack)
    trace = stage.Params(**{name: knobs[name] for name in ("grid", "l_max", "rays", "adaptive")})
    return (
        Step(stage.trace, trace, OcclusionHarmonics.load),
        Step(compress.compress, pack, Occlusion.load),
    )


def lines(data: dict[str, Any]) -> list[str]:
    """Return what the report of an occlusion volume says, in a few lines."""
    layout, quality = data["layout"], data["quality"]
    grids = [f"{x}^3" if x == y == z else f"{x} x {y} x {z}" for x, y, z in layout["grids"]]
    found = [
        f"occlusion: {' and '.join(grids)} voxels, l_max {layout['l_max']}, "
        f"{len(layout['basis'])} numbers of {layout['depth']} bits, "
        f"{quality['bytes'] / 1024:.0f} KiB, {quality['rays']} rays"
    ]
    losses = ("sampling_error", "truncation_error", "component_loss", "quantisation_loss")
    told = [f"{name.replace('_', ' ')} {quality[name]:.2g}" for name in losses]
    found.append(f"a coefficient, RMS: {', '.join(told)}")
    shadow = quality["shadow_rms"]
    if shadow:
        found.append(
            "shadow factor, RMS, of far round lights: "
            + ", ".join(
                f"{angle:g} degrees {error:.3f} (floats of all bands {floor:.3f})"
                for angle, error, floor in zip(
                    shadow["degrees"], shadow["codes"], shadow["harmonics"], strict=True
                )
            )
        )
    return found
