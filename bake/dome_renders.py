"""A mesh under lights spread over a dome: one render a light, as photographs of it would be.

Frame, camera rays, materials and shadow rays are those of bake.billboard; every subsample sees
every light, since a dome's harmonics have no turns to hide a share of them in. Lights spread evenly
in solid angle from 5 degrees up: over five meshes that meets 32 unseen lights 0 to .5 dB better
than a spread by cosine, and no worse than .13 dB where the unseen ones are spread by cosine too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import billboard, dome_knobs, photographs, workers
from bake.gather import fill
from bake.gather import render as lit_by
from bake.photographs import GRAZING, Photographs
from bake.rays import RayScene
from bake.shading import Surface
from bake.tiles import kept
from formats.errors import InputError, MachineError
from formats.mesh import Mesh

Array = NDArray[np.float64]
Float = NDArray[np.float32]
Indices = NDArray[np.int64]

TILE = 4096  # texels in work at once a thread


@dataclass(frozen=True)
class Params:
    """Knobs; those of bake.billboard.Params mean the same here. lights : directions of a spiral.
    directions : towards the lights instead, (x, y, z) in the sprite's frame, of any length."""

    resolution: int = 512
    views: int = 1
    samples: int = 16
    lights: int = 64
    directions: tuple[tuple[float, float, float], ...] = ()
    sun_diameter: float = 0.00925
    sky_fill: float = 0.0
    transmission: float = 0.35
    gloss: float = 0.0
    field_of_view: float = 0.0

    def sprite(self) -> billboard.Params:
        """Return the same knobs as a sprite has them. InputError for those out of range."""
        sprite = billboard.Params(
            resolution=self.resolution,
            views=self.views,
            samples=self.samples,
            lights=self.lights,
            sun_diameter=self.sun_diameter,
            sky_fill=self.sky_fill,
            transmission=self.transmission,
            gloss=self.gloss,
            field_of_view=self.field_of_view,
        )
        sprite.check()
        return sprite

    def towards(self) -> Array:
        """Return unit directions (N, 3). InputError for vectors without a direction."""
        if not self.directions:
            return dome_knobs.spiral(self.lights, GRAZING)
        vectors = np.asarray(self.directions, np.float64)
        if vectors.ndim != 2 or vectors.shape[1] != 3 or not np.abs(vectors).max() < 1e100:
            remedy = "give triples of finite numbers"
            raise InputError("dome renders", "directions", str(vectors.shape), remedy)
        lengths = np.sqrt(np.sum(np.square(vectors), axis=1))
        if lengths.min() < 1e-9:
            raise InputError("dome renders", "directions", "zero", "give vectors with a direction")
        return np.asarray(vectors / lengths[:, None])


def render(
    mesh: Mesh, *, params: Params, progress: workers.Progress = workers.silent
) -> Photographs:
    """Render the mesh under each light, a sun of irradiance pi: linear, premultiplied.

    Takes 12 bytes a light and texel, and a few MiB a thread. InputError for knobs out of range and
    for a mesh without faces or with broken arrays; MachineError for more than
    `photographs.MAX_BYTES`.
    """
    sprite, towards = params.sprite(), params.towards()
    if not len(mesh.faces):
        raise InputError("dome renders", "mesh", "no faces", "use a mesh with triangles")
    mesh = mesh.checked("dome renders: mesh")
    surface = Surface(mesh, RayScene(mesh.vertices, mesh.faces), params.transmission, params.gloss)
    frame = billboard.frame_of(mesh, sprite)
    texels, count = frame.width * frame.height, len(towards)
    if 12 * count * texels * params.views > photographs.MAX_BYTES:
        size = f"{count} lights on {params.views} views of {frame.width} x {frame.height}"
        remedy = f"lower lights or resolution: over {photographs.MAX_BYTES >> 30} GiB in memory"
        raise MachineError("dome renders", "size", size, remedy)
    suns = billboard.suns(towards, params.samples, params.sun_diameter)
    sky, share = billboard.sky_of(params.samples, params.sky_fill)

    def tile(span: tuple[int, int, int]) -> tuple[Indices, Float, Float] | None:
        seen = billboard.seen_texels(surface, frame, sprite, span)
        if seen is None:
            return None
        which, covered, shading = seen
        turn = billboard.world_from_sprite(span[0], params.views)
        ring, even = (np.ascontiguousarray(d @ turn.T, np.float32) for d in (suns, sky))
        made = lit_by(surface.scene, shading, ring, params.samples)
        colours = [c.reshape(params.samples, -1, 3) for c in shading.colours]
        made += fill(surface.scene, shading, even, colours) * np.float32(share / params.samples)
        # A sun of irradiance pi, where shading takes one of 1
        return span[0] * texels + which, covered, made * np.float32(np.pi)

    spans = [
        (v, a, min(a + TILE, texels)) for v in range(params.views) for a in range(0, texels, TILE)
    ]
    found = kept(tile, spans, progress)
    pictures = np.zeros((count, params.views * texels, 3), np.float32)
    alpha = np.zeros(params.views * texels, np.float32)
    while found:
        # What has been put in its place is dropped: both together take no more than one
        if (done := found.pop()) is not None:
            at, covered, made = done
            alpha[at] = covered
            pictures[:, at] = made
    rows = params.views * frame.height
    return Photographs(
        pictures=pictures.reshape(count, rows, frame.width, 3),
        directions=towards,
        space="linear",
        notes=tuple(mesh.notes),
        coverage=alpha.reshape(rows, frame.width),
        metres_per_texel=frame.metres_per_texel,
        pivot=(-frame.left / frame.metres_per_texel, frame.top / frame.metres_per_texel),
        height=frame.object_height,
        views=params.views,
    )
