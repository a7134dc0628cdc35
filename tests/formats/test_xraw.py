"""XRAW files: bytes laid out by hand, and damage."""

import struct

import numpy as np
import pytest

from formats.errors import InputError
from formats.files import xraw


def header(
    size: tuple[int, int, int],
    *,
    kind: int = 0,
    channels: int = 4,
    bits: int = 8,
    index: int = 8,
    count: int = 256,
) -> bytes:
    return struct.pack("<4s4B4I", b"XRAW", kind, channels, bits, index, *size, count)


def test_indices_of_8_bits(rng: np.random.Generator) -> None:
    cells = rng.integers(0, 256, (4, 3, 2)).astype(np.uint8)
    palette = rng.integers(0, 256, (256, 4)).astype(np.uint8)
    file = xraw.decode(header((2, 3, 4)) + cells.tobytes() + palette.tobytes(), "a")
    assert np.array_equal(file.cells, cells)
    assert np.array_equal(file.palette, palette)
    assert file.cells.dtype == np.uint16


def test_indices_of_16_bits() -> None:
    """Empty is the largest index, and 0 is a colour."""
    cells = np.array([[[0, 0xFFFF, 2]]], "<u2")
    palette = np.arange(9, dtype=np.uint8).reshape(3, 3)
    data = header((3, 1, 1), channels=3, index=16, count=3) + cells.tobytes() + palette.tobytes()
    file = xraw.decode(data, "a")
    assert file.cells.tolist() == [[[1, 0, 3]]]
    assert file.palette[[1, 3]].tolist() == [[0, 1, 2, 255], [6, 7, 8, 255]]


def test_colours_in_place() -> None:
    cells = np.array([[[[1, 2, 3, 255], [9, 9, 9, 0], [4, 5, 6, 128], [1, 2, 3, 255]]]], np.uint8)
    file = xraw.decode(header((4, 1, 1), index=0, count=0) + cells.tobytes(), "a")
    assert file.cells[0, 0, 1] == 0
    assert (file.cells > 0).tolist() == [[[True, False, True, True]]]
    shown = file.palette[file.cells]
    assert np.array_equal(shown[0, 0, [0, 2, 3]], cells[0, 0, [0, 2, 3]])


REFUSED = {
    "nothing": b"XRAW",
    "another format": b"XRAX" + header((1, 1, 1))[4:] + bytes(2000),
    "floats": header((1, 1, 1), kind=2, bits=32) + bytes(5000),
    "grey": header((1, 1, 1), channels=1) + bytes(2000),
    "indices of 24 bits": header((1, 1, 1), index=24) + bytes(2000),
    "no width": header((0, 1, 1)) + bytes(2000),
    "a side of 513": header((1, 1, 513)) + bytes(5000),
    "a side of 4 billion": header((1, 2**32 - 1, 1)) + bytes(5000),
    "cells cut off": header((9, 9, 9), count=0) + bytes(728),
    "palette cut off": header((1, 1, 1)) + bytes(1024),
    "4 billion colours": header((1, 1, 1), count=2**32 - 1) + bytes(5000),
    "an index without a colour": header((1, 1, 1), count=7) + b"\7" + bytes(28),
    "an index without a palette": header((1, 1, 1), index=16, count=0) + bytes(2),
}


@pytest.mark.parametrize("name", REFUSED)
def test_damage_is_refused(name: str) -> None:
    with pytest.raises(InputError) as caught:
        xraw.decode(REFUSED[name], "a.xraw")
    assert str(caught.value).startswith("a.xraw: ")
    assert "\n" not in str(caught.value)


def test_every_cut_and_any_byte(rng: np.random.Generator) -> None:
    cells = rng.integers(0, 5, (3, 4, 5)).astype(np.uint8)
    data = header((5, 4, 3), count=5) + cells.tobytes() + bytes(20)
    for length in range(len(data)):
        with pytest.raises(InputError):
            xraw.decode(data[:length], "a")
    for at in range(len(data)):
        for value in rng.integers(0, 256, 3).tolist():
            spoilt = bytearray(data)
            spoilt[at] = value
            try:
                file = xraw.decode(bytes(spoilt), "a")
            except InputError:
                continue
            assert file.cells.max() < len(file.palette)
