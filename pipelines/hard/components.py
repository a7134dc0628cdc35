"""Hard cases of principal components and of the codes of occlusion volumes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from maths.principal_components import Components, principal_components
from pipelines.hard.cells import Family, Result, all_of, at_most, equal, noted, refused

components = Family("components and codes")
Array = NDArray[np.float64]


def records(seed: int, n: int = 500, p: int = 36, fall: float = 0.7) -> Array:
    """Return records (n, p) whose spectrum falls by a factor a component."""
    rng = np.random.default_rng(seed)
    return np.asarray(rng.normal(size=(n, p)) * fall ** np.arange(p) @ rng.normal(size=(p, p)))


def optimum(x: Array, count: int) -> float:
    """Return the least RMS residual of any `count` components (Eckart, Young)."""
    s = np.linalg.svd(x, compute_uv=False)
    return float(np.sqrt(np.sum(s[count:] ** 2) / x.size))


def left(x: Array, found: Components) -> float:
    V = found.vectors
    return float(np.sqrt(np.mean((x - x @ V.T @ V) ** 2)))


components.row("P1", "records with a huge common offset", "residual within 1 % of the optimum",
               "Eckart, Young by an SVD")  # fmt: skip
for _offset in (0.0, 1.0, 100.0, 1e4, 1e6, 1e12):

    def _offset_kept(offset: float = _offset) -> Result:
        x = records(1) + offset
        best = optimum(x, 16)
        # What the SVD itself rounds: eps of the largest entry
        return at_most(left(x, principal_components(x, 16)), 1.01 * best + 1e-13 * np.abs(x).max())

    components.add("P1", f"offset {_offset:g}", _offset_kept)

components.row("P2", "zero must stay zero", "uncentred: records of 0 have scores of 0", "exact")


@components.cell("P2", "maths.principal_components")
def _zero() -> Result:
    x = records(2) + 3.0
    x[7] = 0
    return equal(x[7] @ principal_components(x, 16).vectors.T, np.zeros(16))


components.row("P3", "constant or zero records", "rank 1 or 0, the rest zeros", "exact")


@components.cell("P3", "zero records")
def _nothing() -> Result:
    found = principal_components(np.zeros((40, 9)), 4)
    return all_of(equal(found.rank, 0), equal(found.vectors, np.zeros((4, 9))),
                  noted(found.warnings, "all zero"))  # fmt: skip


@components.cell("P3", "constant records")
def _constant() -> Result:
    x = np.full((40, 9), 0.3)
    found = principal_components(x, 4)
    return all_of(equal(found.rank, 1), at_most(left(x, found), 1e-15))


components.row("P4", "rank, records or columns below the count", "zeros fill up, and a note",
               "what the rank holds comes back exactly")  # fmt: skip
for _name, _shape, _rank in (("rank 3", (100, 20), 3), ("5 records", (5, 30), 5),
                             ("1 record", (1, 30), 1), ("4 columns", (200, 4), 4)):  # fmt: skip

    def _short(shape: tuple[int, int] = _shape, rank: int = _rank) -> Result:
        rng = np.random.default_rng(4)
        x = rng.normal(size=(shape[0], rank)) @ rng.normal(size=(rank, shape[1]))
        found = principal_components(x, 16)
        return all_of(
            equal(found.rank, rank), noted(found.warnings, "are zero"),
            at_most(left(x, found), 1e-12, "nothing is left out"),
        )  # fmt: skip

    components.add("P4", _name, _short)

components.row("P5", "NaN or infinity among the records", "refused", "checked first")
for _bad in (np.nan, np.inf, -np.inf):

    def _broken(bad: float = _bad) -> Result:
        x = records(5)
        x[3, 4] = bad
        return refused(lambda: principal_components(x, 4), "finite")

    components.add("P5", f"{_bad}", _broken)

components.row(
    "P6", "signs and order", "the largest loading is positive, the first of equals", "rule"
)


@components.cell("P6", "maths.principal_components")
def _signs() -> Result:
    x = records(6)
    a, b = (principal_components(sign * x, 16).vectors for sign in (1, -1))
    largest = np.take_along_axis(a, np.abs(a).argmax(1)[:, None], 1)
    return all_of(equal(a, b), equal(largest > 0, np.ones((16, 1), bool)))


components.row("P7", "equal singular values", "the plane they span is right", "projector")


@components.cell("P7", "maths.principal_components")
def _degenerate() -> Result:
    Q = np.linalg.qr(np.random.default_rng(7).normal(size=(12, 12)))[0]
    x = np.repeat((Q * [3, 3, 3, 1, *[0.1] * 8]).T, 5, axis=0)
    V = principal_components(x, 3).vectors
    return at_most(np.abs(V.T @ V - Q[:, :3] @ Q[:, :3].T).max(), 1e-12)


components.row("P8", "singular values over 12 decades", "found to the rounding of the largest",
               "SVD: eps of the largest")  # fmt: skip


@components.cell("P8", "maths.principal_components")
def _decades() -> Result:
    rng = np.random.default_rng(8)
    U, V = (np.linalg.qr(rng.normal(size=(n, 13)))[0] for n in (400, 20))
    s = 10.0 ** -np.arange(13)
    found = principal_components(U * s @ V.T, 13).singular
    # 400 records and 20 columns: a few tens of eps
    return at_most(np.abs(found - s).max(), 100 * 2.2e-16)


components.row("P9", "random starts", "none are used: the same bits every time", "bit-equal")


@components.cell("P9", "maths.principal_components")
def _again() -> Result:
    x = records(9)
    return equal(principal_components(x, 16).vectors, principal_components(x.copy("F"), 16).vectors)


components.row("P10", "voxels inside a solid", "hold what their neighbours outside see",
               "they lie within the range of those outside")  # fmt: skip
components.row("P11", "8-bit codes of scores", "error within the sum of half codes",
               "sum of s_k max|v_k| / 254")  # fmt: skip
components.row("P12", "linear filtering of codes", "within the same bound; shares clamped",
               "filtering is linear")  # fmt: skip


@lru_cache
def _volume() -> tuple[Any, Any]:
    from bake import compress, occlusion
    from pipelines.hard import shapes

    master = occlusion.trace(
        shapes.ball(), params=occlusion.Params(grid=8, l_max=3, rays=64, proof=4)
    )
    return master, compress.compress(master, params=compress.Params(size=32))


@components.cell("P10", "bake.occlusion")
def _inside() -> Result:
    master, _ = _volume()
    inside, terms = master.inside, master.terms
    outside = terms[~inside]
    beyond = np.maximum(terms[inside] - outside.max(0), outside.min(0) - terms[inside])
    return all_of(at_most(beyond.max(), 1e-6, "means of neighbours"), equal(inside.any(), True))


def _code_bound(coded: Any) -> Array:
    scales = np.asarray(coded.scales, np.float64)[: coded.components]
    return np.asarray(scales @ np.abs(coded.basis) / 254) + 1e-6


def _code_error(coded: Any, master: Any) -> Array:
    return np.asarray(coded.decoded() @ coded.basis - master.terms.astype(np.float64))


@components.cell("P11", "bake.compress")
def _codes() -> Result:
    master, coded = _volume()
    # 16 components hold all 16 coefficients of l_max = 3: codes are the only loss
    off = np.abs(_code_error(coded, master)).reshape(-1, 16).max(0)
    return at_most(np.max(off / _code_bound(coded)), 1.0, "half codes of all components")


@components.cell("P12", "bake.compress")
def _filtered() -> Result:
    master, coded = _volume()
    off = _code_error(coded, master)
    between = np.abs(0.5 * off[1:] + 0.5 * off[:-1]).reshape(-1, 16).max(0)
    return at_most(np.max(between / _code_bound(coded)), 1.0, "half-way between texels")


components.row(
    "P13", "records of any size, 1e-150 to 1e150", "the same directions", "scaled to 1 first"
)
for _size in (1e-150, 1e-30, 1e30, 1e150):
    components.add("P13", f"times {_size:g}", lambda s=_size: at_most(
        np.abs(principal_components(records(13) * s, 8).vectors
               - principal_components(records(13), 8).vectors).max(), 1e-9,
        "rounding over the gaps of the spectrum"))  # fmt: skip
