"""Hard cases of spherical and hemispherical harmonics: poles, high orders, samples, rotation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maths import sampling, spherical_harmonics, spherical_projection, spherical_window, transforms
from maths.hemispherical_harmonics import fit_weights
from maths.spherical_projection import cap, clamped_cosine, cosine_factors, project_samples
from maths.spherical_rotation import rotate, rotation_matrices
from pipelines.hard.cells import Family, Result, all_of, at_most, equal, refused

spherical = Family("spherical harmonics")
Array = NDArray[np.float64]
evaluate = spherical_harmonics.evaluate


def scattered(count: int, seed: int) -> Array:
    """Return unit directions (count, 3), random."""
    return transforms.normalise(np.random.default_rng(seed).normal(size=(count, 3)))


def near_poles() -> Array:
    away = np.concatenate([[0.0], 10.0 ** np.arange(-8, -1)])
    rings = [[[np.sin(a), 0, s * np.cos(a)], [0, np.sin(a), s * np.cos(a)]] for a in away
             for s in (1, -1)]  # fmt: skip
    return np.array(rings).reshape(-1, 3)


def unsoeld(values: NDArray[np.floating], l_max: int) -> float:
    """Return how far the squares of each band are from (2 l + 1) / 4 pi, relative."""
    band = spherical_harmonics.band_of(l_max)
    sums = np.stack([np.sum(values[..., band == x] ** 2, -1) for x in range(l_max + 1)], -1)
    return float(np.abs(sums * 4 * np.pi / (2 * np.arange(l_max + 1) + 1) - 1).max())


spherical.row("S1", "the poles, and 1e-8 to 1e-2 from them", "as exact as elsewhere",
              "squares of a band sum to (2 l + 1) / 4 pi (Unsoeld)")  # fmt: skip


@spherical.cell("S1", "maths.spherical_harmonics")
def _poles() -> Result:
    # 8e-14 measured at l = 40 in float64
    return at_most(unsoeld(evaluate(near_poles(), 40), 40), 2e-13)


@spherical.cell("S1", "float32")
def _poles_single() -> Result:
    values = evaluate(near_poles().astype(np.float32), 10)
    # Worked out in float64 and rounded: 2^-24 a value, squared and summed
    return at_most(unsoeld(values.astype(float), 10), 4 * 2.0**-24)


spherical.row("S2", "high orders in single precision", "exact to rounding, no cliff", "Unsoeld")


@spherical.cell("S2", "maths.spherical_harmonics")
def _high() -> Result:
    values = evaluate(scattered(500, 2).astype(np.float32), 60)
    # float32 directions are 1e-7 off unit length only before they are scaled
    return at_most(unsoeld(values.astype(float), 60), 4 * 2.0**-24)


spherical.row(
    "S3",
    "directions of length 0, NaN, huge or tiny",
    "refused, or scaled by the largest",
    "length does not matter",
)


@spherical.cell("S3", "maths.spherical_harmonics")
def _none() -> Result:
    bad = ([0.0, 0, 0], [np.nan, 0, 1], [np.inf, 0, 0])
    return all_of(*(refused(lambda d=d: evaluate([d], 3)) for d in bad))


@spherical.cell("S3", "lengths 1e-300 and 1e300")
def _lengths() -> Result:
    d = scattered(50, 3)
    return all_of(
        *(
            at_most(np.abs(evaluate(d * s, 4) - evaluate(d, 4)).max(), 1e-13)
            for s in (1e-300, 1e300)
        )
    )


spherical.row("S4", "directions a thousandth too long", "scaled to unit length", "the same")


@spherical.cell("S4", "maths.spherical_harmonics")
def _long() -> Result:
    d = scattered(200, 4)
    return at_most(np.abs(evaluate(1.001 * d, 5) - evaluate(d, 5)).max(), 1e-13)


spherical.row("S5", "orthonormality under the sampler", "OK", "measured gate by order and count")
for _l, _n, _gate in ((3, 100, 0.0135), (3, 256, 0.0027), (3, 1024, 3.5e-4), (5, 256, 0.0073),
                      (5, 1024, 8.8e-4)):  # fmt: skip
    spherical.add(
        "S5",
        f"Fibonacci set of {_n}, l = {_l}",
        lambda top=_l, n=_n, gate=_gate: at_most(
            spherical_projection.gram_error(sampling.fibonacci_sphere(n), top),
            1.02 * gate,
            "the set is fixed: measured to 2 digits",
        ),
    )


@spherical.cell("S5", "Gauss quadrature")
def _gauss() -> Result:
    found = []
    for top in (3, 5, 20):
        d, w = spherical_projection.quadrature(top)
        Y = evaluate(d, top)
        found.append(at_most(np.abs((Y * w[:, None]).T @ Y - np.eye((top + 1) ** 2)).max(), 1e-13))
    return all_of(*found)


spherical.row("S6", "fewer samples than coefficients", "refused", "rank")


@spherical.cell("S6", "maths.spherical_projection")
def _too_few() -> Result:
    d = scattered(8, 6)
    return refused(lambda: project_samples(d, np.ones(8), 2, least_squares=True))


def _sees(d: Array, axis: Array) -> Array:
    return np.asarray(d @ axis > np.cos(0.7), np.float64)


def _errors(counts: tuple[int, ...], *, even: bool) -> list[float]:
    axes = scattered(24, 7)
    truth = spherical_harmonics.turn_zonal(cap(0.7, 3), axes)
    found = []
    for n in counts:
        total = 0.0
        for i, axis in enumerate(axes):
            turn = sampling.random_rotation(i, 5)
            d = sampling.fibonacci_sphere(n, turn) if even else scattered(n, 100 * i + n)
            total += float(np.sum((project_samples(d, _sees(d, axis), 3) - truth[i]) ** 2))
        found.append(np.sqrt(total / len(axes)))
    return found


spherical.row("S7", "convergence on binary visibility", "OK",
              "slopes -0.5 of random, -0.75 of even sets; a rim is a line")  # fmt: skip
for _even, _slope in ((True, -0.75), (False, -0.5)):

    def _converges(even: bool = _even, slope: float = _slope) -> Result:
        counts = (64, 256, 1024, 4096)
        found = np.polyfit(np.log(counts), np.log(_errors(counts, even=even)), 1)[0]
        # Measured over 8 seeds: 0.012 about the slope with one more count
        return at_most(abs(found - slope), 0.06, f"slope {found:.3f}")

    spherical.add("S7", "even sets" if _even else "random sets", _converges)

spherical.row("S8", "one fixed pattern for all voxels", "turned by a hash of the voxel",
              "neighbours' errors do not correlate")  # fmt: skip


@spherical.cell("S8", "maths.sampling")
def _pattern() -> Result:
    count = 300
    t = np.linspace(0, 0.4, count)
    axes = transforms.normalise(np.stack([0.3 + t, 0.2 + 0 * t, 0.7 + 0 * t], axis=-1))
    truth = spherical_harmonics.turn_zonal(cap(0.7, 3), axes)
    errors = []
    for i, axis in enumerate(axes):
        d = sampling.fibonacci_sphere(256, sampling.random_rotation(i, 9))
        errors.append(project_samples(d, _sees(d, axis), 3) - truth[i])
    e = np.array(errors)
    # The numbers of one cap hang together: 1 / sqrt(300) at worst, three times that
    return at_most(abs(np.sum(e[1:] * e[:-1]) / np.sum(e * e)), 3 / np.sqrt(count))


spherical.row(
    "S9", "ringing", "known exactly, and the least window that ends it", "zonal closed form"
)


@spherical.cell("S9", "maths.spherical_window")
def _ringing() -> Result:
    Y = spherical_harmonics.turn_zonal(cap(np.radians(30), 3), scattered(20, 9))
    low = spherical_window.minimum(Y)
    amount = spherical_window.smallest_window(Y)
    lifted = spherical_window.minimum(Y * spherical_window.window(3, amount))
    return all_of(
        at_most(np.abs(low + 0.151).max(), 5e-4, "published minimum"),
        at_most(-lifted.min(), 1e-6, "20 bisections"),
    )


spherical.row("S10", "rotations: identity, half turns, gimbal, random", "OK",
              "Y(R d) = D Y(d), and D orthogonal")  # fmt: skip


@spherical.cell("S10", "maths.spherical_rotation")
def _turns() -> Result:
    half = [np.diag(d) for d in ([1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1])]
    gimbal = [transforms.euler(a) for a in ([0, np.pi / 2, 0], [0.3, -np.pi / 2, 1], [0, np.pi, 0])]
    random = [sampling.random_rotation(i, 1) for i in range(8)]
    d, worst, apart = scattered(60, 10), 0.0, 0.0
    for R in (*half, *gimbal, *random):
        worst = max(worst, np.abs(rotate(evaluate(d, 12), R) - evaluate(d @ R.T, 12)).max())
        for D in rotation_matrices(R, 12):
            apart = max(apart, np.abs(D @ D.T - np.eye(len(D))).max())
    # Measured 4e-15 and 7e-15 to l = 20 (NUMERICS S10), of values up to sqrt(25 / 4 pi)
    return all_of(at_most(worst, 5e-14), at_most(apart, 2e-14))


spherical.row("S11", "a matrix that scales, shears or mirrors", "refused", "|R R^T - I| > 1e-4")
for _name, _matrix in (
    ("scale 1.01", 1.01 * np.eye(3)),
    ("mirror", np.diag([1.0, 1, -1])),
    ("shear", np.eye(3) + np.eye(3, k=1) * 0.01),
    ("NaN", np.full((3, 3), np.nan)),
):
    spherical.add("S11", _name, lambda m=_matrix: refused(lambda: rotation_matrices(m, 4)))

spherical.row("S12", "3,600 turns of a degree, one after another", "drift of rounding only",
              "ten full turns are the identity")  # fmt: skip


@spherical.cell("S12", "maths.spherical_rotation")
def _drift() -> Result:
    D = rotation_matrices(transforms.euler([0.01, np.radians(1), 0]) @ np.eye(3), 4)
    R = transforms.euler([0.01, np.radians(1), 0])
    c = evaluate(scattered(1, 12), 4)[0]
    found, total = c.copy(), np.eye(3)
    for _ in range(3600):
        found = np.concatenate([D[b] @ found[b * b : (b + 1) ** 2] for b in range(5)])
        total = R @ total
    # Measured 2e-11 (NUMERICS S12): the sum of 3,600 roundings
    return at_most(np.abs(found - rotate(c, total)).max(), 4e-11)


spherical.row("S13", "a turned light against a normal turned back", "equal", "metamorphic")


@spherical.cell("S13", "maths.spherical_projection")
def _turned_back() -> Result:
    light, normals = evaluate(scattered(1, 13), 4)[0], scattered(40, 14)
    R = sampling.random_rotation(13, 2)
    a = clamped_cosine(normals, 4) @ rotate(light, R)
    b = clamped_cosine(normals @ R, 4) @ light
    return at_most(np.abs(a - b).max(), 1e-13)


spherical.row("S14", "energy and mean under rotation", "kept", "Parseval; mean is c00 / 2 sqrt(pi)")


@spherical.cell("S14", "maths.spherical_rotation")
def _energy() -> Result:
    c = np.random.default_rng(14).normal(size=(6, 36))
    found = rotate(c, sampling.random_rotation(14, 3))
    return all_of(
        at_most(np.abs(np.sum(found**2, -1) - np.sum(c**2, -1)).max(), 1e-12),
        equal(found[:, 0], c[:, 0], "the mean stays"),
    )


spherical.row("S15", "a light of one direction, or all around", "irradiance in closed form",
              "A_l: pi for an even sky, cosine for a sun within the order")  # fmt: skip


@spherical.cell("S15", "maths.spherical_projection")
def _sky() -> Result:
    sky = np.zeros(25)
    sky[0] = 2 * np.sqrt(np.pi)
    E = clamped_cosine(scattered(50, 15), 4) @ sky
    A = cosine_factors(6)
    truth = [np.pi, 2 * np.pi / 3, np.pi / 4, 0, -np.pi / 24, 0, np.pi / 64]
    return all_of(at_most(np.abs(E - np.pi).max(), 1e-13), at_most(np.abs(A - truth).max(), 1e-14))


spherical.row(
    "S16",
    "hemispherical fits: few lights, lights in a plane, lights under the horizon",
    "smoothed; finite; a constant nearly stays",
    "penalty leaves the constant alone",
)
_RING = np.stack([np.cos(np.arange(12)), np.sin(np.arange(12)), np.full(12, 0.5)], -1)
for _name, _lights in (
    ("12 lights in a plane", transforms.normalise(_RING)),
    ("7 lights", transforms.normalise(np.abs(scattered(7, 16)))),
    ("half of them under the horizon", scattered(40, 17)),
):

    def _hemisphere(lights: Array = _lights) -> Result:
        fit = fit_weights(lights, 4, 0.1)
        values = evaluate_constant(fit.matrix @ np.full(len(lights), 0.7))
        return at_most(np.abs(values - 0.7).max(), 1e-9, f"condition {fit.condition:.3g}")

    spherical.add("S16", _name, _hemisphere)


def evaluate_constant(series: Array) -> Array:
    """Return the values of a hemispherical series of 4 bands in directions of the hemisphere."""
    from maths.hemispherical_harmonics import evaluate as basis

    d = scattered(100, 18) * [1, 1, 0] + [0, 0, 1]
    return np.asarray(basis(transforms.normalise(d), 4) @ series)
