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
from pipelines.studies.answer import Answer, Panel, Row
from pipelines.studies.subjects import Setting, traced

RING = 30.0  # degrees above the ring's plane, the default
ELEVATIONS = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0)
QUICK = (0.0, 30.0, 75.0)
MODELS = ("g^h", "on the ring", "own ring")


def measure(setting: Setting) -> Answer:
    """Relight by each model and compare with renders, over elevations and for both axes."""
    rows: list[Row] = []
    for name, mesh in setting.meshes("knot", "oak").items():
        for axis in ("view", "up"):
            rows += _rows(name, mesh, axis, setting)
    loss = {
        elevation: loss_at(rows, elevation) for elevation in sorted({elevation_of(r) for r in rows})
    }
    near, far = (min((e for e in loss if e > RING + d), default=RING) for d in (0, 30))
    gain = max(float(r["gain_db"]) for r in rows)
    return Answer(
        question="ring_models",
        title=f"A sun {near - RING:.0f} degrees off its ring costs up to {loss[near]:.0f} dB, "
        f"{far - RING:.0f} degrees {loss[far]:.0f} dB; g^h gives back up to {gain:.1f} dB",
        truth="the sprite rendered under lights at that elevation",
        rows=rows,
        panels=[
            Panel(
                "elevation of the light above the ring's plane, degrees",
                f"PSNR, dB (axis {axis})",
                {
                    f"{name}: {model}": [
                        (float(r["elevation"]), float(r[model]))
                        for r in rows
                        if r["subject"] == name and r["axis"] == axis
                    ]
                    for name in dict.fromkeys(str(r["subject"]) for r in rows)
                    for model in MODELS
                },
                marked=RING,
                scales=("linear", "linear"),
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
    here = [row for row in rows if elevation_of(row) == elevation]
    return max(float(row["own ring"]) - float(row["g^h"]) for row in here)


def _rows(name: str, mesh: Mesh, axis: str, setting: Setting) -> list[Row]:
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
