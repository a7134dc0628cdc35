"""Irradiance from a disc of uniform radiance in closed form, cut off by the receiver's horizon.

The irradiance is a contour integral, `E = L / 2 n . loop r x dr / r^2` (Lambert; Fock 1924). Around
the whole circle it has the forms of the tables of configuration factors. Where the horizon cuts the
disc the contour is an arc and a chord. With u along the normal's part in the disc's plane, w away
from the receiver, v = w x u, and the centre at (x, y, h), the arc |t| < t1 gives

    m t1 - integral (m X / 2 + R s h cos t) / (W + 2 R (x cos t + y sin t)) dt,
    n = s u + m w,  X = x^2 + y^2 + h^2 - R^2,  W = X + 2 R^2,

which is elementary (half-angle tangents and a logarithm), and the chord gives the angle that it
subtends in the plane of the horizon. Differences of nearly equal terms are written out by their
conjugates; what then still cancels for a disc seen from far away (nothing is left of 1 but R / D)
is summed by nodes of Gauss instead, below R / D = FAR.

References
----------
Fock 1924, Zur Berechnung der Beleuchtungsstärke, Zeitschrift für Physik 28.
Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-12 to B-15 (the whole disc).
Snyder 1996, Area Light Sources for Real-Time Graphics, MSR-TR-96-11.
Heitz 2017, Analytical Calculation of the Solid Angle Subtended by an Arbitrarily Positioned
    Ellipsoid to a Point Source (the disc as a centred ellipse).
Bulirsch 1969, Numerical Calculation of Elliptic Integrals and Elliptic Functions III (cel).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

TINY = 1e-60
LEVEL = 1e-12
"""Sine below which receiver and disc are parallel, and the horizon cuts nothing."""
FAR = 0.01
"""R / D below which the part above the horizon is summed: the closed form has lost 1e-16 D / R."""
ARC, CHORD = 14, 4
"""Nodes over the arc (1e-13: sin^2 t (cos t - k) over up to half a turn) and along each chord
(error FAR^8)."""


def disc_irradiance(
    point: ArrayLike,
    normal: ArrayLike,
    centre: ArrayLike,
    axis: ArrayLike,
    radius: ArrayLike,
    radiance: ArrayLike,
    *,
    two_sided: bool = False,
) -> Array:
    """Irradiance from a glowing disc, wherever it and the horizon are.

    point, normal, centre, axis : (..., 3), metres; normal and axis unit, the disc shines along
    axis.
    radius : (...) metres; 0 or less gives no light.  radiance : a number or (..., c).  two_sided :
    it shines both ways. Points in the disc's own plane get nothing.
    Returns (...) or (..., c), W/m^2. Raises ValueError for a disc whose numbers are not finite.

    >>> x = disc_irradiance([0.0, 0, 0], [0, 1.0, 0], [0.0, 2, 0], [0, -1.0, 0], 1.0, 1.0)
    >>> round(float(x / np.pi), 15)
    0.2
    """
    c = np.asarray(centre, np.float64) - np.asarray(point, np.float64)
    n, forward = np.asarray(normal, np.float64), np.asarray(axis, np.float64)
    R = np.maximum(np.asarray(radius, np.float64), 0.0)
    if not all(np.all(np.isfinite(given)) for given in (centre, forward, R)):
        raise ValueError("A disc light has a finite place, axis and radius.")
    shape = np.broadcast_shapes(c.shape, n.shape, forward.shape, (*R.shape, 3))
    c, n, forward = (np.broadcast_to(x, shape).reshape(-1, 3) for x in (c, n, forward))
    R = np.broadcast_to(R, shape[:-1]).reshape(-1)
    height = -_dot(c, forward)
    lit = (R > 0) & ((height != 0) if two_sided else (height > 0))
    factor = np.zeros(len(R))
    away = np.where(height[lit] > 0, -1.0, 1.0)[:, None] * forward[lit]
    factor[lit] = _front(c[lit], n[lit], away, R[lit])
    return _scaled(factor.reshape(shape[:-1]), radiance)


def disc_solid_angle(
    point: ArrayLike, centre: ArrayLike, axis: ArrayLike, radius: ArrayLike
) -> Array:
    """Solid angle of a disc, from either side. Returns (...) steradians; 0 in its own plane.

    The disc is a centred ellipse A <= B on a plane at distance 1 across its cone (Heitz 2017). With
    T = A^2 cos^2 + B^2 sin^2 the solid angle is `A B integral dt / (sqrt(1 + T) (1 + sqrt(1 + T)))`
    over a turn: the mean of 32 points is exact to 1e-16 for B < 1/2, Bulirsch's cel does the
    others.

    >>> round(float(disc_solid_angle([0.0, 0, 0], [0.0, 0, 3], [0, 0, 1.0], 4.0) / np.pi), 14)
    0.8
    """
    c = np.asarray(centre, np.float64) - np.asarray(point, np.float64)
    w = np.asarray(axis, np.float64)
    R = np.maximum(np.asarray(radius, np.float64), 0.0)
    h = np.abs(_dot(c, w))
    unit = np.sqrt(_dot(c, c) + R * R)
    unit = np.where((h > 0) & (R > 0), unit, 1.0)
    a = np.sqrt(_square(c - _dot(c, w)[..., None] * w)) / unit
    h, R, c = np.where(R > 0, h / unit, 0.0), R / unit, c / unit[..., None]
    S = np.sqrt((a - R) ** 2 + h * h) * np.sqrt((a + R) ** 2 + h * h)
    seen = (h > 0) & (S > 0)
    S = np.where(seen, S, 1.0)
    # s^2 - (2 R)^2 and s^2 - (2 a)^2, halved, of the sum s of the distances to the rim's ends
    X, Y = a * a + h * h - R * R, R * R + h * h - a * a
    over = np.where(X > 0, S + X, 4 * (R * h) ** 2 / np.where(X > 0, 1.0, S - X))
    flat = np.where(Y > 0, S + Y, 4 * (a * h) ** 2 / np.where(Y > 0, 1.0, S - Y))
    whole = S + a * a + h * h + R * R
    seen &= (over > TINY) & (flat > TINY)
    over, flat = np.where(seen, over, 1.0), np.where(seen, flat, 1.0)
    B2 = np.where(seen, 2 * R * R / over, 1.0)
    A2 = np.where(seen, B2 * flat / whole, 1.0)
    total = np.zeros(np.broadcast_shapes(A2.shape, B2.shape))
    for t in (np.arange(32) + 0.5) * (np.pi / 32):
        root = np.sqrt(1.0 + A2 * np.cos(t) ** 2 + B2 * np.sin(t) ** 2)
        total = total + 1.0 / (root * (1.0 + root))
    small = np.sqrt(A2 * B2) * total * (2 * np.pi / 32)
    # Axes change places so that cel's modulus is real
    root = np.sqrt(1.0 + B2)
    wide = _cel(np.sqrt(1.0 + A2) / root, np.sqrt(A2 / B2))
    large = 2.0 * np.pi - 4.0 * np.sqrt(A2 / B2) / root * wide
    return np.where(seen, np.where(B2 < 0.25, small, np.maximum(large, 0.0)), 0.0)


def _front(c: Array, n: Array, w: Array, R: Array) -> Array:
    """Irradiance (N,) for radiance 1 on points in front; w points away from them."""
    unit = np.sqrt(_square(c) + R * R)
    c, R = c / unit[:, None], R / unit
    h, m = np.maximum(_dot(c, w), TINY), _dot(n, w)
    beside = c - h[:, None] * w
    a = np.sqrt(_square(beside))
    near, far = np.sqrt((a - R) ** 2 + h * h), np.sqrt((a + R) ** 2 + h * h)
    S, X = np.maximum(near * far, TINY), (a - R) * (a + R) + h * h
    # 1 - X / S, by its conjugate where it cancels
    gap = np.where(X > 0, 4 * (R * h) ** 2 / (S * np.maximum(S + X, TINY)), 1.0 - X / S)
    radial = 2 * np.pi * h * R * R / (S * (S + 1.0))
    whole = m * (np.pi / 2) * gap + radial * _dot(n, beside)
    # Where the horizon cuts the disc
    along = n - m[:, None] * w
    s = np.sqrt(_square(along))
    rise = _dot(n, c)
    cut = (np.abs(rise) < R * s) & (s > LEVEL)
    found = np.where(rise > 0, whole, 0.0)
    if np.any(cut):
        u = along[cut] / s[cut][:, None]
        x, y = _dot(beside[cut], u), _dot(beside[cut], np.cross(w[cut], u))
        part = (x, y, h[cut], R[cut], m[cut], s[cut], -rise[cut] / (R[cut] * s[cut]))
        closed = _arc_and_chord(*part, near[cut], far[cut], gap[cut])
        found[cut] = np.where(R[cut] < FAR, _strips(*part), closed)
    return np.clip(found, 0.0, np.pi)


def _arc_and_chord(
    x: Array, y: Array, h: Array, R: Array, m: Array, s: Array, k: Array, *more: Array
) -> Array:
    """Contour integral of the part above the horizon; k is the cosine of the arc's end."""
    near, far, gap = more
    sine = np.sqrt((1.0 - k) * (1.0 + k))
    t1, S = np.arctan2(sine, k), np.maximum(near * far, TINY)
    middle = np.arctan2(y, x)
    # Of x and y themselves: near the axis their direction counts, however small they are
    a = np.maximum(np.hypot(x, y), TINY)
    # tau / 2 - atan(near / far tan(tau / 2)) between the ends of the arc
    less, ratio = 4 * R * a / ((near + far) * far), near / far
    turn = np.zeros_like(k)
    for sign in (1.0, -1.0):
        half = 0.5 * (sign * t1 - middle)
        p, q = np.sin(half), np.cos(half)
        turn += sign * np.arctan2(less * p * q, q * q + ratio * p * p)
    # Integral of cos t / (W + 2 R (x cos t + y sin t)), W = 1
    share = 2 * R * y * sine / np.maximum(1.0 + 2 * R * x * k, TINY)
    logarithm = 2.0 * np.arctanh(np.clip(share, -1 + 1e-15, 1 - 1e-15))
    even = turn / (R * a * S) - 4 * t1 * R * a / (S * (S + 1.0))
    integral = np.cos(middle) * even + np.sin(middle) * logarithm / (2 * R * a)
    # Distances in the plane of the horizon: to the chord's line, half the chord
    g, f = h / s, R * sine
    chord = np.arctan2(2 * f * g, g * g + y * y - f * f)
    return 0.5 * (m * (t1 * gap + (1.0 - gap) * turn) - R * s * h * integral + chord)


def _strips(x: Array, y: Array, h: Array, R: Array, m: Array, s: Array, k: Array) -> Array:
    """Area integral of the part above the horizon, chord by chord, for a disc far away."""
    del m
    t1 = np.arctan2(np.sqrt((1.0 - k) * (1.0 + k)), k)
    nodes, weights = np.polynomial.legendre.leggauss(ARC)
    across, shares = np.polynomial.legendre.leggauss(CHORD)
    total = np.zeros_like(k)
    for node, weight in zip(nodes, weights, strict=True):
        t = 0.5 * t1 * (1.0 + node)
        # cos t - cos t1 as a product
        lift = 2.0 * np.sin(0.5 * (t1 + t)) * np.sin(0.5 * (t1 - t))
        p, q = R * np.cos(t), R * np.sin(t)
        inner = np.zeros_like(k)
        for v, share in zip(across, shares, strict=True):
            inner += share / ((x + p) ** 2 + (y + q * v) ** 2 + h * h) ** 2
        total += weight * np.sin(t) ** 2 * lift * inner
    return 0.5 * t1 * h * s * R**3 * total


def _cel(kc: Array, p: Array) -> Array:
    """Complete elliptic integral cel(kc, p^2, 1, 1), by means (Bulirsch 1969).

    Integral over a quarter turn of 1 / ((cos^2 + p^2 sin^2) sqrt(cos^2 + kc^2 sin^2)); p, kc > 0.
    """
    a, b, e, mean = np.ones_like(p), 1.0 / p, kc, np.ones_like(p)
    # From a modulus of 1e-8 the means agree to 1e-16 after nine steps
    for _ in range(10):
        g = e / p
        a, b = a + b / p, 2.0 * (b + a * g)
        p, mean = p + g, mean + kc
        kc = 2.0 * np.sqrt(e)
        e = kc * mean
    return np.asarray(0.5 * np.pi * (b + a * mean) / (mean * (mean + p)))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1))


def _square(a: Array) -> Array:
    return np.asarray(np.sum(a * a, axis=-1))


def _scaled(factor: Array, radiance: ArrayLike) -> Array:
    L = np.asarray(radiance, np.float64)
    return np.asarray(factor * L if L.ndim == 0 else factor[..., None] * L)
