"""A normal-mapped sprite, as a renderer without baked light draws it: 8 bytes a pixel.

Albedo (sRGB, 8 bits) and coverage, and the shading normal (8 signed bits each), both the mean over
a texel's subsamples as tools bake them. Light is Lambert's cosine plus an ambient share; nothing
casts a shadow. The strengths of both are one number a sprite each, the best for its training
renders by least squares on values as a screen shows them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bake import billboard
from bake.photographs import Photographs
from bake.rays import RayScene
from bake.shading import Surface
from formats.mesh import Material, Mesh
from maths.colour import srgb_decode, srgb_encode
from pipelines.studies.thin_lens import averaged

Array = NDArray[np.float64]
Float = NDArray[np.float32]

ROWS = 16  # texel rows in work at once
FITTED = 4096  # texels that find the light's two strengths


@dataclass(frozen=True, eq=False)
class NormalMapped:
    """albedo : (h, w, 3) linear, not premultiplied. normal : (h, w, 3) towards the viewer. alpha :
    (h, w). All as decoded from 8 bits. frame : where the texels lie. sun, ambient : strengths."""

    albedo: Float
    normal: Float
    alpha: Float
    frame: billboard.Frame
    sun: float = 1.0
    ambient: float = 0.0

    def relit(self, direction: Array) -> Float:
        """Return premultiplied radiance (h, w, 3) under a sun of irradiance pi from (3,)."""
        cosine = np.maximum(self.normal @ np.asarray(direction, np.float32), 0)
        share = self.sun * cosine + self.ambient
        return np.asarray(self.albedo * (share * self.alpha)[..., None], np.float32)


def trace(mesh: Mesh, params: billboard.Params) -> NormalMapped:
    """Cast camera rays, average what they hit, and store it in 8 bits. Orthographic, view 0."""
    mesh = mesh.checked("normal map: mesh")
    frame = billboard.frame_of(mesh, params)
    surface = Surface(mesh, RayScene(mesh.vertices, mesh.faces), params.transmission, 0.0)
    sums = np.zeros((frame.height, frame.width, 7), np.float64)
    side = max(1, round(params.samples**0.5))
    for row, points in _rays(frame, side):
        origins = surface.scene.to_unit(points.reshape(-1, 3))
        hits = surface.scene.intersect(origins, np.array([[0, 0, -1]], np.float32))
        shading = surface.at(hits, np.array([[0, 0, 1]], np.float32))
        found = np.column_stack([np.pi * shading.diffuse, shading.normal, hits.face >= 0])
        sums[row : row + points.shape[1]] += found.reshape(*points.shape[:3], 7).sum(axis=0)
    hit = np.maximum(sums[..., 6:], 1)
    length = np.maximum(np.linalg.norm(sums[..., 3:6], axis=-1, keepdims=True), 1e-9)
    albedo = np.rint(255 * srgb_encode(np.clip(sums[..., :3] / hit, 0, 1))) / 255
    return NormalMapped(
        albedo=np.asarray(srgb_decode(albedo), np.float32),
        normal=np.asarray(np.rint(127 * sums[..., 3:6] / length) / 127, np.float32),
        alpha=np.asarray(np.rint(255 * sums[..., 6] / side**2) / 255, np.float32),
        frame=frame,
    )


def _rays(frame: billboard.Frame, side: int) -> Iterator[tuple[int, Array]]:
    """List (first row, origins (side^2, rows, width, 3) in the mesh's space), on an even grid."""
    steps = (np.arange(side) + 0.5) / side
    down, right = (step.ravel()[:, None, None] for step in np.meshgrid(steps, steps))
    for row in range(0, frame.height, ROWS):
        rows = np.arange(row, min(row + ROWS, frame.height))[:, None]
        x = frame.left + (np.arange(frame.width) + right + 0 * rows) * frame.metres_per_texel
        y = frame.top - (rows + down + 0 * x) * frame.metres_per_texel
        z = np.full_like(x, 1.01 * frame.reach)
        yield row, np.stack([x, y, z], axis=-1) + frame.origin


def fitted(sprite: NormalMapped, training: Photographs) -> NormalMapped:
    """Choose the strengths of sun and ambient that meet the training renders best."""
    from scipy.optimize import least_squares

    covered = np.flatnonzero(sprite.alpha.ravel() > 0)
    chosen = covered[:: -(-len(covered) // FITTED)]
    pictures = training.pictures.reshape(len(training.pictures), -1, 3)[:, chosen]
    target = srgb_encode(np.clip(pictures, 0, 1))
    colour = (sprite.albedo * sprite.alpha[..., None]).reshape(-1, 3)[chosen].astype(np.float64)
    normals = sprite.normal.reshape(-1, 3)[chosen]
    cosine = np.maximum(training.directions @ normals.T, 0)[..., None]

    def residuals(strengths: Array) -> Array:
        lit = (strengths[0] * cosine + strengths[1]) * colour
        return np.asarray((srgb_encode(np.clip(lit, 0, 1)) - target).ravel())

    found = least_squares(residuals, [1.0, 0.05], bounds=(0, 2))
    return replace(sprite, sun=float(found.x[0]), ambient=float(found.x[1]))


def shown(picture: Float, frame: billboard.Frame, common: billboard.Frame) -> Float:
    """Average a picture over the texels of another frame of the same mesh: an area filter."""
    scale = common.metres_per_texel / frame.metres_per_texel
    across = (common.left - frame.left) / frame.metres_per_texel
    down = (frame.top - common.top) / frame.metres_per_texel
    rows, columns = (
        np.asarray(start + scale * np.arange(count + 1), np.float64)
        for start, count in ((down, common.height), (across, common.width))
    )
    return averaged(averaged(picture, rows, 0), columns, 1)


def ball(rings: int = 96, size: int = 256) -> Mesh:
    """Return a convex ball half a metre wide, a texture of `size` colours around: no cast shadow,
    and detail of a texel or two that a normal map keeps whole."""
    latitude, turn = np.meshgrid(np.arange(rings + 1) / rings, np.arange(2 * rings + 1) / rings)
    polar, around = np.pi * latitude.ravel(), np.pi * turn.ravel()
    normal = np.stack(
        [np.sin(polar) * np.cos(around), -np.cos(polar), -np.sin(polar) * np.sin(around)], axis=-1
    )
    j, i = (n.ravel() for n in np.meshgrid(np.arange(2 * rings), np.arange(rings), indexing="ij"))
    a = j * (rings + 1) + i
    b, c, d = a + rings + 1, a + rings + 2, a + 1
    # One triangle touches each pole
    faces = np.concatenate([
        np.stack([a, b, c], axis=1)[i > 0],
        np.stack([a, c, d], axis=1)[i < rings - 1],
    ])  # fmt: skip
    # Colours of a golden walk round the hues, neighbours far apart
    hue = 2 * np.pi * (np.arange(size * size // 2) * 0.6180339887498949 % 1)
    colours = 0.45 + 0.4 * np.stack([np.sin(hue + k * 2 * np.pi / 3) for k in range(3)], axis=1)
    texture = colours.reshape(size // 2, size, 3).astype(np.float32)
    return Mesh(
        vertices=0.25 * normal + [0, 0.25, 0],
        faces=faces,
        normals=normal[faces].astype(np.float32),
        material=np.zeros(len(faces), np.int32),
        materials=(Material("glaze", (1.0, 1.0, 1.0), texture=texture),),
        uv=np.stack([turn.ravel() / 2, latitude.ravel()], axis=-1).astype(np.float32),
    )
