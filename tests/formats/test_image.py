"""Pictures: no bit is lost on the way in, no code changes on the way through."""

import io
import struct
from pathlib import Path

import numpy as np
import png
import pytest
from PIL import Image

from formats.errors import InputError
from formats.files import image


def _iec_decode(codes: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, written out."""
    v = codes / 255.0
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def _save(path: Path, codes: np.ndarray, mode: str | None = None, **options: object) -> Path:
    picture = Image.fromarray(codes)
    (picture.convert(mode) if mode else picture).save(path, **options)
    return path


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("suffix", ["png", "tiff"])
def test_colour_is_decoded_and_alpha_is_not(channels: int, suffix: str, tmp_path: Path) -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1)
    codes = np.concatenate([codes, 255 - codes, codes // 2, codes[::-1]], axis=2)[..., :channels]
    path = _save(tmp_path / f"a.{suffix}", codes[..., 0] if channels == 1 else codes)
    stored = image.read(path, space="stored")
    linear = image.read(path)
    assert stored.dtype == linear.dtype == np.float32
    np.testing.assert_array_equal(stored, np.float32(codes / 255.0))
    alpha = channels in (2, 4)
    colours = channels - alpha
    # Rounding to float32 only
    expected = _iec_decode(codes[..., :colours])
    np.testing.assert_allclose(linear[..., :colours], expected, rtol=2.0**-23, atol=0)
    if alpha:
        np.testing.assert_array_equal(linear[..., -1], stored[..., -1])


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("interlace", [False, True])
def test_sixteen_bits_stay_sixteen(
    channels: int, interlace: bool, tmp_path: Path, rng: np.random.Generator
) -> None:
    codes = rng.integers(0, 65536, (9, 11, channels), np.uint16)
    writer = png.Writer(
        11, 9, bitdepth=16, greyscale=channels < 3, alpha=channels in (2, 4), interlace=interlace
    )
    with open(tmp_path / "a.png", "wb") as stream:
        writer.write_array(stream, codes.ravel().tolist())
    back = image.read(tmp_path / "a.png", space="stored")
    np.testing.assert_array_equal(np.rint(back * 65535.0), codes)


def test_sixteen_bits_with_every_filter(tmp_path: Path, rng: np.random.Generator) -> None:
    """Smooth pictures make encoders choose Sub, Up, Average and Paeth rows."""
    ramp = np.linspace(0, 65535, 64 * 48).astype(np.uint16).reshape(48, 64)
    Image.fromarray(ramp).save(tmp_path / "a.png", optimize=True)
    assert (tmp_path / "a.png").read_bytes()[24] == 16
    back = image.read(tmp_path / "a.png", space="stored")
    np.testing.assert_array_equal(np.rint(back[..., 0] * 65535.0), ramp)


def test_sixteen_bit_grey_tiff(tmp_path: Path, rng: np.random.Generator) -> None:
    codes = rng.integers(0, 65536, (4, 5), np.uint16)
    back = image.read(_save(tmp_path / "a.tiff", codes), space="stored")
    np.testing.assert_array_equal(np.rint(back[..., 0] * 65535.0), codes)


def _deep_colour_tiff() -> bytes:
    """One pixel of 16-bit RGB, which Pillow opens as 8-bit RGB."""
    tags = [(256, 3, 1, 1), (257, 3, 1, 1), (258, 3, 3, 200), (259, 3, 1, 1), (262, 3, 1, 2)]
    tags += [(273, 4, 1, 206), (277, 3, 1, 3), (278, 3, 1, 1), (279, 4, 1, 6)]
    entries = b"".join(struct.pack("<HHII", *tag) for tag in tags)
    head = b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4)
    return head.ljust(200, b"\0") + struct.pack("<6H", 16, 16, 16, 1, 256, 65535)


def test_deep_colour_tiff_is_refused_not_cut(tmp_path: Path) -> None:
    (tmp_path / "a.tiff").write_bytes(_deep_colour_tiff())
    with Image.open(tmp_path / "a.tiff") as trusting:
        assert trusting.mode == "RGB"
    with pytest.raises(InputError, match="16 bits"):
        image.read(tmp_path / "a.tiff")


def test_palettes_and_colour_keys_become_colours(tmp_path: Path) -> None:
    codes = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 0]]], np.uint8)
    path = _save(tmp_path / "p.png", codes, "P")
    np.testing.assert_array_equal(image.read(path), codes / 255.0)
    picture = Image.fromarray(codes)
    picture.save(tmp_path / "k.png", transparency=(0, 255, 0))
    keyed = image.read(tmp_path / "k.png")
    assert keyed.shape == (2, 2, 4)
    np.testing.assert_array_equal(keyed[..., 3], [[1, 0], [1, 1]])
    Image.fromarray(codes[..., 0] > 0).save(tmp_path / "b.png")
    np.testing.assert_array_equal(image.read(tmp_path / "b.png")[..., 0], codes[..., 0] > 0)


@pytest.mark.parametrize(("suffix", "options"), [("jpg", {"quality": 95}), ("webp", {})])
def test_lossy_pictures_come_close(suffix: str, options: dict, tmp_path: Path) -> None:
    ramp = np.linspace(0, 255, 64).astype(np.uint8)
    codes = np.broadcast_to(ramp[None, :, None], (64, 64, 3)).copy()
    back = image.read(_save(tmp_path / f"a.{suffix}", codes, **options), space="stored") * 255.0
    # Measured 1 (JPEG) and 2 (WebP) codes at worst on this ramp: twice that
    assert np.abs(back - codes).max() <= 4.0


def test_photographs_are_turned_upright(tmp_path: Path) -> None:
    codes = np.zeros((8, 16, 3), np.uint8)
    codes[:, :8] = 255
    tag = Image.Exif()
    tag[0x0112] = 6  # the camera was turned: show it a quarter clockwise
    path = _save(tmp_path / "a.jpg", codes, exif=tag, quality=95)
    back = image.read(path)
    assert back.shape == (16, 8, 3)
    assert back[:7].min() > 0.9
    assert back[9:].max() < 0.1


@pytest.mark.parametrize(("mode", "suffix"), [("CMYK", "jpg"), ("F", "tiff"), ("LAB", "tiff")])
def test_other_colour_spaces_are_refused(mode: str, suffix: str, tmp_path: Path) -> None:
    Image.new(mode, (4, 4)).save(tmp_path / f"a.{suffix}")
    with pytest.raises(InputError, match=mode):
        image.read(tmp_path / f"a.{suffix}")


@pytest.mark.parametrize("suffix", ["gif", "bmp", "ppm", "ico", "tga"])
def test_only_four_parsers_may_try(suffix: str, tmp_path: Path) -> None:
    path = _save(tmp_path / f"a.{suffix}", np.zeros((16, 16, 3), np.uint8))
    with pytest.raises(InputError):
        image.read(path)


@pytest.mark.parametrize("side", [8193, 12000, 20000])
def test_bombs_are_refused_by_their_header(side: int, tmp_path: Path) -> None:
    """Over our cap; over the size at which Pillow warns; over the size at which it raises."""
    stream = io.BytesIO()
    Image.new("1", (side, side)).save(stream, "PNG", compress_level=1)
    (tmp_path / "a.png").write_bytes(stream.getvalue())
    with pytest.raises(InputError, match=r"size: .*use at most 67108864 pixels"):
        image.read(tmp_path / "a.png")


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_every_code_survives_reading_and_writing(channels: int, tmp_path: Path) -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(channels, axis=2)
    image.write(tmp_path / "a.png", codes)
    np.testing.assert_array_equal(
        np.rint(image.read(tmp_path / "a.png", space="stored") * 255.0), codes
    )
    image.write(tmp_path / "b.png", image.read(tmp_path / "a.png"))
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "a.png").read_bytes()


def test_written_floats_are_clipped(tmp_path: Path) -> None:
    image.write(tmp_path / "a.png", np.array([[[-1.0, 0.0, 1e30, 0.5]]]))
    back = np.rint(image.read(tmp_path / "a.png", space="stored") * 255.0)
    np.testing.assert_array_equal(back, [[[0, 0, 255, 128]]])


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.exr"])
def test_other_names_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="png"):
        image.write(tmp_path / name, np.zeros((2, 2, 3)))


def test_unknown_space_is_refused(tmp_path: Path) -> None:
    path = _save(tmp_path / "a.png", np.zeros((2, 2, 3), np.uint8))
    with pytest.raises(InputError, match="space"):
        image.read(path, space="srgb")
