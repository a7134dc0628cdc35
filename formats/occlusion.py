"""What a mesh hides from the points around it: the float master of the rays, and volumes to play.

The box is the mesh's bounding box with each half-extent doubled, thin axes first padded to a
quarter of the longest. With p = (x - centre) / (2 half_extent) an axis, x in the mesh's own space,
the volume is p from -1 to 1 and the mesh within +-1/2; voxel centres lie at (i + 1/2) / n of it.
Stored is occlusion O = 1 - V, V the visibility of what is far away, projected on spherical
harmonics (no cosine), directions in the mesh's own axes. A distant light of radiance coefficients L
is seen with its share `1 - L.O / L.U`, U = (2 sqrt(pi), 0, ...).

A volume to play has one grid, cubic and even (encoding "talk"), or two: the first components on a
finer one, the others on a coarser one, as what is stored of high bands is small and counts only for
small lights. Grids may have other sizes along x, y and z, and be finer in the middle:
`occlusion_warp` of `warp` maps places to texture coordinates.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field, replace
from math import isqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from formats import report, seal
from formats.errors import DamagedError, InputError
from formats.files import atomic, ktx2
from formats.files.reading import read_bytes, refusing
from maths.occlusion_shadow import occlusion_place, occlusion_unwarp, occlusion_warp
from maths.trilinear import looked_up

MASTER, MASTER_NAME = "occlusion_harmonics", "harmonics.npz"
KIND, NAME, COARSE_NAME = "occlusion", "occlusion.ktx2", "coarse.ktx2"
FORMATS = {MASTER: 1, KIND: 2}
AGAIN = "bake it again"
MAX_BYTES = 1 << 30

Float = NDArray[np.float32]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Box:
    """Where a volume lies in the space of its mesh. centre, half_extent : (x, y, z), metres, of the
    bounding box, thin axes padded; the volume reaches twice as far."""

    centre: tuple[float, float, float]
    half_extent: tuple[float, float, float]

    @property
    def longest_axis(self) -> int:
        """0, 1 or 2: the first of the longest axes, between whose ends lights are lerped."""
        return int(np.argmax(self.half_extent))

    def voxel_centres(self, n: int) -> Array:
        """Return (n^3, 3) points of the mesh's space, x fastest, then y, then z."""
        at = (np.arange(n) + 0.5) / n * 2 - 1
        z, y, x = np.meshgrid(at, at, at, indexing="ij")
        p = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        return np.asarray(np.asarray(self.centre) + p * 2 * np.asarray(self.half_extent))

    def to_object(self, points: ArrayLike) -> Array:
        """Map points (..., 3) of the mesh's space to p: the volume is +-1, the mesh within +-1/2.

        >>> Box((1.0, 0.0, 0.0), (2.0, 1.0, 1.0)).to_object([5.0, 1.0, -2.0]).tolist()
        [1.0, 0.5, -1.0]
        """
        offset = np.asarray(points, np.float64) - np.asarray(self.centre)
        return np.asarray(offset / (2 * np.asarray(self.half_extent)))


@dataclass(frozen=True, eq=False)
class OcclusionHarmonics:
    """Float master of a volume (`harmonics.npz`).

    terms : (n, n, n, K) float32, axes z, y, x, K = (l_max + 1)^2; voxels inside the solid hold what
    their neighbours do.  inside : (n, n, n) bool.  spread : (n, n, n) float32, standard error of
    each coefficient of a voxel, 0 inside; 95 % intervals reach `maths.intervals.coverage_factor()`
    of it to each side.  error : (K,) float32, standard error of the coefficients of each band, RMS
    over the voxels outside.  proof_voxels : (s,) int64 flat indices of voxels
    outside.  proof_lights : (r, m, K) float32, m distant round lights of each of the radii
    `proof_radii` (r,), radians, scaled so that `lights @ terms` is the share hidden.  proof_shadow
    : (r, m, s) float32, the share of each light that each voxel sees, by rays of its own.
    """

    terms: Float
    inside: NDArray[np.bool_]
    spread: Float
    error: Float
    box: Box
    proof_voxels: NDArray[np.int64]
    proof_lights: Float
    proof_shadow: Float
    proof_radii: tuple[float, ...] = ()
    quality: dict[str, Any] = field(default_factory=dict)

    @property
    def l_max(self) -> int:
        """Highest band."""
        return isqrt(self.terms.shape[-1]) - 1

    def save(self, folder: Path) -> None:
        """Write `harmonics.npz` and `report.json` into an existing folder."""
        buffer = io.BytesIO()
        np.savez(buffer, **{name: getattr(self, name) for name in _ARRAYS})
        atomic.write_bytes(Path(folder) / MASTER_NAME, buffer.getvalue())
        layout = {
            "grid": len(self.terms),
            "l_max": self.l_max,
            "proof_radii": list(self.proof_radii),
            **_box_layout(self.box),
        }
        found = {"layout": layout, "quality": self.quality}
        data = {"format": FORMATS[MASTER], "kind": MASTER, **found}
        report.write(folder, data)

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> OcclusionHarmonics:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data, layout = _read(folder, MASTER)
        with refusing(str(Path(folder) / MASTER_NAME), "volume of harmonics"):
            stored = np.load(io.BytesIO(_bytes(folder, MASTER_NAME)), allow_pickle=False)
            arrays = {name: stored[name] for name in _ARRAYS}
        return cls(
            **arrays,
            box=_box_of(layout),
            proof_radii=tuple(layout["proof_radii"]),
            quality=data["quality"],
        ).checked(folder)

    def checked(self, where: object = "occlusion") -> OcclusionHarmonics:
        """Return the volume with arrays of the declared types, contiguous, native byte order.

        Raises InputError for an array of wrong shape or type and for numbers that are not finite or
        out of range; `where` names it.
        """
        shape = np.shape(self.terms)
        n, K = (shape[0], shape[3]) if len(shape) == 4 else (0, 0)
        lights, proofs = np.shape(self.proof_lights), np.size(self.proof_voxels)
        r, m = (len(self.proof_radii), lights[1] if len(lights) == 3 else 0)
        if n < 1 or K < 1 or isqrt(K) ** 2 != K:
            raise InputError(where, "terms", str(shape), AGAIN)
        kinds: dict[str, tuple[str, tuple[int, ...], float, float]] = {
            "terms": ("f", (n, n, n, K), -100.0, 100.0),
            "inside": ("b", (n, n, n), 0, 1),
            "spread": ("f", (n, n, n), 0.0, 100.0),
            "error": ("f", (K,), 0.0, 100.0),
            "proof_voxels": ("iu", (proofs,), 0, n**3 - 1),
            "proof_lights": ("f", (r, m, K), -100.0, 100.0),
            "proof_shadow": ("f", (r, m, proofs), 0.0, 1.0),
        }
        arrays: dict[str, Any] = {}
        for name, (kind, wanted, low, high) in kinds.items():
            array = np.asarray(getattr(self, name))
            if array.dtype.kind not in kind or array.shape != wanted:
                raise InputError(where, name, f"{array.dtype} {array.shape}", AGAIN)
            if not np.all((array >= low) & (array <= high)):
                limits = f"not finite, or not from {low:g} to {high:g}"
                raise InputError(where, name, limits, AGAIN)
            arrays[name] = np.ascontiguousarray(array, _TYPES[kind[0]])
        return replace(self, **arrays)


@dataclass(frozen=True, eq=False)
class Occlusion:
    """A volume as the player reads it (`occlusion.ktx2`).

    volumes : (P, nz, ny, nx, 4), P textures of four components each, axes z, y, x: uint8 codes
    `(q - 128) / 127`, or float16; component k is channel k % 4 of texture k // 4. In the file they
    stand on one another along z, to be cut apart: no filter may run from one into the next.
    scales : (4 (P + Q),) float32, 0 past the components in use.  basis : (components, K), rows
    orthonormal: terms = (values * scales) @ basis, and a light L counts `basis @ L`.
    coarse : (Q, mz, my, mx, 4), the components from 4 P on, on a grid of their own
    (`coarse.ktx2`); None for Q = 0.  warp : >= 0, see `occlusion_warp`.
    """

    volumes: NDArray[Any]
    scales: Float
    basis: Array
    box: Box
    quality: dict[str, Any] = field(default_factory=dict)
    coarse: NDArray[Any] | None = None
    warp: float = 0.0

    @property
    def l_max(self) -> int:
        """Highest band."""
        return isqrt(self.basis.shape[1]) - 1

    @property
    def components(self) -> int:
        """Number of components in use."""
        return len(self.basis)

    @property
    def grids(self) -> tuple[NDArray[Any], ...]:
        """The volumes of each grid."""
        return (self.volumes,) if self.coarse is None else (self.volumes, self.coarse)

    @property
    def nbytes(self) -> int:
        """Bytes on the card."""
        return sum(grid.nbytes for grid in self.grids)

    def places(self) -> Array:
        """Return (v, 3) p of the middles of the (finer) voxels, x fastest, then y, then z."""
        z, y, x = (np.arange(n) + 0.5 for n in self.volumes.shape[1:4])
        at = np.stack(np.meshgrid(z, y, x, indexing="ij"), axis=-1)[..., ::-1].reshape(-1, 3)
        size = np.array(self.volumes.shape[3:0:-1])
        return np.asarray(2.0 * occlusion_unwarp(at / size, self.warp) - 1.0)

    def slots(self, p: ArrayLike) -> Float:
        """Return the stored values (m, 4 (P + Q)), before scales, that a lookup at p (m, 3) gets,
        outside the volume those of its edge."""
        place = occlusion_warp(occlusion_place(p), self.warp)
        return np.concatenate([looked_up(_by_slot(grid), place) for grid in self.grids], axis=1)

    def decoded(self) -> Float:
        """Return the components (nz, ny, nx, components) that the codes stand for, in the middles
        of the (finer) voxels."""
        parts = [_by_slot(self.volumes)]
        if self.coarse is not None:
            at = 0.5 + 0.5 * self.places()
            coarser = looked_up(_by_slot(self.coarse), occlusion_warp(at, self.warp))
            parts.append(coarser.reshape(*self.volumes.shape[1:4], -1))
        by_slot = np.concatenate(parts, axis=-1) * self.scales
        return np.ascontiguousarray(by_slot[..., : self.components])

    def terms(self, p: ArrayLike) -> Float:
        """Return the harmonics (m, K) of occlusion that a lookup at p (m, 3) gives."""
        values = (self.slots(p) * self.scales)[:, : self.components]
        return np.asarray(values @ self.basis.astype(np.float32))

    def constants(self, light: ArrayLike) -> Array:
        """Return the weights (..., 4 (P + Q), C) of stored values under lights, scales folded in.

        light : (..., K, C), radiance coefficients. A texel's `values @ constants` is L.O.
        """
        weights = np.einsum("kj,...jc->...kc", self.basis, np.asarray(light, np.float64))
        padded = np.zeros((*weights.shape[:-2], len(self.scales), weights.shape[-1]))
        padded[..., : self.components, :] = weights
        return np.asarray(padded * self.scales[:, None].astype(np.float64))

    def save(self, folder: Path) -> None:
        """Write `occlusion.ktx2`, `coarse.ktx2` if any, and `report.json` into a folder."""
        for name, grid in zip((NAME, COARSE_NAME), self.grids, strict=False):
            stacked = grid.reshape(-1, *grid.shape[2:])
            ktx2.write(Path(folder) / name, ktx2.Texture((stacked,), "volume"))
        layout = {
            "grids": [grid.shape[3:0:-1] for grid in self.grids],
            "volumes": [len(grid) for grid in self.grids],
            "warp": self.warp,
            "depth": 8 * self.volumes.dtype.itemsize,
            "l_max": self.l_max,
            "longest_axis": self.box.longest_axis,
            "scales": self.scales,
            "basis": self.basis,
            **_box_layout(self.box),
        }
        data = {"format": FORMATS[KIND], "kind": KIND, "layout": layout, "quality": self.quality}
        report.write(folder, data)

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Occlusion:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data, layout = _read(folder, KIND)
        grids = []
        stored = zip((NAME, COARSE_NAME), layout["grids"], layout["volumes"], strict=False)
        for name, (x, y, z), count in stored:
            path = Path(folder) / name
            texture = ktx2.decode(_bytes(folder, name), str(path))
            level = texture.levels[0]
            if level.shape != (count * z, y, x, 4) or texture.kind != "volume":
                raise DamagedError(path, "size", str(level.shape), AGAIN)
            grids.append(level.reshape(count, z, y, x, 4))
        return cls(
            volumes=grids[0],
            coarse=grids[1] if len(grids) > 1 else None,
            warp=layout["warp"],
            scales=np.asarray(layout["scales"], np.float32),
            basis=np.asarray(layout["basis"], np.float64).reshape(-1, (layout["l_max"] + 1) ** 2),
            box=_box_of(layout),
            quality=data["quality"],
        )


def encode(values: Float, depth: int) -> NDArray[Any]:
    """Store numbers from -1 to 1 as codes of 8 bits or half floats."""
    if depth == 16:
        return values.astype(np.float16)
    return np.asarray(np.rint(np.clip(values, -1, 1) * 127) + 128, np.uint8)


def decode(codes: NDArray[Any]) -> Float:
    """Return the numbers that codes, uint8 or float16, stand for.

    >>> decode(np.array([1, 128, 255], np.uint8)).tolist()
    [-1.0, 0.0, 1.0]
    """
    if codes.dtype.itemsize == 2:
        return codes.astype(np.float32)
    return (codes.astype(np.float32) - 128) / np.float32(127)


def _by_slot(volumes: NDArray[Any]) -> Float:
    """Return textures (P, z, y, x, 4) of codes as one volume (z, y, x, 4 P) of numbers."""
    values = decode(volumes)
    return np.ascontiguousarray(np.moveaxis(values, 0, 3).reshape(*values.shape[1:4], -1))


_TYPES = {"f": np.float32, "b": np.bool_, "i": np.int64}
_ARRAYS = ("terms", "inside", "spread", "error", "proof_voxels", "proof_lights", "proof_shadow")


def _box_layout(box: Box) -> dict[str, Any]:
    return {"centre": list(box.centre), "half_extent": list(box.half_extent)}


def _box_of(layout: dict[str, Any]) -> Box:
    a, b = layout["centre"], layout["half_extent"]
    return Box((a[0], a[1], a[2]), (b[0], b[1], b[2]))


def _read(folder: Path, kind: str) -> tuple[dict[str, Any], dict[str, Any]]:
    data = report.read(folder)
    if data.get("kind") != kind or data.get("format") != FORMATS[kind]:
        found = f"{data.get('kind')} of format {data.get('format')}"
        raise DamagedError(folder, "kind", found, AGAIN)
    return data, data["layout"]


def _bytes(folder: Path, name: str) -> bytes:
    if seal.is_sealed(folder):
        return seal.read_bytes(folder, name)
    return read_bytes(Path(folder) / name, MAX_BYTES)
