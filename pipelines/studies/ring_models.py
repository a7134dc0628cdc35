"""How wrong is a sun that leaves the ring?

A light at sine s from the ring's axis, where the ring has s0, is projected as E g^h B with
g = min(1, s / s0). The truth is the sprite rendered under lights at that elevation. Beside the
model stand the same light pushed on to the ring (g = 1), and the best that the terms could do: a
ring baked at that very elevation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from formats.coefficients import Coefficients
from formats.mesh import Mesh
from maths import circular_harmonics
from maths.image_error import psnr
from pipelines.studies import sprite_errors
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.interval import rms
from pipelines.studies.subjects import Setting, traced

TAKES = ("mesh",)
RING = 30.0  # degrees above the ring's plane, the default
ELEVATIONS = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0)
QUICK = (0.0, 30.0, 75.0)
MODELS = ("g^h", "on the ring", "own ring")


def measure(setting: Setting) -> Answer:
    """Relight by each model and compare with renders, over elevations and for both axes."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in setting.meshes("knot", "oak").items():
        for axis in ("view", "up"):
            rows += _rows(name, mesh, axis, setting, shots)
    loss = {
        elevation: loss_at(rows, elevation) for elevation in sorted({elevation_of(r) for r in rows})
    }
    table = [r for r in rows if "gain_db" in r]
    near, far = (min((e for e in loss if e > RING + d), default=RING) for d in (0, 30))
    gain = max(float(r["gain_db"]) for r in table)
    return Answer(
        question="ring_models",
        title=f"A sun {near - RING:.0f} degrees off its ring costs up to {loss[near]:.0f} dB"
        + (f", {far - RING:.0f} degrees {loss[far]:.0f} dB" if far > near else "")
        + f"; g^h gives back up to {gain:.1f} dB",
        truth="the sprite rendered under lights at that elevation",
        rows=rows,
        unit="RMS error at lights of that elevation, share of the brightest value",
        axes={"elevation": "elevation of the light above the ring's plane, degrees"},
        titles={"elevation": f"A ring errs least by suns that stand on it, at {RING:.0f} degrees"},
        decibels=True,
        shots=shots,
        table=table,
        panels=[
            Panel(
                "elevation of the light above the ring's plane, degrees",
                f"PSNR, dB (axis {axis})",
                {
                    f"{name}: {model}": [
                        (float(r["elevation"]), float(r[model]))
                        for r in table
                        if r["subject"] == name and r["axis"] == axis
                    ]
                    for name in dict.fromkeys(str(r["subject"]) for r in table)
                    for model in MODELS
                },
                marked=RING,
                scales=("linear", "linear"),
                title=f"Axis {axis}: up to {most_lost(table, axis):.0f} dB are lost off the ring",
            )
            for axis in ("view", "up")
        ],
        figures={"largest_loss_db": loss, "largest_gain_of_g_db": gain},
    )


def elevation_of(row: Row) -> float:
    """Return the elevation of a row's lights, degrees."""
    return float(row["elevation"])


def loss_at(rows: list[Row], elevation: float) -> float:
    """Return the most that g^h loses against a ring of that elevation, over all subjects, dB."""
    here = [row for row in rows if elevation_of(row) == elevation and "gain_db" in row]
    return max(float(row["own ring"]) - float(row["g^h"]) for row in here)


def most_lost(table: list[Row], axis: str) -> float:
    """Return the most that g^h loses against a ring of the light's own elevation, dB."""
    return max(float(r["own ring"]) - float(r["g^h"]) for r in table if r["axis"] == axis)


def _rows(
    name: str, mesh: Mesh, axis: str, setting: Setting, shots: dict[tuple[str, str], Shot]
) -> list[Row]:
    knobs = {
        "resolution": setting.pick(48, 160),
        "samples": setting.pick(4, 16),
        "lights": setting.pick(16, 64),
        "held_out": setting.pick(4, 16),
        "axis": axis,
    }
    ring = traced(mesh, **knobs, elevation=float(np.radians(RING)))
    rows: list[Row] = []
    for elevation in QUICK if setting.quick else ELEVATIONS:
        truth = traced(mesh, **knobs, elevation=float(np.radians(elevation)))
        directions = circular_harmonics.ring_direction(
            np.asarray(truth.held_out_angles), axis, float(np.radians(elevation))
        )
        relit = {
            "g^h": relit_by(ring, model(ring, directions)),
            "on the ring": relit_by(ring, on_ring(ring, directions)),
            "own ring": relit_by(truth, model(truth, directions)),
        }
        peak = float(truth.held_out.max())
        decibels = {key: psnr(truth.held_out, picture, peak) for key, picture in relit.items()}
        gain = decibels["g^h"] - decibels["on the ring"]
        rows.append(
            {"subject": name, "axis": axis, "elevation": elevation, **decibels, "gain_db": gain}
        )
        height = float(np.radians(elevation))
        towards = circular_harmonics.ring_direction(np.array([sprite_errors.AZIMUTH]), axis, height)
        lights = {
            "g^h": (ring, model(ring, towards)),
            "on the ring": (ring, on_ring(ring, towards)),
            "own ring": (truth, model(truth, towards)),
        }
        stage = sprite_errors.Stage(
            sprite_errors.rendered(mesh, ring, elevation=height), ring.alpha[0]
        )
        for key, (master, light) in lights.items():
            apart = (relit[key] - truth.held_out).astype(np.float64) / peak
            what = f"{key}, {elevation:g} degrees, axis {axis}"
            rows.append(
                point(
                    name,
                    what,
                    rms(np.mean(np.square(apart), axis=(1, 2))),
                    series=f"{key}, axis {axis}",
                    default=key == "g^h" and elevation == RING,
                    axis=axis,
                    elevation=elevation,
                )
            )
            made = np.einsum("khwc,k->hwc", master.terms[0], light[0].astype(np.float32))
            shots[name, what] = stage.shot_of(np.maximum(made, 0))
    return rows


def model(master: Coefficients, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients (M, K) of suns of unit irradiance from directions (M, 3), by g^h."""
    ring = master.ring
    projected = circular_harmonics.project_sun(
        directions,
        np.ones(3),
        ring.terms,
        axis=ring.axis,
        elevation=ring.elevation,
        one_sided=ring.one_sided,
    )
    return np.asarray(projected[..., 0])


def on_ring(master: Coefficients, directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients (M, K) of the same suns pushed on to the ring: B alone."""
    azimuths, _, _ = circular_harmonics.ring_coordinates(directions, master.ring.axis)
    return np.asarray(circular_harmonics.evaluate(azimuths, master.ring.terms))


def relit_by(master: Coefficients, light: NDArray[np.float64]) -> NDArray[np.float32]:
    """Relight by coefficients (M, K) the texels with held-out renders: (M, n, 3), clamped at 0."""
    Y = master.terms[0].reshape(master.ring.terms, -1, 3)[:, master.held_out_texels]
    return np.asarray(np.maximum(np.einsum("mk,kpc->mpc", light.astype(np.float32), Y), 0))
