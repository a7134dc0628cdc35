"""KTX2: the layout by the letter of the specification, and files that other tools wrote."""

import math
import os
import struct
from pathlib import Path

import numpy as np
import pytest
import zstandard

from formats.errors import InputError
from formats.files import image, ktx2

HEADER = struct.Struct("<12s9I4I2Q")

needs_samples = pytest.mark.skipif(
    "BAKELIGHT_DATA" not in os.environ, reason="BAKELIGHT_DATA is not set: real KTX2 samples"
)


def _sample(name: str) -> Path:
    return Path(os.environ["BAKELIGHT_DATA"]) / "textures" / "ktx2" / name


def _chain(rng: np.random.Generator, size: tuple[int, int, int], volume: bool) -> tuple:
    """A full mip chain of random codes."""
    layers, height, width = size
    levels = []
    while True:
        levels.append(rng.integers(0, 256, (layers, height, width, 4), np.uint8))
        if max(height, width, layers if volume else 1) == 1:
            return tuple(levels)
        layers = max(1, layers // 2) if volume else layers
        height, width = max(1, height // 2), max(1, width // 2)


@pytest.mark.parametrize("compress", [True, False])
@pytest.mark.parametrize("half", [True, False])
@pytest.mark.parametrize(
    ("kind", "size"),
    [("array", (1, 13, 6)), ("array", (5, 4, 9)), ("volume", (6, 5, 3)), ("volume", (1, 2, 2))],
)
def test_textures_come_back_bit_for_bit(
    kind: str,
    size: tuple[int, int, int],
    half: bool,
    compress: bool,
    tmp_path: Path,
    rng: np.random.Generator,
) -> None:
    levels = _chain(rng, size, kind == "volume")
    if half:
        levels = tuple((level.astype(np.float16) - 100) / 8 for level in levels)
    path = tmp_path / "a.ktx2"
    ktx2.write(path, ktx2.Texture(levels, kind, {"note": "ä→b"}), compress=compress)
    back = ktx2.read(path)
    assert back.kind == kind
    assert back.metadata["note"] == "ä→b"
    assert len(back.levels) == len(levels)
    for old, new in zip(levels, back.levels, strict=True):
        assert new.dtype == old.dtype
        np.testing.assert_array_equal(new, old)


@pytest.mark.parametrize(
    ("kind", "layers", "counts"),
    [("array", 1, (0, 0)), ("array", 3, (0, 3)), ("volume", 1, (1, 0)), ("volume", 3, (3, 0))],
)
def test_header_says_2d_array_or_3d(kind: str, layers: int, counts: tuple[int, int]) -> None:
    data = ktx2.encode(ktx2.Texture((np.zeros((layers, 4, 8, 4), np.uint8),), kind))
    fields = HEADER.unpack_from(data)
    assert fields[:3] == (b"\xabKTX 20\xbb\r\n\x1a\n", 37, 1)
    assert fields[3:9] == (8, 4, *counts, 1, 1)  # width, height, depth, layers, faces, levels


@pytest.mark.parametrize("compress", [True, False])
def test_layout_follows_the_specification(compress: bool, rng: np.random.Generator) -> None:
    levels = tuple(level.astype(np.float16) for level in _chain(rng, (3, 5, 7), False))
    data = ktx2.encode(ktx2.Texture(levels), compress=compress)
    fields = HEADER.unpack_from(data)
    assert fields[1:3] == (97, 2)
    assert fields[9] == (2 if compress else 0)
    dfd_at, dfd_size, kvd_at, kvd_size, sgd_at, sgd_size = fields[10:]
    assert dfd_at == 80 + 24 * len(levels)
    assert struct.unpack_from("<I", data, dfd_at)[0] == dfd_size
    assert (kvd_at, kvd_size % 4, sgd_at, sgd_size) == (dfd_at + dfd_size, 0, 0, 0)

    # The smallest level comes first and nothing but alignment lies between them
    end = kvd_at + kvd_size
    for i in reversed(range(len(levels))):
        at, size, plain = struct.unpack_from("<3Q", data, 80 + 24 * i)
        assert plain == levels[i].nbytes
        assert at - end == (0 if compress else -end % 8)
        stored = data[at : at + size]
        raw = zstandard.ZstdDecompressor().decompress(stored) if compress else stored
        assert raw == levels[i].tobytes()
        end = at + size
    assert end == len(data)


def test_descriptor_of_half_floats() -> None:
    data = ktx2.encode(ktx2.Texture((np.zeros((1, 1, 1, 4), np.float16),)))
    at, size = HEADER.unpack_from(data)[10:12]
    words = struct.unpack_from("<23I", data, at)
    assert words[0] == size == 92
    assert words[1:3] == (0, 2 | 88 << 16)  # Khronos, basic; version 2 (KDF 1.3), 88 bytes
    assert words[3] == 1 | 1 << 8 | 1 << 16 | 1 << 24  # RGBSDA, BT.709, linear, premultiplied
    assert words[4:7] == (0, 8, 0)  # 1 x 1 x 1 texel of 8 bytes
    for i, channel in enumerate((0, 1, 2, 15)):
        first, position, lower, upper = words[7 + 4 * i : 11 + 4 * i]
        assert first == (16 * i) | 15 << 16 | (channel | 0xC0) << 24  # signed float of 16 bits
        assert position == 0
        assert struct.pack("<2I", lower, upper) == struct.pack("<2f", -1.0, 1.0)


def test_equal_textures_are_equal_bytes(rng: np.random.Generator) -> None:
    levels = _chain(rng, (2, 16, 16), False)
    first = ktx2.encode(ktx2.Texture(levels, metadata={"b": "1", "a": "2"}))
    second = ktx2.encode(ktx2.Texture(levels, metadata={"a": "2", "b": "1"}))
    assert first == second


@pytest.mark.parametrize("key", ["", "KTXorientatio", "ktxwriter", "a\0b"])
def test_reserved_metadata_is_refused(key: str) -> None:
    texture = ktx2.Texture((np.zeros((1, 1, 1, 4), np.uint8),), metadata={key: "x"})
    with pytest.raises(InputError):
        ktx2.encode(texture)


@pytest.mark.parametrize(
    "shapes",
    [
        [],
        [(1, 4, 4, 3)],
        [(4, 4, 4)],
        [(1, 4, 4, 4), (1, 4, 4, 4)],
        [(1, 4, 4, 4), (1, 2, 1, 4)],
        [(1, 1, 1, 4), (1, 1, 1, 4)],
        [(1, 20000, 1, 4)],
    ],
)
def test_wrong_levels_are_refused(shapes: list[tuple[int, ...]], tmp_path: Path) -> None:
    levels = tuple(np.zeros(shape, np.uint8) for shape in shapes)
    with pytest.raises(InputError):
        ktx2.write(tmp_path / "a.ktx2", ktx2.Texture(levels))
    assert not list(tmp_path.iterdir())


def test_a_frame_that_lies_about_its_size_is_refused_unread() -> None:
    data = ktx2.encode(ktx2.Texture((np.zeros((1, 8, 8, 4), np.uint8),)))
    at, size, _ = struct.unpack_from("<3Q", data, 80)
    bomb = zstandard.ZstdCompressor().compress(bytes(64 << 20))
    assert len(bomb) > size  # a longer tail needs only the index changed
    index = struct.pack("<3Q", at, len(bomb), 8 * 8 * 4)
    with pytest.raises(InputError, match="declares 67108864 bytes"):
        ktx2.decode(data[:80] + index + data[104:at] + bomb, "bomb")


def test_infinity_in_a_file_is_refused() -> None:
    data = ktx2.encode(ktx2.Texture((np.zeros((1, 1, 1, 4), np.float16),)), compress=False)
    with pytest.raises(InputError, match="not finite"):
        ktx2.decode(data[:-2] + b"\x00\x7c", "a")


@needs_samples
def test_volume_of_another_writer_holds_the_slices_it_was_made_from() -> None:
    volume = ktx2.read(_sample("3d_rgba8_linear.ktx2"))
    assert volume.kind == "volume"
    assert [level.shape for level in volume.levels] == [(8, 16, 16, 4)]
    for z in range(8):
        linear = image.read(_sample(f"slice{z + 1:02d}.png")) * 255.0
        # Codes are rounded linear values: half a code
        assert np.abs(volume.levels[0][z, :, :, :3] - linear).max() <= 0.5
        assert np.all(volume.levels[0][z, :, :, 3] == 255)


@needs_samples
def test_our_descriptor_equals_that_of_libktx() -> None:
    theirs = _sample("3d_rgba8_linear.ktx2").read_bytes()
    ours = ktx2.encode(ktx2.decode(theirs, "theirs"), compress=False)
    at, size = HEADER.unpack_from(theirs)[10:12]
    here, length = HEADER.unpack_from(ours)[10:12]
    expected = bytearray(theirs[at : at + size])
    expected[15] = 1  # we say premultiplied where libktx says straight
    assert ours[here : here + length] == expected
    level = struct.unpack_from("<2Q", theirs, 80)
    mine = struct.unpack_from("<2Q", ours, 80)
    assert ours[mine[0] :] == theirs[level[0] : level[0] + level[1]]


@pytest.mark.parametrize("compress", [True, False])
@pytest.mark.parametrize(
    ("kind", "size"),
    [("array", (1, 13, 6)), ("array", (3, 4, 9)), ("volume", (6, 5, 3)), ("volume", (1, 2, 2))],
)
def test_blocks_come_back_and_every_level_rounds_up(
    kind: str, size: tuple[int, int, int], compress: bool, rng: np.random.Generator
) -> None:
    layers, height, width = size
    halved = (max(layers // 2, 1) if kind == "volume" else layers, height // 2, width // 2)
    shapes = [(d, math.ceil(h / 4), math.ceil(w / 4), 8) for d, h, w in (size, halved)]
    levels = [rng.integers(0, 256, shape, np.uint8) for shape in shapes]
    texture = ktx2.Texture(tuple(levels), kind, extent=(width, height))
    data = ktx2.encode(texture, compress=compress)
    fields = HEADER.unpack_from(data)
    assert fields[1:3] == (133, 1)  # VK_FORMAT_BC1_RGBA_UNORM_BLOCK; no swaps within a block
    assert fields[3:5] == (width, height)
    back = ktx2.decode(data, "blocks")
    assert (back.kind, back.extent, back.size) == (kind, (width, height), size)
    assert back.format.name == "BC1"
    for i, (old, new) in enumerate(zip(levels, back.levels, strict=True)):
        np.testing.assert_array_equal(new, old)
        at, _, plain = struct.unpack_from("<3Q", data, 80 + 24 * i)
        assert plain == 8 * math.prod(old.shape[:3])
        assert compress or at % 8 == 0  # aligned to a block


def test_cells_are_plain_numbers(rng: np.random.Generator) -> None:
    cells = rng.integers(0, 65536, (5, 3, 7, 1), np.uint16)
    data = ktx2.encode(ktx2.Texture((cells,), "volume"))
    fields = HEADER.unpack_from(data)
    assert fields[1:3] == (74, 2)  # VK_FORMAT_R16_UINT
    assert fields[3:9] == (7, 3, 5, 0, 1, 1)
    np.testing.assert_array_equal(ktx2.decode(data, "cells").levels[0], cells)
    words = struct.unpack_from("<11I", data, fields[10])
    assert words[:3] == (44, 0, 2 | 40 << 16)
    assert words[3:7] == (1 | 1 << 8 | 1 << 16, 0, 2, 0)  # straight: there is no alpha
    assert words[7:] == (15 << 16, 0, 0, 1)  # red, unsigned integer: 0 to 1 counts by ones


def test_descriptor_of_blocks() -> None:
    data = ktx2.encode(ktx2.Texture((np.zeros((1, 1, 1, 8), np.uint8),), extent=(4, 4)))
    at, size = HEADER.unpack_from(data)[10:12]
    words = struct.unpack_from("<11I", data, at)
    assert words[0] == size == 44
    assert words[1:3] == (0, 2 | 40 << 16)
    assert words[3] == 128 | 1 << 8 | 1 << 16 | 1 << 24  # BC1A, BT.709, linear, premultiplied
    assert words[4:7] == (3 | 3 << 8, 8, 0)  # 4 x 4 x 1 texels in 8 bytes
    assert words[7:] == (63 << 16 | 1 << 24, 0, 0, 0xFFFFFFFF)  # 64 bits, with alpha


@pytest.mark.parametrize(
    ("levels", "extent"),
    [
        ((np.zeros((1, 2, 2, 8), np.uint8),), None),
        ((np.zeros((1, 2, 2, 8), np.uint8),), (9, 8)),
        ((np.zeros((1, 2, 2, 8), np.uint8),), (8, 4)),
        ((np.zeros((1, 2, 2, 8), np.uint8),), (0, 8)),
        ((np.zeros((1, 4, 4, 4), np.uint8),), (4, 4)),
        ((np.zeros((1, 2, 2, 8), np.uint8), np.zeros((1, 2, 2, 8), np.uint8)), (8, 8)),
        ((np.zeros((1, 4, 4, 2), np.uint16),), None),
    ],
)
def test_blocks_need_the_extent_that_they_cover(
    levels: tuple, extent: tuple[int, int] | None
) -> None:
    with pytest.raises(InputError):
        ktx2.encode(ktx2.Texture(levels, extent=extent))


@needs_samples
def test_our_block_descriptor_equals_that_of_libktx() -> None:
    theirs = _sample("2d_bc1.ktx2").read_bytes()
    ours = ktx2.encode(ktx2.Texture((np.zeros((1, 1, 1, 8), np.uint8),), extent=(4, 4)))
    at, size = HEADER.unpack_from(theirs)[10:12]
    here = HEADER.unpack_from(ours)[10]
    expected = bytearray(theirs[at : at + size])
    assert expected[14:16] == b"\2\0"
    assert expected[31] == 0
    # Theirs is sRGB, straight and without alpha
    expected[14], expected[15], expected[31] = 1, 1, 1
    assert ours[here : here + size] == expected


@needs_samples
@pytest.mark.parametrize(
    ("name", "code"), [("3d_rgba8.ktx2", 43), ("2d_bc1.ktx2", 132), ("2d_bc7.ktx2", 146)]
)
def test_other_formats_are_refused_by_number(name: str, code: int) -> None:
    with pytest.raises(InputError, match=f"vkFormat: {code}"):
        ktx2.read(_sample(name))
