"""Radiance pictures: hand-worked codes in all three packings, and the error of rounding."""

import os
from pathlib import Path

import numpy as np
import pytest

from formats.errors import InputError
from formats.files import rgbe

HEAD = b"#?RADIANCE\n# made by hand\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2.0\n\n"


def test_flat_pixels() -> None:
    # (128, 64, 0) * 2^(129 - 136) = (1, 0.5, 0); exponent 0 with mantissas 0 is black
    picture = rgbe.decode(HEAD + b"-Y 1 +X 2\n" + bytes([128, 64, 0, 129, 0, 0, 0, 0]), "a")
    np.testing.assert_array_equal(picture, [[[1.0, 0.5, 0.0], [0.0, 0.0, 0.0]]])


def test_old_runs() -> None:
    # One pixel, a run of 2, then two successive runs: 3 + (1 << 8) more
    codes = bytes([128, 64, 0, 129]) + bytes([1, 1, 1, 2])
    codes += bytes([8, 16, 32, 136]) + bytes([1, 1, 1, 3]) + bytes([1, 1, 1, 1])
    picture = rgbe.decode(HEAD + b"-Y 1 +X 263\n" + codes, "a")
    np.testing.assert_array_equal(picture[0, :3], [[1.0, 0.5, 0.0]] * 3)
    np.testing.assert_array_equal(picture[0, 3:], [[8.0, 16.0, 32.0]] * 260)


def test_new_runs() -> None:
    # Per channel: a run of 6 (128 + 6), then 2 single bytes
    planes = [bytes([134, v, 2, v, 0]) for v in (128, 64, 32)] + [bytes([136, 129])]
    row = bytes([2, 2, 0, 8]) + b"".join(planes)
    picture = rgbe.decode(HEAD + b"-Y 2 +X 8\n" + row * 2, "a")
    np.testing.assert_array_equal(picture[:, :7], np.broadcast_to([1.0, 0.5, 0.25], (2, 7, 3)))
    np.testing.assert_array_equal(picture[:, 7], np.zeros((2, 3)))


@pytest.mark.parametrize("width", [1, 7, 8, 9, 127, 128, 129, 300])
def test_error_is_that_of_rounding(width: int, tmp_path: Path, rng: np.random.Generator) -> None:
    picture = np.exp(rng.normal(0, 8, (4, width, 3)))
    picture[1] = picture[1, :1]  # a row of one run
    picture[2, ::2] = 0.0
    picture[3, width // 3 :] = 0.999999  # rounds up to the next power of two
    rgbe.write(tmp_path / "a.hdr", picture)
    back = rgbe.read(tmp_path / "a.hdr").astype(np.float64)
    # Half a mantissa step of 2^(e - 8) against a maximum of at least 255.5 / 256 * 2^(e - 1)
    assert np.all(np.abs(back - picture) <= picture.max(axis=2, keepdims=True) / 255)
    rgbe.write(tmp_path / "b.hdr", back)
    np.testing.assert_array_equal(rgbe.read(tmp_path / "b.hdr"), back)


def test_extremes(tmp_path: Path) -> None:
    values = np.array([rgbe.LARGEST, 2.0**126, 1.0, 2.0**-126, 2.0**-128, 2.0**-129, 0.0])
    rgbe.write(tmp_path / "a.hdr", np.repeat(values[None, :, None], 3, axis=2))
    # Exponent code 0 means black, so the smallest power of two is 128 * 2^(1 - 136) = 2^-128
    expected = np.where(values < 2.0**-128, 0.0, values)
    np.testing.assert_array_equal(rgbe.read(tmp_path / "a.hdr")[0, :, 2], expected)


def test_exponent_zero_is_black_whatever_the_mantissas() -> None:
    picture = rgbe.decode(HEAD + b"-Y 1 +X 1\n" + bytes([9, 8, 7, 0]), "a")
    np.testing.assert_array_equal(picture, np.zeros((1, 1, 3)))


@pytest.mark.parametrize(
    "data",
    [
        b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n\0\0\0\0",
        HEAD + b"+Y 1 +X 1\n\0\0\0\0",
        HEAD + b"-Y 0 +X 1\n\0\0\0\0",
        HEAD + b"-Y 1 +X 40000\n" + bytes(160000),
        HEAD + b"-Y 1 +X 2\n" + bytes([1, 1, 1, 1, 0, 0, 0, 0]),
        HEAD + b"-Y 1 +X 2\n" + bytes([9, 9, 9, 9, 1, 1, 1, 2]),
        HEAD + b"-Y 1 +X 8\n" + bytes([2, 2, 0, 9]) + bytes(64),
        HEAD + b"-Y 1 +X 8\n" + bytes([2, 2, 0, 8, 0]) + bytes(64),
        HEAD + b"-Y 1 +X 8\n" + bytes([2, 2, 0, 8, 137, 1]) + bytes(64),
        HEAD,
    ],
)
def test_broken_files_are_refused(data: bytes) -> None:
    with pytest.raises(InputError):
        rgbe.decode(data, "a.hdr")


@pytest.mark.parametrize("value", [-0.5, 2.0**127, np.nan])
def test_what_the_format_cannot_hold_is_refused(value: float, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        rgbe.write(tmp_path / "a.hdr", np.full((2, 2, 3), value))
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(
    "BAKELIGHT_DATA" not in os.environ, reason="BAKELIGHT_DATA is not set: real .hdr maps"
)
@pytest.mark.parametrize("name", ["grace", "uffizi", "wells"])
def test_real_maps_survive_a_round_trip(name: str, tmp_path: Path) -> None:
    path = Path(os.environ["BAKELIGHT_DATA"]) / "hdr" / "probulator" / f"{name}.hdr"
    picture = rgbe.read(path)
    assert picture.shape == (128, 256, 3)
    assert picture.max() > 1.0
    rgbe.write(tmp_path / "a.hdr", picture)
    np.testing.assert_array_equal(rgbe.read(tmp_path / "a.hdr"), picture)
