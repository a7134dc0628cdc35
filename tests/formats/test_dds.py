"""DDS: the layout by the letter of the guide, other tools as judges, and a real volume."""

import io
import math
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from formats.errors import InputError
from formats.files import dds, image
from maths import bc1

WORDS = struct.Struct("<4s31I")
KINDS = [("array", (1, 13, 6)), ("volume", (6, 5, 3)), ("volume", (1, 4, 8))]

needs_samples = pytest.mark.skipif(
    "BAKELIGHT_DATA" not in os.environ, reason="BAKELIGHT_DATA is not set: a real DDS volume"
)


def _texture(
    rng: np.random.Generator, kind: Any, size: tuple[int, int, int], blocks: bool
) -> dds.Texture:
    """A full mip chain of random codes or blocks."""
    layers, height, width = size
    levels = []
    while True:
        side = (math.ceil(height / 4), math.ceil(width / 4), 8) if blocks else (height, width, 4)
        levels.append(rng.integers(0, 256, (layers, *side), np.uint8))
        if max(height, width, layers if kind == "volume" else 1) == 1:
            return dds.Texture(tuple(levels), kind, {}, size[:0:-1] if blocks else None)
        layers = max(1, layers // 2) if kind == "volume" else layers
        height, width = max(1, height // 2), max(1, width // 2)


def _same(back: dds.Texture, texture: dds.Texture) -> None:
    assert (back.kind, back.extent, back.size) == (texture.kind, texture.extent, texture.size)
    for old, new in zip(texture.levels, back.levels, strict=True):
        np.testing.assert_array_equal(new, old)
        assert not new.flags.writeable


@pytest.mark.parametrize("header", ["dx10", "fourcc"])
@pytest.mark.parametrize("blocks", [True, False])
@pytest.mark.parametrize(("kind", "size"), KINDS)
def test_textures_come_back_bit_for_bit(
    kind: str,
    size: tuple[int, int, int],
    blocks: bool,
    header: Any,
    tmp_path: Path,
    rng: np.random.Generator,
) -> None:
    texture, path = _texture(rng, kind, size, blocks), tmp_path / "a.dds"
    dds.write(path, texture, header=header)
    _same(dds.read(path), texture)


@pytest.mark.parametrize("blocks", [True, False])
def test_each_layer_of_an_array_has_all_its_levels(blocks: bool, rng: np.random.Generator) -> None:
    texture = _texture(rng, "array", (3, 8, 16), blocks)
    data = dds.encode(texture)
    _same(dds.decode(data, "array"), texture)
    first = b"".join(level[0].tobytes() for level in texture.levels)
    assert data[148 : 148 + len(first)] == first
    with pytest.raises(InputError, match="DX10"):
        dds.encode(texture, header="fourcc")


def test_header_of_a_volume_of_blocks(rng: np.random.Generator) -> None:
    data = dds.encode(_texture(rng, "volume", (5, 6, 9), True))
    words = WORDS.unpack_from(data)
    assert words[:2] == (b"DDS ", 124)
    # Caps, height, width, pixel format, mip count, linear size, depth
    assert words[2] == 0x1 | 0x2 | 0x4 | 0x1000 | 0x20000 | 0x80000 | 0x800000
    assert words[3:8] == (6, 9, 2 * 3 * 8, 5, 4)
    assert words[19:22] == (32, 4, int.from_bytes(b"DX10", "little"))
    assert words[27:29] == (0x1000 | 0x8 | 0x400000, 0x200000)  # texture, complex, mips; volume
    assert struct.unpack_from("<5I", data, 128) == (71, 4, 0, 1, 2)  # BC1_UNORM, 3D, premultiplied
    # All slices of a level lie together: 5 of 6 blocks, 2 of 1, then 1 of 1 twice
    assert len(data) == 148 + 8 * (5 * 6 + 2 * 1 + 1 + 1)


def test_old_header_of_plain_texels(rng: np.random.Generator) -> None:
    data = dds.encode(_texture(rng, "array", (1, 1, 1), False), header="fourcc")
    words = WORDS.unpack_from(data)
    assert words[2:8] == (0x1 | 0x2 | 0x4 | 0x8 | 0x1000, 1, 1, 4, 0, 1)
    assert words[19:27] == (32, 0x41, 0, 32, 0xFF, 0xFF00, 0xFF0000, 0xFF000000)
    assert words[27:29] == (0x1000, 0)


@pytest.mark.parametrize("header", ["dx10", "fourcc"])
def test_pillow_reads_what_we_write(header: Any, rng: np.random.Generator) -> None:
    codes = rng.integers(0, 256, (1, 12, 20, 4), np.uint8)
    codes[..., 3] = np.where(codes[..., 3] < 64, 0, 255)
    codes[codes[..., 3] == 0] = 0
    if header == "fourcc":  # which Pillow does not read as DX10 R8G8B8A8
        plain = Image.open(io.BytesIO(dds.encode(dds.Texture((codes,)), header=header)))
        np.testing.assert_array_equal(np.asarray(plain), codes[0])
    blocks = dds.Texture((bc1.encode_image(codes),), extent=(20, 12))
    theirs = np.asarray(Image.open(io.BytesIO(dds.encode(blocks, header=header))))
    ours = bc1.decode_image(blocks.levels[0], (20, 12))[0]
    np.testing.assert_array_equal(theirs[..., 3], ours[..., 3])
    # Interpolated codes are cut off there and rounded here: one code
    assert np.abs(theirs.astype(int) - ours).max() <= 1


def test_we_read_what_pillow_writes(tmp_path: Path, rng: np.random.Generator) -> None:
    picture = Image.fromarray(rng.integers(0, 256, (8, 12, 4), np.uint8))
    picture.save(tmp_path / "plain.dds")
    np.testing.assert_array_equal(
        dds.read(tmp_path / "plain.dds").levels[0][0], np.asarray(picture)
    )
    picture.save(tmp_path / "blocks.dds", pixel_format="DXT1")
    texture = dds.read(tmp_path / "blocks.dds")
    ours = bc1.decode_image(texture.levels[0], (12, 8))[0]
    theirs = np.asarray(Image.open(tmp_path / "blocks.dds"))
    assert np.abs(theirs.astype(int) - ours).max() <= 1


@pytest.mark.parametrize(
    ("at", "value", "field"),
    [
        (84, b"DXT5", "FourCC"),
        (84, b"ATI2", "FourCC"),
        (112, (0xFE00).to_bytes(4, "little"), "caps2"),
        (12, bytes(4), "size"),
        (16, (20000).to_bytes(4, "little"), "size"),
        (28, (9).to_bytes(4, "little"), "levels"),
        (4, bytes(4), "DDS texture"),
    ],
)
def test_what_is_not_read_is_named(
    at: int, value: bytes, field: str, rng: np.random.Generator
) -> None:
    data = bytearray(dds.encode(_texture(rng, "array", (1, 8, 8), True), header="fourcc"))
    data[at : at + len(value)] = value
    with pytest.raises(InputError, match=rf"^name\.dds: {field}.* -- "):
        dds.decode(bytes(data), "name.dds")


@pytest.mark.parametrize(
    ("at", "value", "field"),
    [
        (128, 72, "DXGI format"),
        (128, 29, "DXGI format"),
        (132, 2, "dimension"),
        (136, 4, "dimension"),
        (140, 2, "array size"),
    ],
)
def test_what_the_newer_header_declares_is_checked(
    at: int, value: int, field: str, rng: np.random.Generator
) -> None:
    data = bytearray(dds.encode(_texture(rng, "volume", (4, 8, 8), True)))
    data[at : at + 4] = value.to_bytes(4, "little")
    with pytest.raises(InputError, match=field):
        dds.decode(bytes(data), "a")


def test_other_formats_are_not_written() -> None:
    with pytest.raises(InputError, match="RGBA16F"):
        dds.encode(dds.Texture((np.zeros((1, 4, 4, 4), np.float16),)))
    with pytest.raises(InputError, match="header"):
        dds.encode(dds.Texture((np.zeros((1, 4, 4, 4), np.uint8),)), header="dx9")  # type: ignore[arg-type]


@needs_samples
def test_a_real_volume_reads_and_is_written_back_the_same() -> None:
    folder = Path(os.environ["BAKELIGHT_DATA"]) / "textures" / "dds"
    path = folder / "TestVolume_Noise3D BC1.dds"
    texture = dds.read(path)
    assert (texture.kind, texture.size, len(texture.levels)) == ("volume", (64, 64, 64), 7)
    data, back = path.read_bytes(), dds.encode(texture)
    assert [i for i in range(len(data)) if data[i] != back[i]] == [144]  # they say straight alpha
    shown = np.rint(255 * image.read(path.with_suffix(".png"), space="stored"))
    ours = bc1.decode_image(texture.levels[0], texture.extent)
    # Another decoder's picture of slice 0; its interpolants are rounded from exact 565 values
    np.testing.assert_array_equal(ours[0, ..., 3], shown[..., 3])
    assert np.abs(ours[0].astype(float) - shown).max() <= 1
