"""Camera rays: a box over each pixel, a disc over the aperture, both evenly spread.

The player projects at the focal length whatever the focus, and takes the circle of confusion of
`maths.optics` on that sensor, `A f |d - d_f| / (d (d_f - f))`. A lens of diameter A d_f / (d_f - f)
in front of such a projection blurs by just that much; the plane of focus is perpendicular to the
axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formats.scene import NEAR, Scene
from maths import transforms
from maths.hashing import pcg, uniform01
from maths.sampling import concentric_disc, r2

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera at one moment, for a picture of width x height pixels.

    position : (3,). right, up, forward : (3,) unit. half : (2,) half width and height of the
    picture at distance 1. aperture : radius, metres, 0 for a pinhole. focus : metres.
    """

    position: Array
    right: Array
    up: Array
    forward: Array
    half: Array
    width: int
    height: int
    aperture: float = 0.0
    focus: float = 1.0

    @property
    def yaw(self) -> float:
        """Turn about +y, radians, that sprites share."""
        return float(np.arctan2(-self.right[2], self.right[0]))

    def rays(self, pixels: Integers, batches: Integers, each: int, seed: int) -> Rays:
        """Rays of pixels (p,), counted row by row from the top left, in batches (b,) of `each`
        samples: b * each * p of them, pixels fastest.

        The samples of a pixel and batch are evenly spread over the pixel and, in another order,
        over the lens; batches are independent of each other.
        """
        batch, sample, pixel = np.meshgrid(batches, np.arange(each), pixels, indexing="ij")
        key = pcg(seed, pixel, batch, sample)
        return self._through(pixel.ravel(), spread(key, 0), spread(key, 1), key)

    def _through(self, pixel: Integers, u: Array, lens: Array, key: NDArray[np.uint32]) -> Rays:
        """Rays through places u (n, 2) of pixels (n,) and places (n, 2) of the lens, in 0..1."""
        row, column = np.divmod(pixel, self.width)
        x = (2 * (column + u[:, 0]) / self.width - 1) * self.half[0]
        y = (1 - 2 * (row + u[:, 1]) / self.height) * self.half[1]
        towards = self.forward + x[:, None] * self.right + y[:, None] * self.up
        start = np.broadcast_to(self.position, towards.shape)
        if self.aperture > 0:
            place = self.aperture * concentric_disc(lens)
            start = start + place[:, :1] * self.right + place[:, 1:] * self.up
            towards = self.position + self.focus * towards - start
        direction = towards / np.linalg.norm(towards, axis=1, keepdims=True)
        # What is nearer than the near plane is not drawn
        along = direction @ self.forward
        near = start + direction * (NEAR / along)[:, None]
        return Rays(near, direction, start, key)


@dataclass(frozen=True, eq=False)
class Rays:
    """Camera rays: origin (n, 3) on the near plane, direction (n, 3) unit, start (n, 3) on the
    lens, key (batches, each, pixels) hash of each of the n paths."""

    origin: Array
    direction: Array
    start: Array
    key: NDArray[np.uint32]


def spread(key: NDArray[np.uint32], number: int) -> Array:
    """Random pairs (n, 2) in [0, 1)^2 for paths of keys (batches, each, pixels): those of a batch
    and pixel are an R2 sequence, shifted and in an order by chance, another for each `number`."""
    order = np.argsort(pcg(key, number), axis=1, kind="stable")
    shift = [uniform01(key[:, :1], number, axis + 1) for axis in range(2)]
    return r2(order, np.stack(shift, axis=-1)).reshape(-1, 2)


def at(scene: Scene, time: float, size: tuple[int, int], *, lens: bool = True) -> Camera:
    """Return the scene's camera at `time` seconds for a picture of (width, height) pixels.

    lens : False takes a pinhole even where the scene has a lens.
    """
    camera, (width, height) = scene.camera, size
    position = np.asarray(camera.position.at(time), np.float64)
    view_from_world = transforms.look_at(position, camera.target.at(time))
    focal_length = float(camera.focal_length_mm.at(time)) * 1e-3
    half = 0.5 * camera.sensor_height_mm * 1e-3 / focal_length
    aperture, focus = 0.0, 1.0
    if lens and camera.lens is not None:
        focus = float(camera.lens.focus_distance.at(time))
        diameter = focal_length / float(camera.lens.f_number.at(time))
        aperture = 0.5 * diameter * focus / (focus - focal_length)
    right, up, back = view_from_world[:3, :3]
    half_size = np.array([half * width / height, half])
    return Camera(position, right, up, -back, half_size, width, height, aperture, focus)
