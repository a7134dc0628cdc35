"""Lamps to spherical harmonics at points: coefficients of radiance, the integral of L Y.

All take many points at once, so that a near light differs between two of them. Suns and spheres are
closed forms; flat lights are sums along their outlines that are exact to rounding (see
`maths.spherical_contour`), or over few points where those do (`maths.spherical_cubature`). Lat-long
maps are exact for even texels.

References
----------
Sloan 2008, Stupid Spherical Harmonics Tricks (spherical light sources).
Ramamoorthi, Hanrahan 2001, An Efficient Representation for Irradiance Environment Maps.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.sampling import orthonormal_basis
from maths.spherical_contour import PRECISION, disc_integral, polygon_integral
from maths.spherical_cubature import degrees_for, integral
from maths.spherical_harmonics import turn_zonal
from maths.spherical_projection import cap_factors, project_latlong
from maths.spherical_rotation import rotate
from maths.transforms import normalise, rotation

Array = NDArray[np.float64]


def project_sun(
    direction: ArrayLike, irradiance: ArrayLike, l_max: int, *, angular_radius: ArrayLike = 0.0
) -> Array:
    """Coefficients of a distant disc of light, exact.

    direction : (..., 3) towards it.  irradiance : (..., 3) perpendicular to it.  angular_radius :
    (...) radians in [0, pi / 2]; 0 is a single direction, `E Y(d)`.
    Returns (..., K, 3). Raises ValueError for directions and angles that are none.
    """
    angle = np.asarray(angular_radius, np.float64)
    if not np.all((angle >= 0) & (angle <= np.pi / 2)):
        raise ValueError("The angular radius of a sun is 0 to pi / 2.")
    # Radiance E / (pi sin^2), and the cap's factors have sin^2 taken out
    zonal = cap_factors(np.cos(angle), l_max) / np.pi
    return _coloured(turn_zonal(zonal, direction), irradiance)


def project_sphere(
    point: ArrayLike, centre: ArrayLike, radius: ArrayLike, radiance: ArrayLike, l_max: int
) -> Array:
    """Coefficients of a glowing ball, exact; inside it light is all around.

    point, centre : (..., 3) metres.  radius : (...) metres, >= 0.  radiance : (..., 3).
    Returns (..., K, 3). Raises ValueError for spheres that are none.

    >>> L = project_sphere([0.0, 0, 0], [0.0, 0, 2], 1.0, [1.0, 1, 1], 2)
    >>> bool(np.isclose(L[0, 0], np.sqrt(np.pi) * (1 - np.cos(np.pi / 6))))
    True
    """
    offset, R = np.asarray(centre, np.float64) - np.asarray(point, np.float64), np.asarray(radius)
    if not (np.all(np.isfinite(offset)) and np.all((R >= 0) & np.isfinite(R))):
        raise ValueError("A sphere light has a finite position and a radius of 0 or more.")
    largest = np.max(np.abs(offset), axis=-1)
    scale = np.where(largest > 0, largest, 1.0)
    distance = scale * np.linalg.norm(offset / scale[..., None], axis=-1)
    # A ball of radius 0 gives nothing, at its own place too
    inside, at = (distance <= R) & (R > 0), distance == 0
    sine = np.where(inside, 1.0, R / np.where(inside | at, 1.0, distance))
    cosine = np.sqrt((1.0 - sine) * (1.0 + sine))
    zonal = cap_factors(cosine, l_max) * np.square(sine)[..., None]
    around = np.zeros(l_max + 1)
    around[0] = np.sqrt(4.0 * np.pi)
    zonal = np.where(inside[..., None], around, zonal)
    towards = np.where((inside | at)[..., None], [0.0, 0.0, 1.0], offset)
    return _coloured(turn_zonal(zonal, towards), radiance)


def project_disc(
    point: ArrayLike,
    centre: ArrayLike,
    axis: ArrayLike,
    radius: ArrayLike,
    radiance: ArrayLike,
    l_max: int,
    *,
    two_sided: ArrayLike = False,
    precision: float = PRECISION,
) -> Array:
    """Coefficients of a glowing disc that shines along its axis.

    point, centre, axis : (..., 3); axis non-zero.  radius : (...) metres, > 0.  radiance : (...,
    3).  two_sided : (...). Points behind a disc that is not, and in its own plane, get nothing.
    Measured: within 5e-15 up to l_max = 20, and within 2e-14 of the light of small ones; 1e-13 at a
    thousandth of the radius from the rim, but there 1,024 points end: 3e-5 at a ten-thousandth, .08
    at 1e-5 of the radius, .5 at 1e-6.
    precision : error to allow, as a share of area / distance^2. At 1e-3 a third to a sixth of the
        time: 4 to 36 points of the area (see `maths.spherical_cubature`) where those do.
    Returns (..., K, 3). Raises ValueError for discs that are none.
    """
    offset = np.asarray(centre, np.float64) - np.asarray(point, np.float64)
    R, n = np.asarray(radius, np.float64), normalise(axis)
    if not (np.all(np.isfinite(offset)) and np.all((R > 0) & np.isfinite(R))):
        raise ValueError("A disc light has a finite position and a radius above 0.")
    shape = np.broadcast_shapes(offset.shape[:-1], R.shape, n.shape[:-1])
    c = np.broadcast_to(offset, (*shape, 3)).reshape(-1, 3)
    n = np.broadcast_to(n, (*shape, 3)).reshape(-1, 3)
    R = np.broadcast_to(R, shape).ravel()
    side = -np.sum(c * n, axis=-1)
    both = np.broadcast_to(np.asarray(two_sided, bool), shape).ravel()
    lit = np.flatnonzero((side > 0) | (both & (side < 0)))
    found = np.zeros((len(c), (l_max + 1) ** 2))
    towards = np.where(side > 0, 1.0, -1.0)[:, None] * n
    if len(lit):
        found[lit] = _disc(c[lit], towards[lit], R[lit], l_max, precision)
    return _coloured(found.reshape(*shape, -1), radiance)


def project_polygon(
    point: ArrayLike,
    corners: ArrayLike,
    radiance: ArrayLike,
    l_max: int,
    *,
    two_sided: ArrayLike = False,
    precision: float = PRECISION,
) -> Array:
    """Coefficients of a glowing flat polygon, such as `area_lights.rectangle_corners` of one.

    point : (..., 3).  corners : (..., k, 3) metres, counter-clockwise as seen from the front,
    which shines.  radiance : (..., 3).  two_sided : (...). Points behind a polygon that is not, and
    in its own plane, get nothing. Measured: within 1e-15 up to l_max = 20, and within 1e-11 of the
    light of small ones (1e-9 at 1e-7 of the distance, where corners themselves round).
    precision : error to allow, as `project_disc`; for parallelograms, while others keep outlines.
    Returns (..., K, 3). Raises ValueError for polygons that are none.
    """
    outline = np.asarray(corners, np.float64)
    if outline.ndim < 2 or outline.shape[-2] < 3 or not np.all(np.isfinite(outline)):
        raise ValueError("A polygon light has three finite corners or more.")
    r = outline - np.asarray(point, np.float64)[..., None, :]
    if not np.all(np.isfinite(r)):
        raise ValueError("A point that light comes to is finite.")
    shape, k = r.shape[:-2], r.shape[-2]
    q = r.reshape(-1, k, 3) - r.reshape(-1, k, 3)[:, :1]
    size = np.max(np.abs(q), axis=(1, 2))
    q = q / np.where(size > 0, size, 1.0)[:, None, None]
    area = np.sum(np.cross(q, np.roll(q, -1, axis=1)), axis=1)
    side = -np.sum(r.reshape(-1, k, 3)[:, 0] * area, axis=-1)
    both = np.broadcast_to(np.asarray(two_sided, bool), shape).ravel()
    lit = np.flatnonzero((side > 0) | (both & (side < 0)))
    found = np.zeros((len(q), (l_max + 1) ** 2))
    if len(lit):
        # Seen from its front an outline runs counter-clockwise, from behind clockwise
        seen = np.where(
            (side > 0)[:, None, None], r.reshape(-1, k, 3), r.reshape(-1, k, 3)[:, ::-1]
        )
        found[lit] = _polygon(seen[lit], l_max, precision)
    return _coloured(found.reshape(*shape, -1), radiance)


def project_environment(radiance: ArrayLike, l_max: int, *, yaw: ArrayLike = 0.0) -> Array:
    """Coefficients of a lat-long map, exact for even texels.

    radiance : (h, w, 3), lat-long as `transforms.latlong_direction`.  yaw : (...) radians by which
        the receiver's frame is turned about +y in the map's world (positive turns its +z towards
        +x).
    Returns (..., K, 3). Raises ValueError for another shape.

    >>> L = project_environment(np.ones((8, 16, 3)), 2)
    >>> bool(np.allclose(L[0], np.sqrt(4 * np.pi))), bool(np.allclose(L[1:], 0, atol=1e-14))
    (True, True)
    """
    world = project_latlong(radiance, l_max)
    yaws = np.asarray(yaw, np.float64)
    turned = [rotate(world, rotation("y", -float(angle))) for angle in yaws.ravel()]
    return np.asarray(turned).reshape(*yaws.shape, *world.shape)


def _disc(c: Array, axis: Array, radius: Array, l_max: int, precision: float) -> Array:
    """Integrals (n, K) over discs, by few points where those do, else around the rim."""
    found = np.empty((len(c), (l_max + 1) ** 2))
    far = _length(c)
    degrees = degrees_for(radius / far, l_max, precision, "disc")
    a, b = orthonormal_basis(axis)
    middle, wide = c / far[:, None], (radius / far)[:, None]
    sides, area = (wide * a, wide * b), np.pi * wide * wide * axis
    for degree in np.unique(degrees):
        at = np.flatnonzero(degrees == degree)
        if degree:
            two = sides[0][at], sides[1][at]
            found[at] = integral(middle[at], two, area[at], l_max, int(degree), "disc")
        else:
            found[at] = disc_integral(c[at], axis[at], radius[at], l_max, precision)
    return found


def _polygon(r: Array, l_max: int, precision: float) -> Array:
    """Integrals (n, K) over polygons (n, k, 3), parallelograms by few points where those do."""
    found = np.empty((len(r), (l_max + 1) ** 2))
    degrees = np.zeros(len(r), np.int64)
    if r.shape[1] == 4:
        middle = 0.5 * (r[:, 0] + r[:, 2])
        a, b = 0.5 * (r[:, 1] - r[:, 0]), 0.5 * (r[:, 2] - r[:, 1])
        far = np.maximum(_length(middle), np.max(np.abs(r), axis=(1, 2)) * 1e-9)
        size = np.maximum(_length(a + b), _length(a - b))
        skew = _length(r[:, 0] + r[:, 2] - r[:, 1] - r[:, 3])
        degrees = degrees_for(size / far, l_max, precision, "parallelogram")
        degrees *= skew <= 1e-9 * size
        middle, a, b = (v / far[:, None] for v in (middle, a, b))
        area = 4 * np.cross(a, b)
    for degree in np.unique(degrees):
        at = np.flatnonzero(degrees == degree)
        if degree:
            two = a[at], b[at]
            found[at] = integral(middle[at], two, area[at], l_max, int(degree), "parallelogram")
        else:
            found[at] = polygon_integral(r[at], l_max, precision)
    return found


def _length(v: Array) -> Array:
    """Lengths of (..., 3), with no squares that overflow."""
    return np.asarray(np.hypot(np.hypot(v[..., 0], v[..., 1]), v[..., 2]))


def _coloured(coefficients: Array, light: ArrayLike) -> Array:
    return np.asarray(coefficients[..., :, None] * np.asarray(light, np.float64)[..., None, :])
