"""Up to which band should a mesh's occlusion be kept?

What bands alone cost is told by harmonics of each point's own rays, cut to l_max; beside it stand
the shipped volumes, where a higher band must share the same bytes: the talk's 16 numbers, and bands
in 512 KiB.
"""

from __future__ import annotations

import numpy as np

from bake import compress, occlusion
from pipelines.studies import occlusion_knob, shadow_steps
from pipelines.studies.answer import PRICES, Answer, Row, Shot
from pipelines.studies.occlusion_encodings import DEGREES, PLACES, Bench, benches
from pipelines.studies.occlusion_knob import BANDS
from pipelines.studies.subjects import Setting

TAKES = ("mesh",)
LIMITS = (1, 2, 3, 4, 5, 6, 7, 8)
QUICK = (2, 4, 7)
DEFAULT = occlusion.Params().l_max
OWN, FEW, MANY = "each point's own rays", "16 numbers", "bands, 512 KiB"


def measure(setting: Setting) -> Answer:
    """Cut occlusion to fewer and more bands."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    limits = QUICK if setting.quick else LIMITS
    knobs = {"grid": setting.pick(20, 32), "rays": setting.pick(256, 1024)}
    for bench in benches(setting, "bust", "mushrooms", "knot"):
        exact = exact_of(bench, max(limits), setting.pick(1024, 4096))
        for limit in limits:
            found = {OWN: exact(limit)}
            if limit < 8:
                few = compress.Params(components=min(16, (limit + 1) ** 2))
                found[FEW] = bench.shipped("l_max", few, l_max=limit, **knobs)
            if 1 < limit < 8:
                found[MANY] = bench.shipped("l_max", BANDS, l_max=limit, **knobs)
            for kind, row in found.items():
                what = f"{kind}, up to {limit}"
                shots[bench.name, what] = bench.shots[bench.name, str(row["setting"])]
                default = kind == FEW and limit == DEFAULT
                rows.append(occlusion_knob.marked(row, kind, what, default) | {"l_max": limit})
    most = max(limit for limit in limits if limit < 8)
    errors = {
        kind: {
            str(limit): occlusion_knob.mean_error(rows, "l_max", limit, kind)
            for limit in (DEFAULT, most)
        }
        for kind in (OWN, FEW, MANY)
    }
    gains = {kind: found[str(DEFAULT)] / found[str(most)] for kind, found in errors.items()}
    stop = occlusion_knob.enough(rows, "l_max", FEW)
    return occlusion_knob.answered(
        "occlusion_bands",
        f"As far as there are numbers for it: from band {DEFAULT} to {most} the error falls "
        f"{gains[OWN]:.1f} times by each point's own rays, {gains[MANY]:.1f} times in 512 KiB of "
        f"bands, but 16 numbers gain little beyond band {stop}",
        rows,
        axes={"l_max": "highest band", "bytes": PRICES["bytes"]},
        titles={
            "l_max": f"Bands alone: {errors[OWN][str(DEFAULT)]:.3f} up to {DEFAULT}, "
            f"{errors[OWN][str(most)]:.3f} up to {most}; 16 numbers stop gaining at {stop}"
        },
        shots=shots,
        panels=(
            occlusion_knob.by_light(
                rows, "l_max", "highest band", OWN,
                f"From band {min(limits)} to {most} lights of {DEGREES[0]} degrees gain "
                f"{fall(rows, DEGREES[0], most):.1f} times, of {DEGREES[-1]} "
                f"{fall(rows, DEGREES[-1], most):.1f} times", float(DEFAULT),
            ),
        ),
        figures={"errors": errors, "gains": gains, "stop": stop},
    )  # fmt: skip


def fall(rows: list[Row], degrees: int, most: int) -> float:
    """Return the first error over that of band `most`, of lights of a size, by own rays."""
    own = [r for r in rows if r["encoding"] == OWN]
    name = f"{PLACES[0]}_{degrees}"
    last = next(r for r in own if r["l_max"] == most)
    return float(own[0][name]) / float(last[name])


def exact_of(bench: Bench, most: int, rays: int):  # type: ignore[no-untyped-def]
    """Return a function from a limit to the row of harmonics by each point's own rays."""
    box, _, _ = occlusion.box_of(bench.mesh.vertices[np.unique(bench.mesh.faces)])
    known: dict[bytes, np.ndarray] = {}

    def terms(p: np.ndarray) -> np.ndarray:
        key = p.tobytes()
        if key not in known:
            at = np.asarray(box.centre) + 2 * p * np.asarray(box.half_extent)
            known[key] = shadow_steps.own_harmonics(bench.mesh, at, most, rays).astype(np.float32)
        return known[key]

    def row(limit: int) -> Row:
        return bench.row("l_max", f"{OWN}, {limit}", lambda p: terms(p)[:, : (limit + 1) ** 2])

    return row
