"""The generic battery: hard inputs that every stage must survive, in the manner of scikit-learn's
estimator checks.

A stage's tests make one good call and let the battery spoil its assets one array at a time:

    MESH = small_mesh()

    @pytest.mark.parametrize("case", stage_battery.cases(MESH), ids=str)
    def test_battery(case, tmp_path):
        stage_battery.check(case, trace, (MESH,), Params(resolution=8), tmp_path)

Each case ends in an asset that is finite, in memory and as saved, or in a typed error of one line.
Cases that do not change any value (read-only, strided, byte order) must give the very same files.
No case may change its inputs.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import seal
from formats.errors import BakelightError
from pipelines.hard.finite import numbers

Array = NDArray[Any]
Spoil = Callable[[Array], Array]


def with_first(value: object) -> Spoil:
    """Replace the first element."""

    def spoil(array: Array) -> Array:
        spoilt = array.copy()
        spoilt.reshape(-1)[0] = value
        return spoilt

    return spoil


def scaled(factor: float) -> Spoil:
    """Multiply in float64; what the type cannot hold becomes its infinity, as in files."""

    def spoil(array: Array) -> Array:
        with np.errstate(all="ignore"):
            return (array.astype(np.float64) * factor).astype(array.dtype)

    return spoil


def shifted(offset: float) -> Spoil:
    """Add in float64, far beyond the spacing of float32."""

    def spoil(array: Array) -> Array:
        with np.errstate(all="ignore"):
            return (array.astype(np.float64) + offset).astype(array.dtype)

    return spoil


def read_only(array: Array) -> Array:
    locked = array.copy()
    locked.setflags(write=False)
    return locked


def strided(array: Array) -> Array:
    """Lay the same values out with gaps, backwards in memory."""
    wide = np.zeros((*array.shape[:-1], 2 * array.shape[-1]), array.dtype)
    view = wide[..., ::-2]
    view[...] = array
    return view


ALIKE: dict[str, Spoil] = {
    "read-only": read_only,
    "non-contiguous": strided,
    "Fortran order": np.asfortranarray,
    "other byte order": lambda array: array.astype(array.dtype.newbyteorder("S")),
}

ANY: dict[str, Spoil] = {
    "empty": lambda array: array[:0],
    "one element": lambda array: array[:1],
    "wrong rank": lambda array: array[None],
    "flat": lambda array: array.reshape(-1),
    "last axis short": lambda array: array[..., :-1],
    "last axis long": lambda array: np.concatenate([array, array[..., :1]], axis=-1),
    "first axis long": lambda array: np.concatenate([array, array[:1]]),
    "objects": lambda array: array.astype(object),
    "text": lambda array: array.astype(str),
    "complex": lambda array: array.astype(np.complex128),
}

FLOATS: dict[str, Spoil] = {
    "one NaN": with_first(math.nan),
    "all NaN": lambda array: np.full_like(array, math.nan),
    "infinity": with_first(math.inf),
    "minus infinity": with_first(-math.inf),
    "all zero": np.zeros_like,
    "negated": np.negative,
    "huge element": lambda array: with_first(np.finfo(array.dtype).max)(array),
    "offset 1e6": shifted(1e6),
    "offset 1e12": shifted(1e12),
    "scale 1e-30": scaled(1e-30),
    "scale 1e-9": scaled(1e-9),
    "scale 1e9": scaled(1e9),
    "scale 1e30": scaled(1e30),
}

INTEGERS: dict[str, Spoil] = {
    "below range": lambda array: with_first(-1 if array.dtype.kind == "i" else 0)(array),
    "above range": lambda array: with_first(np.iinfo(array.dtype).max)(array),
    "as floats": lambda array: array.astype(np.float64) + 0.5,
}

KINDS = {"f": FLOATS, "i": INTEGERS, "u": INTEGERS}


@dataclass(frozen=True)
class Case:
    """One array of one asset spoilt: `field` names it ("" if the asset is the array itself)."""

    field: str
    name: str
    spoil: Spoil
    position: int = 0

    def __str__(self) -> str:
        return f"{self.field or 'array'}: {self.name}"

    @property
    def keeps_values(self) -> bool:
        return self.name in ALIKE


def cases(asset: object, position: int = 0, but: Sequence[str] = ()) -> list[Case]:
    """List the cases of every array of `asset`, the stage's input at `position`.

    but : names of fields to leave alone. Raises ValueError if there is no array to spoil.
    """
    found: list[Case] = []
    for field, array in _arrays_of(asset):
        if field in but or array.size == 0:
            continue
        for name, spoil in {**ALIKE, **ANY, **KINDS.get(array.dtype.kind, {})}.items():
            found.append(Case(field, name, spoil, position))
    if not found:
        raise ValueError(f"{type(asset).__name__} has no array for the battery.")
    return found


def check(
    case: Case,
    stage: Callable[..., Any],
    assets: tuple[Any, ...],
    params: Any,
    folder: Path,
) -> BakelightError | None:
    """Run `stage` on the spoilt assets; return the typed error it ended in, or None.

    folder : an empty folder to save into. Raises AssertionError for everything else, and lets any
    other exception of the stage through, which fails the test with its traceback.
    """
    spoilt = list(assets)
    try:
        spoilt[case.position] = _spoilt(assets[case.position], case)
        before = [_digest(asset) for asset in spoilt]
        kind = stage(*spoilt, params=params, progress=lambda fraction: None)
        (folder / "spoilt").mkdir()
        kind.save(folder / "spoilt")
    except BakelightError as error:
        _require_good_refusal(case, str(error))
        return error
    assert [_digest(asset) for asset in spoilt] == before, "a stage changes no input"
    require_finite(kind)
    _require_finite_files(folder / "spoilt", type(kind))
    if case.keeps_values:
        (folder / "plain").mkdir()
        stage(*assets, params=params, progress=lambda fraction: None).save(folder / "plain")
        seal.seal(folder / "plain")
        assert files_of(folder / "spoilt") == files_of(folder / "plain"), "the same values"
    return None


def require_finite(value: object, where: str = "asset") -> None:
    """Assert that every number reachable through dataclasses, sequences and dicts is finite."""
    for place, number in numbers(value, where):
        assert np.isfinite(number).all(), f"{place} is not finite"


def files_of(folder: Path) -> dict[str, bytes]:
    """Read all files below `folder`, by relative name."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _require_good_refusal(case: Case, message: str) -> None:
    assert "\n" not in message, "an error is one line"
    assert " -- " in message, "an error has a remedy"
    assert not case.keeps_values, f"the values are as good as before: {message}"


def _require_finite_files(folder: Path, kind: Any) -> None:
    """Assert that what was saved is finite when it is read back, sealed as the store does."""
    seal.seal(folder)
    report = json.loads((folder / "report.json").read_bytes())
    require_finite(report, "report.json")
    if hasattr(kind, "load"):
        require_finite(kind.load(folder), "loaded asset")


def _spoilt(asset: Any, case: Case) -> Any:
    if not case.field:
        return case.spoil(asset)
    return dataclasses.replace(asset, **{case.field: case.spoil(getattr(asset, case.field))})


def _arrays_of(asset: Any) -> Iterator[tuple[str, Array]]:
    if isinstance(asset, np.ndarray):
        yield "", asset
    elif dataclasses.is_dataclass(asset):
        for field in dataclasses.fields(asset):
            value = getattr(asset, field.name)
            if isinstance(value, np.ndarray):
                yield field.name, value


def _digest(asset: Any) -> str:
    """Hash all arrays of an asset, however they are laid out."""
    digest = hashlib.sha256()
    for field, array in _arrays_of(asset):
        digest.update(f"{field} {array.dtype} {array.shape}".encode())
        digest.update(repr(array.tolist()).encode() if array.dtype == object else array.tobytes())
    return digest.hexdigest()
