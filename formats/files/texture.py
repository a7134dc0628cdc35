"""What texture files hold: mip levels of texels, or of BC1 blocks, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import prod
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError

Kind = Literal["array", "volume"]

MAX_EXTENT = 16384
"""Largest width, height, depth or number of layers."""
MAX_BYTES = 1 << 30
"""Largest sum of all decoded levels; also the largest file."""


class Format(NamedTuple):
    """How texels lie in memory. block : texels a side of what is stored as one. values : numbers of
    `dtype` in it."""

    name: str
    dtype: np.dtype[Any]
    values: int
    block: int

    @property
    def bytes(self) -> int:
        """Bytes of a texel or block."""
        return self.values * self.dtype.itemsize


RGBA8 = Format("RGBA8", np.dtype("u1"), 4, 1)
RGBA16F = Format("RGBA16F", np.dtype("<f2"), 4, 1)
R16UI = Format("R16UI", np.dtype("<u2"), 1, 1)
BC1 = Format("BC1", np.dtype("u1"), 8, 4)
FORMATS = (RGBA8, RGBA16F, R16UI, BC1)


@dataclass(frozen=True)
class Texture:
    """Mip levels from the largest down; level i + 1 has half the size of level i, rounded down.

    levels : each (layers or depth, height, width, n): n = 4 of uint8 (linear 0..255 for 0..1) or
    float16, n = 1 of uint16 (plain numbers), or n = 8 bytes of a BC1 block, where height and width
    count blocks of 4 x 4 texels. Arrays keep their number of layers, volumes halve their depth too;
    row 0 is the top of a picture and the bottom (-y) of a volume. extent : (width, height) of level
    0 in texels, for blocks, and None for all others. metadata : extra text keys of KTX2;
    `KTXorientation` and `KTXwriter` are filled in when absent. Arrays that a file was read into are
    read-only.
    """

    levels: tuple[NDArray[Any], ...]
    kind: Kind = "array"
    metadata: dict[str, str] = field(default_factory=dict)
    extent: tuple[int, int] | None = None

    @property
    def format(self) -> Format:
        """How the texels lie in memory; ValueError where they are of no known type."""
        first = self.levels[0]
        for each in FORMATS:
            if first.ndim == 4 and (first.dtype, first.shape[3]) == (each.dtype, each.values):
                return each
        raise ValueError(f"No texture holds {first.dtype} {first.shape}.")

    @property
    def size(self) -> tuple[int, int, int]:
        """(layers or depth, height, width) of level 0, in texels."""
        layers, height, width, _ = self.levels[0].shape
        width, height = self.extent or (width, height)
        return layers, height, width


def level_shape(
    form: Format, size: tuple[int, int, int], kind: str, level: int
) -> tuple[int, int, int, int]:
    """Return the shape of a level's array, from the (layers or depth, height, width) of level 0."""
    layers, height, width = size
    layers = max(1, layers >> level) if kind == "volume" else layers
    rows, columns = (-(-max(1, side >> level) // form.block) for side in (height, width))
    return layers, rows, columns, form.values


def finite_halves(values: NDArray[np.float16]) -> bool:
    """Whether all half floats are finite: an exponent of all ones is infinity or NaN."""
    return bool(np.all((values.view(np.uint16) & 0x7C00) != 0x7C00))


def check(name: object, texture: Texture) -> None:
    """Raise InputError for levels of wrong shape, type or size, or not finite; `name` the file."""
    if texture.kind not in ("array", "volume"):
        raise InputError(name, "kind", texture.kind, "use array or volume")
    if not texture.levels or not all(isinstance(level, np.ndarray) for level in texture.levels):
        raise InputError(name, "levels", type(texture.levels), "give a tuple of numpy arrays")
    first = texture.levels[0]
    try:
        form = texture.format
    except ValueError:
        remedy = "use (layers, height, width, 4) of uint8 or float16, 1 of uint16, 8 bytes of BC1"
        raise InputError(name, "levels", f"{first.dtype} {first.shape}", remedy) from None
    if (texture.extent is None) != (form.block == 1):
        remedy = "give the extent of blocks, and of nothing else"
        raise InputError(name, "extent", texture.extent, remedy)
    size = texture.size
    if not all(0 < side <= MAX_EXTENT for side in size):
        raise InputError(name, "levels", size, f"use sides of 1 to {MAX_EXTENT}")
    if len(texture.levels) > max(size[0 if texture.kind == "volume" else 1 :]).bit_length():
        raise InputError(name, "levels", len(texture.levels), "stop at the level of one texel")
    if sum(level.nbytes for level in texture.levels) > MAX_BYTES:
        raise InputError(name, "levels", "too large", f"use at most {MAX_BYTES} bytes")
    for i, level in enumerate(texture.levels):
        shape = level_shape(form, size, texture.kind, i)
        if level.shape != shape or level.dtype != first.dtype:
            remedy = f"halve each level: expected {shape} of {first.dtype}"
            raise InputError(name, f"levels[{i}]", f"{level.shape} {level.dtype}", remedy)
        check_finite(name, form, level, i)


def check_declared(
    name: object, form: Format, size: tuple[int, int, int], kind: Kind, count: int
) -> list[tuple[int, int, int, int]]:
    """Return the shapes of all levels that a header declares, before anything is allocated.

    Raises InputError for sides or sums beyond `MAX_EXTENT` and `MAX_BYTES`, and for more levels
    than end at one texel.
    """
    if not all(0 < side <= MAX_EXTENT for side in size):
        remedy = f"use a 2D or 3D texture of at most {MAX_EXTENT} a side"
        raise InputError(name, "size", size[::-1], remedy)
    if count > max(size[0 if kind == "volume" else 1 :]).bit_length():
        raise InputError(name, "levels", count, "use at most a full mip chain")
    shapes = [level_shape(form, size, kind, i) for i in range(count)]
    total = sum(prod(shape) for shape in shapes) * form.dtype.itemsize
    if total > MAX_BYTES:
        raise InputError(name, "decoded bytes", total, f"use at most {MAX_BYTES} bytes")
    return shapes


def check_finite(name: object, form: Format, level: NDArray[Any], number: int) -> None:
    """Raise InputError for half floats that are not finite."""
    if form is RGBA16F and not finite_halves(level):
        raise InputError(name, f"level {number}", "not finite", "replace NaN and infinity")
