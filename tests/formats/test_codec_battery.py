"""What every codec owes: whatever the bytes, the right thing or one typed error."""

import io
import tracemalloc
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import png
import pytest
from PIL import Image

from formats.environment import Environment
from formats.errors import InputError
from formats.files import dds, exr, glb, image, ktx2, rgbe
from maths import bc1

FLIPS = 150  # damaged copies a codec; each takes 1 to 5 ms


@dataclass(frozen=True)
class Codec:
    """suffix of its files; write(path, pixels (8, 16, 4) float32 in 0..1); read and look at it."""

    suffix: str
    write: Callable[[Path, np.ndarray], Any]
    read: Callable[[Path], Any]
    sound: Callable[[Any], bool]


def _picture(result: Any) -> bool:
    array = np.asarray(result)
    return array.ndim == 3 and array.dtype == np.float32 and bool(np.isfinite(array).all())


def _levels(texture: ktx2.Texture) -> bool:
    return all(level.shape[3] == texture.format.values for level in texture.levels)


def _nodes(nodes: list[glb.Node]) -> bool:
    return all(p.indices.max() < len(p.positions) for n in nodes for p in n.primitives)


def _write_ktx2(path: Path, pixels: np.ndarray, compress: bool) -> None:
    half = pixels.astype(np.float16)[None]
    ktx2.write(path, ktx2.Texture((half, half[:, ::2, ::2])), compress=compress)


def _blocks(pixels: np.ndarray) -> ktx2.Texture:
    codes = np.rint(pixels * 255).astype(np.uint8)
    levels = tuple(bc1.encode_image(level[None]) for level in (codes, codes[::2, ::2]))
    return ktx2.Texture(levels, extent=(16, 8))


def _cells(pixels: np.ndarray) -> ktx2.Texture:
    numbers = np.rint(pixels * 65535).astype(np.uint16)
    return ktx2.Texture((np.moveaxis(numbers, 2, 0)[..., None],), "volume")


def _codes(pixels: np.ndarray) -> dds.Texture:
    return dds.Texture((np.rint(pixels * 255).astype(np.uint8)[None],))


def _write_glb(path: Path, pixels: np.ndarray) -> None:
    positions = pixels.reshape(-1, 4)[:, :3]
    triangles = np.arange(len(positions) - len(positions) % 3).reshape(-1, 3)
    colours = np.full((len(positions), 3), 0.5)
    glb.write(path, [glb.Node("a", (glb.Primitive(positions, triangles, colours=colours),))])


def _write_deep(path: Path, pixels: np.ndarray) -> None:
    codes = np.rint(pixels * 65535).astype(np.uint16)
    writer = png.Writer(16, 8, bitdepth=16, greyscale=False, alpha=True)
    with open(path, "wb") as stream:
        writer.write(stream, codes.reshape(8, -1).tolist())


def _write_pillow(path: Path, pixels: np.ndarray) -> None:
    Image.fromarray(np.rint(pixels[..., :3] * 255).astype(np.uint8)).save(path)


CODECS = {
    "ktx2_zstd": Codec(".ktx2", lambda p, x: _write_ktx2(p, x, True), ktx2.read, _levels),
    "ktx2_plain": Codec(".ktx2", lambda p, x: _write_ktx2(p, x, False), ktx2.read, _levels),
    "ktx2_blocks": Codec(".ktx2", lambda p, x: ktx2.write(p, _blocks(x)), ktx2.read, _levels),
    "ktx2_cells": Codec(".ktx2", lambda p, x: ktx2.write(p, _cells(x)), ktx2.read, _levels),
    "dds": Codec(".dds", lambda p, x: dds.write(p, _codes(x)), dds.read, _levels),
    "dds_blocks": Codec(
        ".dds", lambda p, x: dds.write(p, _blocks(x), header="fourcc"), dds.read, _levels
    ),
    "exr_zip": Codec(
        ".exr",
        lambda p, x: exr.write(p, {"a": x, "b": x[..., :1]}),
        exr.read,
        lambda r: all(map(_picture, r.values())),
    ),
    "exr_plain": Codec(
        ".exr",
        lambda p, x: exr.write(p, {"a": x}, compression="none"),
        exr.read,
        lambda r: all(map(_picture, r.values())),
    ),
    "rgbe": Codec(".hdr", lambda p, x: rgbe.write(p, x[..., :3]), rgbe.read, _picture),
    "glb": Codec(".glb", _write_glb, glb.read, _nodes),
    "png": Codec(".png", lambda p, x: image.write(p, x), image.read, _picture),
    "png_deep": Codec(".png", _write_deep, image.read, _picture),
    "jpeg": Codec(".jpg", _write_pillow, image.read, _picture),
    "webp": Codec(".webp", _write_pillow, image.read, _picture),
    "tiff": Codec(".tiff", _write_pillow, image.read, _picture),
}


@pytest.fixture(params=CODECS, ids=str)
def codec(request: pytest.FixtureRequest) -> Codec:
    return CODECS[request.param]


@pytest.fixture
def sample(codec: Codec, tmp_path: Path, rng: np.random.Generator) -> bytes:
    """Bytes of a sound file."""
    path = tmp_path / f"sound{codec.suffix}"
    codec.write(path, rng.random((8, 16, 4), np.float32))
    assert codec.sound(codec.read(path))
    return path.read_bytes()


def _noticed(codec: Codec, path: Path, data: bytes) -> bool:
    """Whether damage was noticed; all but InputError or a sound result fails the test."""
    path.write_bytes(data)
    refusal = None
    try:
        result = codec.read(path)
    except InputError as error:
        refusal = error
    if refusal is None:
        assert codec.sound(result)
        return False
    assert str(path) in str(refusal)
    assert refusal.remedy
    return True


def test_no_file_no_folder_no_bytes(codec: Codec, tmp_path: Path) -> None:
    empty = tmp_path / f"empty{codec.suffix}"
    empty.touch()
    for path in (tmp_path / f"missing{codec.suffix}", tmp_path, empty, tmp_path / "a\0b"):
        with pytest.raises(InputError):
            codec.read(path)


def test_other_bytes_are_refused(codec: Codec, tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / f"other{codec.suffix}"
    for data in (b"\0", b"\0" * 4096, rng.bytes(4096), b"P6 1 1 255 abc", b"GIF89a" + bytes(64)):
        assert _noticed(codec, path, data)


@pytest.mark.filterwarnings("ignore")
def test_truncated_files_are_refused(codec: Codec, sample: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"cut{codec.suffix}"
    for length in sorted({1, 4, 8, 12, 20, 40, 80, *range(16, len(sample) * 3 // 4, 37)}):
        assert _noticed(codec, path, sample[:length]), (
            f"{length} of {len(sample)} bytes went through"
        )


def test_flipped_bytes_give_a_typed_error_or_a_sound_result(
    codec: Codec, sample: bytes, tmp_path: Path, rng: np.random.Generator
) -> None:
    path = tmp_path / f"flipped{codec.suffix}"
    for _ in range(FLIPS):
        data = bytearray(sample)
        # Half of the damage goes to the first 200 bytes, where the sizes are
        reach = len(data) if rng.random() < 0.5 else min(200, len(data))
        for _ in range(int(rng.integers(1, 4))):
            data[int(rng.integers(reach))] = int(rng.integers(256))
        _noticed(codec, path, bytes(data))


@pytest.mark.parametrize("name", ["png", "png_deep"])
def test_png_damage_behind_valid_checksums(
    name: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Without repaired CRCs nearly all damage stops at the CRC and tests nothing behind it."""
    codec = CODECS[name]
    path = tmp_path / "sound.png"
    codec.write(path, rng.random((8, 16, 4), np.float32))
    chunks = list(png.Reader(bytes=path.read_bytes()).chunks())
    for _ in range(FLIPS):
        changed = [(kind, bytearray(body)) for kind, body in chunks]
        body = changed[int(rng.integers(len(changed)))][1]
        if body:
            body[int(rng.integers(len(body)))] = int(rng.integers(256))
        stream = io.BytesIO()
        png.write_chunks(stream, [(kind, bytes(body)) for kind, body in changed])
        _noticed(codec, path, stream.getvalue())


def _allocated(read: Callable[[], Any]) -> int:
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            read()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def _patched(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]


HUGE = (60000).to_bytes(4, "little")


def _huge_png(data: bytes) -> bytes:
    head = data[12:16] + (60000).to_bytes(4, "big") * 2 + data[24:29]
    return data[:12] + head + zlib.crc32(head).to_bytes(4, "big") + data[33:]


def _huge_exr(data: bytes) -> bytes:
    marker = b"dataWindow\0box2i\0\x10\0\0\0"
    return _patched(data, data.index(marker) + len(marker) + 8, HUGE * 2)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("ktx2_zstd", lambda d: _patched(d, 20, HUGE * 2)),
        ("ktx2_zstd", lambda d: _patched(d, 20, (16384).to_bytes(4, "little") * 2)),
        ("dds", lambda d: _patched(d, 12, HUGE * 2)),
        ("dds_blocks", lambda d: _patched(d, 12, (16384).to_bytes(4, "little") * 2)),
        ("exr_zip", _huge_exr),
        ("rgbe", lambda d: d.replace(b"-Y 8 +X 16", b"-Y 30000 +X 30000")),
        ("rgbe", lambda d: d.replace(b"-Y 8 +X 16", b"-Y 9999 +X 9999")),
        ("glb", lambda d: d.replace(b'"count":128', b'"count":9e9')),
        ("png", _huge_png),
        ("png_deep", _huge_png),
    ],
)
def test_huge_sizes_are_refused_before_anything_is_allocated(
    name: str, change: Callable[[bytes], bytes], tmp_path: Path, rng: np.random.Generator
) -> None:
    codec = CODECS[name]
    path = tmp_path / f"huge{codec.suffix}"
    codec.write(path, rng.random((8, 16, 4), np.float32))
    data = change(path.read_bytes())
    assert data != path.read_bytes()
    path.write_bytes(data)
    # The files are under 10 kB and declare 400 MB or more; a parser needs well under 4 MB
    assert _allocated(lambda: codec.read(path)) < 4 << 20


WRITERS = ["ktx2_zstd", "exr_zip", "rgbe", "glb", "png"]


@pytest.mark.parametrize("name", WRITERS)
def test_memory_layout_does_not_change_a_byte(
    name: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    codec = CODECS[name]
    pixels = rng.random((8, 16, 4), np.float32)
    read_only = pixels.copy()
    read_only.flags.writeable = False
    wide = np.zeros((16, 32, 8), np.float32)
    wide[::2, ::2, ::2] = pixels
    layouts = [
        pixels,
        read_only,
        np.asfortranarray(pixels),
        wide[::2, ::2, ::2],
        pixels[::-1].copy()[::-1],
        pixels.astype(">f4"),
    ]
    written = []
    for i, layout in enumerate(layouts):
        path = tmp_path / f"{i}{codec.suffix}"
        codec.write(path, layout)
        written.append(path.read_bytes())
    assert len(set(written)) == 1


@pytest.mark.parametrize("name", WRITERS)
def test_values_that_are_not_finite_are_refused(name: str, tmp_path: Path) -> None:
    codec = CODECS[name]
    path = tmp_path / f"out{codec.suffix}"
    path.write_bytes(b"older")
    for value in (np.nan, np.inf, -np.inf):
        pixels = np.full((8, 16, 4), 0.5, np.float32)
        pixels[3, 5, 1] = value
        with pytest.raises(InputError):
            codec.write(path, pixels)
        assert path.read_bytes() == b"older"
        assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize(
    "write",
    [
        lambda p, x: ktx2.write(p, ktx2.Texture((x,))),
        lambda p, x: dds.write(p, dds.Texture((x,))),
        lambda p, x: exr.write(p, {"a": x}),
        lambda p, x: rgbe.write(p, x),
        lambda p, x: image.write(p / "a.png", x),
        lambda p, x: glb.write(p, [glb.Node("a", (glb.Primitive(x, np.zeros((1, 3), int)),))]),
        lambda p, x: Environment(x).save(p),
    ],
    ids=["ktx2", "dds", "exr", "rgbe", "image", "glb", "environment"],
)
@pytest.mark.parametrize(
    "values",
    [
        np.zeros((0, 4, 3), np.float32),
        np.zeros((4, 4, 5), np.float32),
        np.zeros((4, 4, 3), np.complex64),
        np.zeros((4, 4, 3), "U1"),
        np.full((4, 4, 3), None, object),
        np.float32(np.nan),
    ],
    ids=["empty", "channels", "complex", "text", "object", "scalar"],
)
def test_wrong_shapes_and_types_are_refused(
    write: Callable[[Path, np.ndarray], Any], values: np.ndarray, tmp_path: Path
) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(InputError):
        write(folder, values)
    assert not list(folder.iterdir())
