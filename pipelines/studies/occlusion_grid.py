"""How fine a grid does an occlusion volume need?

Volumes of n^3 voxels, looked up between them: as traced, in floats, so that the grid alone errs
beside the bands; as the talk's 16 numbers of 8 bits, whose bytes grow with the grid; and fitted to
bands in 512 KiB, whose bytes do not.
"""

from __future__ import annotations

from bake import occlusion
from pipelines.studies import occlusion_knob
from pipelines.studies.answer import PRICES, Answer, Row, Shot
from pipelines.studies.occlusion_encodings import TALK, benches, even
from pipelines.studies.occlusion_knob import BANDS, SLACK
from pipelines.studies.subjects import Setting

TAKES = ("mesh",)
GRIDS = (8, 12, 16, 24, 32, 48, 64)
QUICK = (8, 16, 32)
DEFAULT = occlusion.Params().grid
FLOAT, FEW, MANY = "as traced, floats", "16 numbers", "bands, 512 KiB"


def measure(setting: Setting) -> Answer:
    """Trace coarser and finer volumes."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    grids = QUICK if setting.quick else GRIDS
    rays = setting.pick(128, 512)
    for bench in benches(setting, "bust", "mushrooms", "knot"):
        for grid in grids:
            master, seconds = bench.trace(grid=grid, rays=rays)
            told = {"grid": grid, "seconds": seconds, "kib": master.terms.nbytes / 1024}
            found = {
                FLOAT: bench.row("knob", FLOAT, even(master.terms), **told),
                FEW: bench.shipped("knob", TALK, grid=grid, rays=rays, l_max=4),
                MANY: bench.shipped("knob", BANDS, grid=grid, rays=rays),
            }
            for kind, row in found.items():
                what = f"{kind}, {grid}^3"
                shots[bench.name, what] = bench.shots[bench.name, str(row["setting"])]
                rows.append(occlusion_knob.marked(row, kind, what, kind == FEW and grid == DEFAULT))
    least = {kind: occlusion_knob.enough(rows, "grid", kind) for kind in (FLOAT, FEW, MANY)}
    first, last = min(grids), max(grids)
    gains = {
        kind: occlusion_knob.mean_error(rows, "grid", first, kind)
        / occlusion_knob.mean_error(rows, "grid", last, kind)
        for kind in least
    }
    told_least = f"{least[FEW]}^3 for 16 numbers and {least[MANY]}^3 for bands in 512 KiB"
    return occlusion_knob.answered(
        "occlusion_grid",
        f"{told_least} come within {SLACK:.0%} of the finest; {first}^3 errs {gains[FEW]:.2f} and "
        f"{gains[MANY]:.2f} times as much as {last}^3",
        rows,
        axes={"grid": "voxels an axis", **PRICES},
        titles={"grid": f"{told_least} are enough; floats of all harmonics need {least[FLOAT]}^3"},
        shots=shots,
        panels=(
            occlusion_knob.by_light(
                rows, "grid", "voxels an axis", MANY,
                f"From {first}^3 to {last}^3 the error of bands falls by {gains[MANY]:.1f}",
                None,
            ),
        ),
        figures={"enough": least, "coarsest_over_finest": gains},
    )  # fmt: skip
