"""What studies measure on: meshes of ours, one made here in closed form, or the user's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from time import process_time
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bake import billboard, sources
from formats.coefficients import Coefficients
from formats.mesh import Material, Mesh
from maths import circular_harmonics

Result = TypeVar("Result")

SHORT = 0.5  # seconds
MESHES = Path(__file__).resolve().parents[2] / "assets" / "meshes"


@dataclass(frozen=True)
class Setting:
    """How a study is run.

    quick : fewer points and smaller pictures. source : a file of the user instead of the study's
    own subjects; a run gives it to those studies alone whose TAKES names its kind. seed : of
    whatever is random; bakes are not.
    """

    quick: bool = False
    source: Path | None = None
    seed: int = 0

    def pick(self, quick: int, full: int) -> int:
        """Return `quick` in a quick run, else `full`."""
        return quick if self.quick else full

    def meshes(self, *names: str) -> dict[str, Mesh]:
        """Return subjects by name: "knot", or files of assets/meshes.

        The user's own mesh replaces all; a quick run keeps the first.
        """
        if self.source is not None:
            return {self.source.stem: _loaded(self.source)}
        return {name: named(name) for name in (names[:1] if self.quick else names)}


def named(name: str) -> Mesh:
    """Return the subject of that name."""
    return knot() if name == "knot" else _loaded(MESHES / f"{name}.glb")


@lru_cache(maxsize=8)
def _loaded(path: Path) -> Mesh:
    return sources.load(path)


@lru_cache(maxsize=2)
def knot(around: int = 500, across: int = 70) -> Mesh:
    """Return a closed coloured (2, 3) torus knot of 2 * around * across faces, about a metre tall.

    It shadows itself from every side. Its hue turns twice along the tube.
    """
    u, v = (2 * np.pi * np.arange(n) / n for n in (around, across))
    centre = _knot_curve(u)
    # A frame that closes: the curve's own normal made square to its tangent
    tangent = _unit(_knot_curve(u + 1e-4) - _knot_curve(u - 1e-4))
    outward = np.stack([np.cos(2 * u), np.zeros_like(u), np.sin(2 * u)], axis=1)
    normal = _unit(outward - np.einsum("ij,ij->i", outward, tangent)[:, None] * tangent)
    other = np.cross(tangent, normal)
    # Ribs, so that there is detail of a few texels
    radius = 0.17 * (1 + 0.12 * np.cos(7 * v)[None, :] * np.cos(24 * u)[:, None])
    ring = np.cos(v)[None, :, None] * normal[:, None] + np.sin(v)[None, :, None] * other[:, None]
    vertices = (centre[:, None] + radius[..., None] * ring).reshape(-1, 3)
    vertices[:, 1] -= vertices[:, 1].min()
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    corners = [
        ((i + a) % around) * across + (j + b) % across for a, b in ((0, 0), (0, 1), (1, 1), (1, 0))
    ]
    a, b, c, d = (corner.ravel() for corner in corners)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    hue = np.repeat(2 * u, across)
    colours = 0.45 + 0.4 * np.stack([np.sin(hue + k * 2 * np.pi / 3) for k in range(3)], axis=1)
    return Mesh(
        vertices=vertices,
        faces=faces,
        normals=sources.corner_normals(vertices, faces).astype(np.float32),
        material=np.zeros(len(faces), np.int32),
        materials=(Material("glaze", (1.0, 1.0, 1.0)),),
        colours=colours.astype(np.float32),
    )


def _knot_curve(u: NDArray[np.float64]) -> NDArray[np.float64]:
    wide = 0.42 * (1 + 0.42 * np.cos(3 * u))
    return np.stack([wide * np.cos(2 * u), 0.42 * np.sin(3 * u), wide * np.sin(2 * u)], axis=1)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def relit(master: Coefficients, azimuth: float) -> NDArray[np.float32]:
    """Return view 0 under one light of the ring: (h, w, 4) premultiplied, 0 to 1."""
    basis = circular_harmonics.evaluate(np.asarray(azimuth), master.ring.terms)
    colour = np.maximum(np.einsum("khwc,k->hwc", master.terms[0], basis), 0)
    # The peak is what all but a ten-thousandth of the lit values stay below
    peak = float(np.quantile(colour[colour > 0], 0.9999)) if (colour > 0).any() else 1.0
    return np.concatenate(
        [np.minimum(colour / peak, 1), master.alpha[0][..., None]], axis=-1
    ).astype(np.float32)


def traced(mesh: Mesh, **knobs: Any) -> Coefficients:
    """Bake a mesh with the defaults of `bakelight billboard`, but for the knobs given."""
    return billboard.trace(mesh, params=billboard.Params(**knobs))


def processor_seconds(
    function: Callable[..., Result], *values: Any, **named: Any
) -> tuple[Result, float]:
    """Call a function; return its result and the processor time of all threads, in seconds.

    On a machine with other work to do, that says more than the clock on the wall. What takes less
    than SHORT is called again, and the faster counts: the first call also loads and allocates.
    """
    least = np.inf
    for _ in range(2):
        started = process_time()
        result = function(*values, **named)
        least = min(least, process_time() - started)
        if least > SHORT:
            break
    return result, least
