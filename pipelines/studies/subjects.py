"""What studies measure on: meshes of ours, one made here in closed form, or the user's own."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import billboard
from formats import mesh as meshfile
from formats import scene as scenes
from formats.coefficients import Coefficients
from formats.files import light_positions, vox
from formats.mesh import Mesh
from maths import circular_harmonics
from pipelines.studies import meshes, stages

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
            return {self.source.stem: stages.remembered(meshes.source(self.source))}
        return {name: named(name) for name in (names[:1] if self.quick else names)}


def check(source: Path, kind: str) -> None:
    """Read a source of a kind once, so that what cannot be used is said once, and of the file
    itself. InputError names what is wrong with it and the remedy."""
    if kind == "mesh":
        meshes.loaded(source)
    elif kind == "scene":
        scenes.load(source)
    elif kind == "voxels":
        vox.read(source)
    else:
        light_positions.read(source)


def named(name: str) -> Mesh:
    """Return the subject of that name."""
    own = meshes.own() if name == "knot" else meshes.source(MESHES / f"{name}.glb")
    return stages.remembered(own)


def placed(setting: Setting, own: str, folder: Path, size: float) -> Path:
    """Put the mesh of a scene into a folder and return its file: our own as it is; the user's as
    GLB, on the ground in the middle, `size` metres along its longest side."""
    folder.mkdir(parents=True, exist_ok=True)
    if setting.source is None:
        shutil.copy(MESHES / own, folder / own)
        return folder / own
    mesh = meshes.loaded(setting.source)
    used = mesh.vertices[np.unique(mesh.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    foot = (low + high) / 2 * [1, 0, 1] + low * [0, 1, 0]
    longest = float((high - low).max()) or 1.0
    replace(mesh, vertices=(mesh.vertices - foot) / longest * size).save(folder)
    # Any name is one that a scene may write
    return (folder / meshfile.NAME).rename(folder / "source.glb")


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
    return traced_in(mesh, **knobs)[0]


def traced_in(mesh: Mesh, **knobs: Any) -> tuple[Coefficients, float]:
    """Return `traced`, and the processor's seconds that it took, now or when it was baked."""
    params = billboard.Params(**knobs)
    return stages.run(billboard.trace, mesh, Coefficients.load, params=params)
