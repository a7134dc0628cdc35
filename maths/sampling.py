"""Well-spread points and the maps that carry them: each map is a triple sample, pdf, invert.

A map takes u (..., 2) in [0, 1)^2; its density is per area (disc) or per solid angle (the others),
and `invert` gives u back. Directions are around +z; turn them with `orthonormal_basis`.

References
----------
Shirley, Chiu 1997, A Low Distortion Map Between Disk and Square.
Pharr, Jakob, Humphreys 2023, Physically Based Rendering, 4th ed., A.5 (the triples).
Roberts 2018, The Unreasonable Effectiveness of Quasirandom Sequences (R2).
Swinbank, Purser 2006, Fibonacci grids: A novel approach to global modelling.
Shoemake 1992, Uniform Random Rotations (Graphics Gems III).
Duff et al. 2017, Building an Orthonormal Basis, Revisited, JCGT 6(1).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maths.hashing import uniform01
from maths.transforms import normalise

Array = NDArray[np.float64]

PLASTIC = 1.3247179572447460  # the real root of g^3 = g + 1
GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def concentric_disc(u: ArrayLike) -> Array:
    """Map the square to the unit disc, keeping areas and neighbours. (..., 2) -> (..., 2).

    >>> concentric_disc([0.5, 0.5]).tolist()
    [0.0, 0.0]
    """
    a, b = np.moveaxis(2.0 * np.asarray(u, np.float64) - 1.0, -1, 0)
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    safe = np.where(radius == 0, 1.0, radius)
    ratio = np.where(radius == 0, 0.0, np.where(wide, b, a) / safe)
    theta = np.where(wide, np.pi / 4 * ratio, np.pi / 2 - np.pi / 4 * ratio)
    return np.stack([radius * np.cos(theta), radius * np.sin(theta)], axis=-1)


def concentric_disc_pdf(p: ArrayLike) -> Array:
    """Density of `concentric_disc` per area: 1 / pi inside. (..., 2) -> (...)."""
    return np.where(np.sum(np.square(np.asarray(p, np.float64)), axis=-1) <= 1.0, 1.0 / np.pi, 0.0)


def invert_concentric_disc(p: ArrayLike) -> Array:
    """Inverse of `concentric_disc`. (..., 2) in the disc -> (..., 2)."""
    x, y = np.moveaxis(np.asarray(p, np.float64), -1, 0)
    radius = np.hypot(x, y)
    wide = np.abs(x) > np.abs(y)
    major = np.where(wide, np.copysign(radius, x), np.copysign(radius, y))
    # The angle from the nearer axis, from -pi/4 to pi/4
    angle = np.where(
        wide, np.arctan2(y * np.sign(x), np.abs(x)), np.arctan2(x * np.sign(y), np.abs(y))
    )
    minor = major * angle * (4.0 / np.pi)
    return 0.5 + 0.5 * np.stack(
        [np.where(wide, major, minor), np.where(wide, minor, major)], axis=-1
    )


def cosine_hemisphere(u: ArrayLike) -> Array:
    """Directions around +z with density cos / pi (Malley). (..., 2) -> (..., 3) unit.

    >>> cosine_hemisphere([0.5, 0.5]).tolist()
    [0.0, 0.0, 1.0]
    """
    p = concentric_disc(u)
    z = np.sqrt(np.maximum(0.0, 1.0 - np.sum(p * p, axis=-1)))
    return np.concatenate([p, z[..., None]], axis=-1)


def cosine_hemisphere_pdf(direction: ArrayLike) -> Array:
    """Density of `cosine_hemisphere` per solid angle. (..., 3) unit -> (...)."""
    return np.maximum(0.0, np.asarray(direction, np.float64)[..., 2]) / np.pi


def invert_cosine_hemisphere(direction: ArrayLike) -> Array:
    """Inverse of `cosine_hemisphere`. (..., 3) unit, z >= 0 -> (..., 2)."""
    return invert_concentric_disc(np.asarray(direction, np.float64)[..., :2])


def uniform_cone(u: ArrayLike, half_angle: ArrayLike) -> Array:
    """Directions spread evenly over the cap within `half_angle` of +z; pi covers the sphere.

    u : (..., 2).  half_angle : (...) radians in [0, pi]. Returns (..., 3) unit.

    >>> uniform_cone([0.0, 0.0], 0.5).tolist()
    [0.0, 0.0, 1.0]
    """
    uv = np.asarray(u, np.float64)
    # 1 - cos as 2 sin^2 of the half, which does not cancel for the sun's quarter of a degree
    fall = uv[..., 0] * 2.0 * np.sin(0.5 * np.asarray(half_angle, np.float64)) ** 2
    sine, phi = np.sqrt(np.maximum(0.0, fall * (2.0 - fall))), 2.0 * np.pi * uv[..., 1]
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), 1.0 - fall], axis=-1)


def uniform_cone_pdf(half_angle: ArrayLike) -> Array:
    """Density of `uniform_cone` per solid angle inside the cap. half_angle : (...) > 0 -> (...)."""
    return np.asarray(1.0 / (4.0 * np.pi * np.sin(0.5 * np.asarray(half_angle, np.float64)) ** 2))


def invert_uniform_cone(direction: ArrayLike, half_angle: ArrayLike) -> Array:
    """Inverse of `uniform_cone`. (..., 3) unit in the cap -> (..., 2)."""
    x, y, z = np.moveaxis(np.asarray(direction, np.float64), -1, 0)
    # 1 - z of a unit vector, from its small components where z is near 1
    fall = np.where(z > 0, (x * x + y * y) / (1.0 + np.abs(z)), 1.0 - z)
    share = fall / (2.0 * np.sin(0.5 * np.asarray(half_angle, np.float64)) ** 2)
    return np.stack([share, np.mod(np.arctan2(y, x) / (2.0 * np.pi), 1.0)], axis=-1)


def r2(index: ArrayLike, offset: ArrayLike = (0.0, 0.0)) -> Array:
    """Points of the R2 sequence in [0, 1)^2: any run of them is evenly spread.

    index : (...) integers >= 0.  offset : (..., 2), shifts the pattern (Cranley-Patterson), e.g. by
    a hash of the pixel. Returns (..., 2).

    >>> r2([0, 1]).round(4).tolist()
    [[0.5, 0.5], [0.2549, 0.0698]]
    """
    n = np.asarray(index, np.float64)[..., None]
    points = np.mod(0.5 + n * [1.0 / PLASTIC, 1.0 / PLASTIC**2] + np.asarray(offset), 1.0)
    # A mod of -1e-17 rounds to 1
    return np.where(points >= 1.0, 0.0, points)


def fibonacci_sphere(count: int, rotation: ArrayLike | None = None) -> Array:
    """Evenly spread unit vectors, (count, 3), each of the solid angle 4 pi / count.

    rotation : (3, 3), turns the set, as from `random_rotation`: a fixed one leaves structure in the
        error.
    Raises ValueError for count < 1.
    """
    if count < 1:
        raise ValueError("A sphere of points has one or more.")
    n = np.arange(count)
    z = 1.0 - (2.0 * n + 1.0) / count
    ring, phi = np.sqrt(1.0 - z * z), n * GOLDEN_ANGLE
    points = np.stack([ring * np.cos(phi), ring * np.sin(phi), z], axis=-1)
    return points if rotation is None else np.asarray(points @ np.asarray(rotation).T)


def random_rotation(*keys: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3), uniform over all, from a hash of integers (Shoemake 1992)."""
    u, v, w = (uniform01(*keys, i) for i in range(3))
    a, b = np.sqrt(1.0 - u), np.sqrt(u)
    x, y = a * np.sin(2 * np.pi * v), a * np.cos(2 * np.pi * v)
    z, s = b * np.sin(2 * np.pi * w), b * np.cos(2 * np.pi * w)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - s * z), 2 * (x * z + s * y)],
        [2 * (x * y + s * z), 1 - 2 * (x * x + z * z), 2 * (y * z - s * x)],
        [2 * (x * z - s * y), 2 * (y * z + s * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def orthonormal_basis(normal: ArrayLike) -> tuple[Array, Array]:
    """Two unit vectors that make a right-handed frame (a, b, normal) and never cancel.

    normal : (..., 3) unit. Returns a, b (..., 3) (Duff et al. 2017).

    >>> a, b = orthonormal_basis([0.0, 0.0, -1.0])
    >>> np.cross(a, b).tolist()
    [0.0, 0.0, -1.0]
    """
    x, y, z = np.moveaxis(np.asarray(normal, np.float64), -1, 0)
    sign = np.copysign(1.0, z)
    p = -1.0 / (sign + z)
    q = x * y * p
    a = np.stack([1.0 + sign * x * x * p, sign * q, -sign * x], axis=-1)
    return a, np.stack([q, sign + y * y * p, -y], axis=-1)


def sphere_quadrature(
    position: ArrayLike, radius: ArrayLike, nodes: tuple[int, int], *, above: bool = False
) -> tuple[Array, Array]:
    """Directions over the cap that a sphere covers and the solid angle of each.

    position : (..., 3) centre, seen from the origin.  radius : (...) > 0.  nodes, above : as
    `cap_quadrature`; with `above`, a sphere wholly below z = 0 gives nothing. Closer than its
    radius it is all around. Returns (..., n, 3) unit and (..., n) steradians. Raises ValueError for
    spheres that are none.
    """
    centre, R = np.asarray(position, np.float64), np.asarray(radius, np.float64)
    if not np.all((R > 0) & np.isfinite(R)) or not np.all(np.isfinite(centre)):
        raise ValueError("A sphere light has a finite position and a radius above 0.")
    distance = np.linalg.norm(centre, axis=-1)
    inside = distance <= R
    # Give a sphere that is all around some axis
    towards = np.where(inside[..., None], [0.0, 0.0, 1.0], centre)
    sine = np.where(inside, 0.0, R / np.maximum(distance, R))
    cosine = np.where(inside, -1.0, np.sqrt(1.0 - sine**2))
    # A cap under a thousandth is as good as that one: its own size only scales it
    angle = np.maximum(np.where(inside, np.pi, np.arcsin(sine)), 1e-3)
    # 1 - cos without cancellation
    height = np.where(inside, 2.0, sine**2 / (1.0 + np.abs(cosine)))
    directions, area = cap_quadrature(normalise(towards), angle, nodes, above=above)
    share = area * (0.5 * height / np.sin(0.5 * angle) ** 2)[..., None]
    if above:
        # Nothing at all from behind, whatever the least cap reaches over
        share = share * (inside | (centre[..., 2] > -R))[..., None]
    return directions, share


def cap_quadrature(
    centre: ArrayLike, half_angle: ArrayLike, nodes: tuple[int, int], *, above: bool = False
) -> tuple[Array, Array]:
    """Directions over a cap and the solid angle of each: nodes of Gauss, strip by strip of equal z.

    The area of a strip is dz times its azimuth. With `above` the cap ends at z = 0, and as it sets
    the shares move and none jumps.

    centre : (..., 3) unit.  half_angle : (...) radians in (0, pi].  nodes : strips, and azimuths on
        each, for each of up to three parts of the cap.
    Returns (..., n, 3) unit and (..., n) steradians, n the same for all caps of the call.

    >>> _, area = cap_quadrature([0.6, 0.0, 0.8], 0.5, (8, 8))
    >>> bool(abs(area.sum() / (2 * np.pi * (1 - np.cos(0.5))) - 1) < 1e-3)
    True
    """
    unit, angle = np.asarray(centre, np.float64), np.asarray(half_angle, np.float64)
    tilt = np.arctan2(np.hypot(unit[..., 0], unit[..., 1]), unit[..., 2])
    turn = np.arctan2(unit[..., 1], unit[..., 0])
    # From below: circles around -z, the part where z cuts the rim twice, circles around +z
    low = np.cos(angle + tilt)
    high = np.maximum(np.cos(angle - tilt), low)
    bottom, top = np.where(angle + tilt > np.pi, -1.0, low), np.where(angle > tilt, 1.0, high)
    edges = np.stack([bottom, low, high, top], axis=-1)
    edges = np.maximum(edges, 0.0) if above else edges
    x, w = np.polynomial.legendre.leggauss(nodes[0])
    y, v = np.polynomial.legendre.leggauss(nodes[1])
    # Azimuths end like a square root, which cos undoes
    grid, step = -np.cos(np.pi / 2 * (x + 1)), np.pi / 2 * w * np.sin(np.pi / 2 * (x + 1))
    found = []
    for part in range(3):
        middle = 0.5 * (edges[..., part] + edges[..., part + 1])[..., None]
        half = 0.5 * (edges[..., part + 1] - edges[..., part])[..., None]
        if part != 1 and not np.any(half > 0):
            continue
        z = middle + half * grid
        ring = np.sqrt(np.maximum(0.0, 1.0 - z * z))
        width = np.full_like(z, np.pi)
        if part == 1:
            reach = ring * np.sin(tilt)[..., None]
            rim = np.cos(angle)[..., None] - z * np.cos(tilt)[..., None]
            # A rim out of reach is one that rounding put there
            inside = np.clip(rim, -reach, reach) / np.where(reach > 0, reach, 1.0)
            width = np.arccos(np.clip(inside, -1.0, 1.0))
        phi = turn[..., None, None] + width[..., None] * y
        r = ring[..., None]
        cap = np.stack(
            [r * np.cos(phi), r * np.sin(phi), np.broadcast_to(z[..., None], phi.shape)], -1
        )
        area = (half * step * width)[..., None] * v
        found.append((cap.reshape(*z.shape[:-1], -1, 3), area.reshape(*z.shape[:-1], -1)))
    return np.concatenate([d for d, _ in found], -2), np.concatenate([a for _, a in found], -1)
