"""How many lights must each subsample cast shadow rays to?

Subsamples take turns with the lights (see bake/gather.py). The truth is the same sprite with 16
times the subsamples, each of which sees every light; what the turns alone cost is the difference
from a bake whose 16 subsamples all see every light. 96 lights give shares that 64 do not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bake import billboard
from bake.gather import turns_of
from formats.mesh import Mesh
from pipelines.studies import ray_calls, sprite_errors
from pipelines.studies.answer import PRICES, Answer, Panel, Row, Shot, lines_of, point
from pipelines.studies.light_directions import peak_of, relit_error
from pipelines.studies.subjects import Setting, traced, traced_in

TAKES = ("mesh",)
ASKED = (4, 6, 8, 12, 16, 32, 64)
QUICK = (4, 8, 16)
SAMPLES = 16
LIGHTS = (64, 96)
DEFAULT = 8
TRUTH = 16  # times the subsamples


def measure(setting: Setting) -> Answer:
    """Bake with fewer and fewer shadow rays and compare with all of them."""
    resolution = setting.pick(40, 128)
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in setting.meshes("knot", "oak").items():
        for lights in LIGHTS[: setting.pick(1, 2)]:
            rows += _rows(name, lights, mesh, resolution, setting, shots)
    default = [r for r in rows if r["lights"] == LIGHTS[0] and r["lights_per_sample"] == DEFAULT]
    saved = min(float(r["rays_share"]) for r in default)
    added = max(float(r["loss_db"]) for r in default)
    seen = max(float(r["held_out_loss_db"]) for r in default)
    return Answer(
        question="shadow_rays",
        title=f"{DEFAULT} lights a subsample: {1 / saved:.1f} times fewer rays, "
        + (f"for {seen:.2f} dB of held-out PSNR" if seen > 0.005 else "at no loss that shows"),
        truth=f"the same sprite with {TRUTH} times the subsamples, each seeing every light",
        rows=rows,
        unit=sprite_errors.UNIT,
        axes={"rays": "rays cast", **PRICES},
        decibels=True,
        shots=shots,
        panels=(
            Panel(
                "lights that each subsample sees",
                "PSNR against every light, dB",
                lines_of(rows, "lights_per_sample", "psnr_db", "series"),
                DEFAULT,
                title=f"{DEFAULT} lights a subsample err by {added:.2g} dB more than all of them",
            ),
        ),
        figures={"share_of_rays": saved, "loss_db": added, "held_out_loss_db": seen},
    )


def _rows(
    name: str,
    lights: int,
    mesh: Mesh,
    resolution: int,
    setting: Setting,
    shots: dict[tuple[str, str], Shot],
) -> list[Row]:
    knobs = {"resolution": resolution, "lights": lights, "held_out": 8}
    times = setting.pick(4, TRUTH)
    truth = traced(mesh, **knobs, samples=SAMPLES * times, lights_per_sample=lights)
    alone: dict[str, Any] = {**knobs, "samples": SAMPLES}
    stage = sprite_errors.stage(mesh, truth)
    rows: list[Row] = []
    seen: set[int] = set()
    for asked in (*(QUICK if setting.quick else ASKED), lights):
        least = min(asked, lights)
        per_sample = lights // turns_of(lights, SAMPLES, 5, least)
        if per_sample in seen:
            continue
        seen.add(per_sample)
        master, seconds = traced_in(mesh, **alone, lights_per_sample=least)
        error = relit_error(master.terms[0], truth.terms[0], truth.alpha[0])
        params = billboard.Params(**alone | {"lights_per_sample": least, "held_out": 0})
        what = f"{per_sample} of {lights} lights"
        rows.append(
            point(
                name,
                what,
                sprite_errors.held_out(master),
                series=f"{name}, {lights} lights",
                bake_seconds=seconds,
                default=(lights, per_sample) == (LIGHTS[0], DEFAULT),
                lights=lights,
                lights_per_sample=per_sample,
                psnr_db=float(20 * np.log10(peak_of(truth) / error)),
                held_out_db=master.quality["held_out_psnr"],
                rays=ray_calls.cast(mesh, params).rays,
            )
        )
        shots[name, what] = stage.shot(master.terms[0])
    rows.sort(key=lambda row: int(row["lights_per_sample"]))
    every = rows[-1]
    for row in rows:
        row["loss_db"] = float(every["psnr_db"]) - float(row["psnr_db"])
        row["held_out_loss_db"] = float(every["held_out_db"]) - float(row["held_out_db"])
        row["rays_share"] = float(row["rays"]) / float(every["rays"])
    return rows
