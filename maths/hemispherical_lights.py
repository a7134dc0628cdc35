"""Lamps to coefficients of hemispherical harmonics: what a sprite under a dome sees of a light.

Directions are in the sprite's frame: +x right, +y up, +z towards the viewer. What counts of a
direction d is `fade(d) H(d)`, with H of `maths.hemispherical_harmonics` and `fade = clip(z /
GRAZING, 0, 1)`: nothing comes from behind, and nothing goes out from one frame to the next. Domes
have no light that low: what a fit says of the horizon is a guess, and there H has no azimuth.

All kinds of light share that one factor, so that each is the sum of its suns. An even environment
loses GRAZING / 2 = 5 % of its solid angle, .3 % of what it gives a matt sheet that faces +z.

Values count as those under a sun of irradiance pi: a sun has `E / pi fade(d) H(d)`, a glowing
surface the integral of `radiance / pi fade H` over its solid angle.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.circular_lights import GRAZING
from maths.hemispherical_harmonics import evaluate
from maths.sampling import sphere_quadrature
from maths.transforms import latlong_direction, latlong_solid_angles, normalise

Array = NDArray[np.float64]

BLOCK = 1 << 20  # values of the basis at once: 8 MB, and half of that again for its polynomials


def evaluate_direction(directions: ArrayLike, bands: int) -> Array:
    """Coefficients of a sun of irradiance pi: `fade(d) H(d)`.

    directions : (..., 3) towards the light, non-zero.  bands : as `hemispherical_harmonics`.
    Returns (..., bands^2). Raises ValueError for directions and bands that are none.

    >>> evaluate_direction([[0.0, 0.6, -0.8], [1.0, 0.0, 0.0]], 1).tolist()
    [[0.0], [0.0]]
    """
    d = normalise(directions)
    return evaluate(d, bands) * np.clip(d[..., 2:] / GRAZING, 0.0, 1.0)


def project_sun(direction: ArrayLike, irradiance: ArrayLike, bands: int) -> Array:
    """Coefficients of a light from one direction: `E / pi fade(d) H(d)`.

    direction : (..., 3) towards it, sprite's frame.  irradiance : (..., 3) perpendicular to it.
    Returns (..., bands^2, 3).
    """
    weights = evaluate_direction(direction, bands)
    power = np.asarray(irradiance, np.float64) / np.pi
    return np.asarray(weights[..., :, None] * power[..., None, :])


def project_sphere(
    offset: ArrayLike,
    radius: ArrayLike,
    radiance: ArrayLike,
    bands: int,
    *,
    nodes: tuple[int, int] = (8, 8),
) -> Array:
    """Coefficients of a glowing sphere: the integral over the cap that it covers.

    offset : (..., 3) from the sprite to the centre, sprite's frame, metres.  radius : (...) metres,
        > 0.  radiance : (..., 3).  nodes : strips of the cap, and azimuths on each; a sphere nearer
        than a diameter gets `bands` azimuths more.
    The kinks of the rim and of `fade` cost 8 strips up to 1.4 % of the light (measured).
    Closer than its radius the sphere is all around. Returns (..., bands^2, 3). Raises ValueError
    for spheres that are none.

    >>> L = project_sphere([0.0, 0.0, 2.0], 1.0, [1.0, 1.0, 1.0], 1)  # cap of 30 degrees
    >>> bool(np.isclose(L[0, 0] * np.sqrt(2 * np.pi), 2 * (1 - np.cos(np.pi / 6))))
    True
    """
    centre, R = np.asarray(offset, np.float64), np.asarray(radius, np.float64)
    if not np.all((R > 0) & np.isfinite(R)) or not np.all(np.isfinite(centre)):
        raise ValueError("A sphere light has a finite position and a radius above 0.")
    shape = np.broadcast_shapes(centre.shape[:-1], R.shape)
    centres = np.broadcast_to(centre, (*shape, 3)).reshape(-1, 3)
    radii = np.broadcast_to(R, shape).ravel()
    found = np.empty((len(centres), bands * bands))
    near = np.linalg.norm(centres, axis=-1) < 2.0 * radii
    for chosen, more in ((np.flatnonzero(~near), 0), (np.flatnonzero(near), bands)):
        strips, azimuths = nodes[0], nodes[1] + more
        # A cap has up to three parts of so many nodes
        step = max(1, BLOCK // (3 * strips * azimuths * bands * bands))
        for start in range(0, len(chosen), step):
            part = chosen[start : start + step]
            found[part] = _caps(centres[part], radii[part], bands, (strips, azimuths))
    power = np.asarray(radiance, np.float64) / np.pi
    return np.asarray(found.reshape(*shape, -1)[..., :, None] * power[..., None, :])


def project_environment(radiance: ArrayLike, bands: int, *, yaw: ArrayLike = 0.0) -> Array:
    """Coefficients of a lat-long map: the sum over its texels, each at its centre by solid angle.

    radiance : (h, w, 3), lat-long as `transforms.latlong_direction`.  yaw : (...) radians by which
        the sprite's frame is turned about +y in the map's world (positive turns its +z towards +x).
    Returns (..., bands^2, 3). Raises ValueError for another shape.

    >>> L = project_environment(np.ones((64, 128, 3)), 1)
    >>> bool(np.isclose(L[0, 0], np.sqrt(2 / np.pi) * (1 - GRAZING / 2), rtol=1e-3))
    True
    """
    image = np.asarray(radiance)
    if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise ValueError(f"An environment is an array (h, w, 3), not {image.shape}.")
    height, width, _ = image.shape
    yaws, K = np.asarray(yaw, np.float64), bands * bands
    share = latlong_solid_angles(height, width)[:, None, None] / np.pi
    u = (np.arange(width) + 0.5) / width
    answer = np.zeros((yaws.size, K, 3))
    rows = max(1, BLOCK // (width * K))
    for top in range(0, height, rows):
        part = slice(top, min(top + rows, height))
        v = (np.arange(part.start, part.stop) + 0.5) / height
        power = (image[part].astype(np.float64) * share[part]).reshape(-1, 3)
        for i, angle in enumerate(yaws.ravel()):
            # Turning the sprite by yaw moves the map to longer u
            uv = np.stack(np.meshgrid(u + angle / (2.0 * np.pi), v), axis=-1).reshape(-1, 2)
            d = latlong_direction(uv)
            front = d[:, 2] > 0
            answer[i] += evaluate_direction(d[front], bands).T @ power[front]
    return answer.reshape(*yaws.shape, K, 3)


def mirror_signs(bands: int) -> Array:
    """Factors (bands^2,) of a series under x -> -x: cos(m t) keeps even m, sin(m t) keeps odd m.

    >>> mirror_signs(2).tolist()
    [1.0, 1.0, 1.0, -1.0]
    """
    m = np.concatenate([np.arange(-band, band + 1) for band in range(bands)])
    return np.where((m % 2 == 0) == (m >= 0), 1.0, -1.0)


def _caps(centre: Array, R: Array, bands: int, nodes: tuple[int, int]) -> Array:
    """Integrals (n, bands^2) of `fade H` over the caps that spheres (n, 3), (n,) cover."""
    directions, share = sphere_quadrature(centre, R, nodes, above=True)
    return np.asarray(np.einsum("nqk,nq->nk", evaluate_direction(directions, bands), share))
