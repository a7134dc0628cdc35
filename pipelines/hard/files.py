"""Hard cases of files: every codec against damage of every kind, and scene files as text."""

from __future__ import annotations

import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from formats.errors import BakelightError
from formats.files import dds, exr, glb, image, ktx2, light_positions, rgbe, vox, vox_scene, xraw
from maths import bc1
from pipelines.hard.cells import Family, Result, all_of, equal, refused
from pipelines.hard.finite import not_finite

files = Family("files")


@dataclass(frozen=True)
class Codec:
    """suffix of its files. write(path) : a sound one. read(path) : must be safe on any bytes.
    checked : damage is always noticed. header : bytes after the magic that say sizes."""

    suffix: str
    write: Callable[[Path], object]
    read: Callable[[Path], Any]
    sizes: slice


def _pixels() -> Any:
    y, x = np.mgrid[0:16, 0:16]
    parts = [x / 16, y / 16, (x * y % 5) / 5, 1 - x / 16]
    return np.stack(parts, -1).astype(np.float32)


def _codes() -> Any:
    return np.rint(_pixels() * 255).astype(np.uint8)


def _ktx2(path: Path) -> None:
    ktx2.write(path, ktx2.Texture((_codes()[None],)), compress=False)


def _zstd(path: Path) -> None:
    half = _pixels().astype(np.float16)[None]
    ktx2.write(path, ktx2.Texture((half, half[:, ::2, ::2])))


def _dds(path: Path) -> None:
    blocks = (bc1.encode_image(_codes()[None]),)
    dds.write(path, dds.Texture(blocks, extent=(16, 16)), header="fourcc")


def _glb(path: Path) -> None:
    part = glb.Primitive(_pixels().reshape(-1, 4)[:, :3], np.arange(255).reshape(-1, 3))
    glb.write(path, [glb.Node("a", (part,))])


def _vox(path: Path) -> None:
    cells = struct.pack("<i", 3) + bytes([0, 0, 0, 1, 1, 0, 0, 2, 0, 1, 1, 3])
    chunks = b"SIZE" + struct.pack("<ii", 12, 0) + struct.pack("<iii", 2, 2, 2)
    chunks += b"XYZI" + struct.pack("<ii", len(cells), 0) + cells
    chunks += b"RGBA" + struct.pack("<ii", 1024, 0) + bytes(range(256)) * 4
    main = b"MAIN" + struct.pack("<ii", 0, len(chunks))
    path.write_bytes(b"VOX " + struct.pack("<i", 150) + main + chunks)


def _xraw(path: Path) -> None:
    head = b"XRAW" + bytes([0, 4, 8, 8]) + struct.pack("<4I", 2, 2, 2, 256)
    path.write_bytes(head + bytes([0, 1, 2, 3, 0, 0, 1, 1]) + bytes(range(256)) * 4)


def _obj(path: Path) -> None:
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    path.write_text(corners + "f 1 2 4 3\nf 5 6 8\nf -1 -2 -3\n")


def _ply(path: Path) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    head += "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_text(head + "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 2 3\n")


def _lp(path: Path) -> None:
    image.write(path.parent / "p.png", _codes())
    path.write_text("2\np.png 0.1 0.2 0.9\np.png 0.2 0.2 0.9\n")


def _mesh(path: Path) -> Any:
    from bake import sources

    return sources.load(path)


CODECS = {
    "ktx2": Codec(".ktx2", _ktx2, ktx2.read, slice(20, 44)),
    "ktx2, zstd": Codec(".ktx2", _zstd, ktx2.read, slice(20, 44)),
    "dds": Codec(".dds", _dds, dds.read, slice(8, 32)),
    "exr": Codec(".exr", lambda p: exr.write(p, {"a": _pixels()}), exr.read, slice(8, 200)),
    "hdr": Codec(".hdr", lambda p: rgbe.write(p, _pixels()[..., :3]), rgbe.read, slice(30, 60)),
    "png": Codec(".png", lambda p: image.write(p, _codes()), image.read, slice(16, 24)),
    "glb": Codec(".glb", _glb, glb.read, slice(8, 20)),
    "mesh .glb": Codec(".glb", _glb, _mesh, slice(8, 20)),
    "mesh .obj": Codec(".obj", _obj, _mesh, slice(0, 20)),
    "mesh .ply": Codec(".ply", _ply, _mesh, slice(30, 60)),
    "vox": Codec(".vox", _vox, lambda p: vox_scene.flatten(vox.read(p)), slice(32, 48)),
    "xraw": Codec(".xraw", _xraw, xraw.read, slice(8, 24)),
    "lp": Codec(".lp", _lp, light_positions.read, slice(0, 2)),
}


@lru_cache
def sound(name: str) -> bytes:
    """Return the bytes of a sound file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"sound{CODECS[name].suffix}"
        CODECS[name].write(path)
        CODECS[name].read(path)
        return path.read_bytes()


def tried(name: str, data: bytes | None) -> tuple[Path, Any]:
    """Read bytes (None: no file) as a file of a codec; returns its path and the result or error."""
    codec = CODECS[name]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"file{codec.suffix}"
        if codec.suffix == ".lp":
            codec.write(path)
        path.unlink(missing_ok=True)
        if data is not None:
            path.write_bytes(data)
        try:
            return path, codec.read(path)
        except BakelightError as error:
            return path, error


def judged(name: str, data: bytes | None) -> Result:
    """A typed line that names the file, or a result in which all is finite."""
    path, found = tried(name, data)
    if isinstance(found, BakelightError):
        line = str(found)
        fair = "\n" not in line and " -- " in line and path.name in line
        return Result("refused" if fair else "failed", said=line)
    bad = not_finite(found, "read")
    return Result("failed" if bad else "ok", float(len(bad)), 0.0, ", ".join(bad[:3]))


def must_refuse(name: str, data: bytes | None) -> Result:
    found = judged(name, data)
    return found if found.verdict == "refused" else Result("failed", said="it was not refused")


def flipped(name: str, seed: int) -> bytes:
    data = bytearray(sound(name))
    for at in np.random.default_rng(seed).integers(0, len(data), 3):
        data[at] ^= 1 << (at % 8)
    return bytes(data)


def _many(name: str, make: Callable[[str, int], bytes]) -> Result:
    results = [judged(name, make(name, seed)) for seed in range(20)]
    refusals = sum(r.verdict == "refused" for r in results)
    worst = next((r for r in results if not r.good), None)
    return worst or Result("ok", 0.0, 0.0, f"{refusals} of 20 refused, the others sound")


def _cut(name: str, seed: int) -> bytes:
    data = sound(name)
    return data[: int(np.random.default_rng(seed).integers(0, len(data)))]


def _sizes(name: str, byte: int) -> bytes:
    data = bytearray(sound(name))
    where = range(len(data))[CODECS[name].sizes]
    for at in where:
        data[at] = byte
    return bytes(data)


def _noise(name: str, seed: int) -> bytes:
    magic = sound(name)[:12]
    return magic + np.random.default_rng(seed).integers(0, 256, 500, dtype=np.uint8).tobytes()


def _folder(name: str) -> Result:
    return refused(lambda: CODECS[name].read(Path(tempfile.gettempdir())))


DAMAGE: tuple[tuple[str, str, str, Callable[[str], Result]], ...] = (
    ("F1", "no such file", "refused", lambda n: must_refuse(n, None)),
    ("F2", "an empty file", "refused", lambda n: must_refuse(n, b"")),
    ("F3", "a folder instead of a file", "refused", _folder),
    ("F4", "a file cut off anywhere, 20 places", "refused or sound", lambda n: _many(n, _cut)),
    ("F5", "three flipped bits, 20 times", "refused or sound", lambda n: _many(n, flipped)),
    ("F6", "sizes of 255 in the header", "refused or sound", lambda n: judged(n, _sizes(n, 255))),
    ("F7", "sizes of 0 in the header", "refused or sound", lambda n: judged(n, _sizes(n, 0))),
    ("F8", "noise after the first bytes, 20 times", "refused or sound", lambda n: _many(n, _noise)),
    ("F9", "another kind of file", "refused or sound", lambda n: judged(n, b"%PDF-1.7\n" * 40)),
    ("F10", "bytes after the end", "refused or sound", lambda n: judged(n, sound(n) + bytes(99))),
)
for _row, _case, _behaviour, _run in DAMAGE:
    files.row(
        _row, _case, _behaviour, "one typed line that names the file; nothing that is not finite"
    )
    for _codec in CODECS:
        files.add(_row, _codec, partial(_run, _codec))

files.row(
    "F11", "writing what is not finite", "refused, or clamped to the largest", "no NaN in files"
)


def _writes(write: Callable[[Path], object]) -> Result:
    with tempfile.TemporaryDirectory() as folder:
        return refused(lambda: write(Path(folder) / "a"))


_NAN = np.full((4, 4, 3), np.nan, np.float32)
for _name, _write in (
    ("exr", lambda p: exr.write(p, {"a": _NAN})),
    ("hdr", lambda p: rgbe.write(p, _NAN)),
    ("ktx2", lambda p: ktx2.write(p, ktx2.Texture((np.full((1, 4, 4, 4), np.nan, np.float16),)))),
    (
        "glb",
        lambda p: glb.write(p, [glb.Node("a", (glb.Primitive(_NAN[0], np.zeros((1, 3), int)),))]),
    ),
):
    files.add("F11", _name, lambda w=_write: _writes(w))

files.row("F12", "an interrupted write", "the old file stays whole", "rename of a finished file")


@files.cell("F12", "formats.files.atomic")
def _interrupted() -> Result:
    from formats.files import atomic

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "asset"
        atomic.write_bytes(path, b"old")
        try:
            with atomic.replacing(path) as temporary:
                temporary.write_bytes(b"ne")
                raise KeyboardInterrupt
        except KeyboardInterrupt:
            pass
        left = [p.name for p in Path(folder).iterdir()]
        return all_of(equal(path.read_bytes() == b"old", True), equal(len(left), 1, "swept"))
