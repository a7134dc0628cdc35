"""What is fuzzed: sound files of every kind, made by our own writers, how they are damaged, and the
reader that must end in a sound result or in one typed error."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from formats import seal
from formats.files import dds, exr, glb, image, ktx2, light_positions, rgbe, vox, vox_scene
from maths import bc1
from tests.fuzz import assets, mutations

ROOT = Path(__file__).resolve().parents[2]
Read = Callable[[Path], Any]


@dataclass(frozen=True)
class Subject:
    """suffix of its files. seeds(folder) : sound files. read(path) : must be safe on any bytes.
    place : name of the file that is damaged, where the reader wants a folder."""

    suffix: str
    seeds: Callable[[Path], list[bytes]]
    read: Read
    mutations: tuple[mutations.Mutation, ...] = mutations.BINARY
    place: str = ""


def finite(values: Any) -> Any:
    """Raise AssertionError for numbers that are not finite."""
    for value in values if isinstance(values, list | tuple) else [values]:
        array = np.asarray(value)
        assert array.dtype.kind not in "fc" or np.isfinite(array).all(), "not finite"
    return values


def pixels(rows: int = 8, columns: int = 12) -> Any:
    """Return a small picture (h, w, 4) float32 in 0..1."""
    y, x = np.mgrid[0:rows, 0:columns]
    return np.stack([x / columns, y / rows, (x * y % 5) / 5, 1 - x / columns], -1).astype(
        np.float32
    )


def written(*writers: Callable[[Path], object]) -> Callable[[Path], list[bytes]]:
    """Return the bytes that each writer leaves."""

    def seeds(folder: Path) -> list[bytes]:
        found = []
        for number, write in enumerate(writers):
            path = folder / f"seed{number}"
            write(path)
            found.append(path.read_bytes())
        return found

    return seeds


def _plain_png(folder: Path) -> list[bytes]:
    import png
    from PIL import Image

    codes = np.rint(pixels() * 255).astype(np.uint8)
    found = []
    for mode, array in (("RGBA", codes), ("RGB", codes[..., :3]), ("L", codes[..., 0])):
        stream = io.BytesIO()
        Image.fromarray(array, mode).save(stream, "PNG")
        found.append(stream.getvalue())
    stream = io.BytesIO()
    Image.fromarray(codes[..., :3]).convert("P").save(stream, "PNG")
    found.append(stream.getvalue())
    deep = io.BytesIO()
    rows = (codes.astype(np.uint16) * 257).reshape(8, -1).tolist()
    png.Writer(12, 8, bitdepth=16, greyscale=False, alpha=True).write(deep, rows)
    return [*found, deep.getvalue()]


def _photographs(folder: Path) -> list[bytes]:
    """The other pictures that people bring: JPEG, WebP and TIFF."""
    from PIL import Image

    picture = Image.fromarray(np.rint(pixels(24, 32)[..., :3] * 255).astype(np.uint8))
    kinds: list[tuple[str, dict[str, Any]]] = [
        ("JPEG", {"quality": 90}), ("JPEG", {"progressive": True}), ("WEBP", {"lossless": True}),
        ("WEBP", {"quality": 80}), ("TIFF", {}), ("TIFF", {"compression": "tiff_lzw"}),
        ("TIFF", {"compression": "tiff_adobe_deflate"}), ("TIFF", {"compression": "jpeg"}),
    ]  # fmt: skip
    found = []
    for kind, options in kinds:
        stream = io.BytesIO()
        picture.save(stream, kind, **options)
        found.append(stream.getvalue())
    return found


def _textures(path: Path, kind: str) -> None:
    codes = np.rint(pixels(16, 16) * 255).astype(np.uint8)
    if kind == "blocks":
        levels = tuple(bc1.encode_image(level[None]) for level in (codes, codes[::2, ::2]))
        texture = ktx2.Texture(levels, extent=(16, 16))
    elif kind == "volume":
        texture = ktx2.Texture((np.repeat(codes[None, :4, :4], 4, axis=0),), "volume")
    else:
        half = pixels(16, 16).astype(np.float16)[None]
        texture = ktx2.Texture((half, half[:, ::2, ::2]))
    ktx2.write(path, texture, compress=kind != "plain")


def _dds(path: Path, header: Any) -> None:
    codes = np.rint(pixels(16, 16) * 255).astype(np.uint8)
    if header == "fourcc":
        levels = tuple(bc1.encode_image(level[None]) for level in (codes, codes[::2, ::2]))
        dds.write(path, dds.Texture(levels, extent=(16, 16)), header=header)
    else:
        dds.write(path, dds.Texture((codes[None],)))


def _exr(path: Path, compression: str) -> None:
    exr.write(path, {"a": pixels(), "b": pixels()[..., :1]}, compression=compression, half=True)


def _glb(path: Path) -> None:
    positions = pixels().reshape(-1, 4)[:, :3]
    triangles = np.arange(96).reshape(-1, 3)
    primitive = glb.Primitive(positions, triangles, colours=np.full((96, 3), 0.5))
    glb.write(path, [glb.Node("a", (primitive,))])


def _vox(folder: Path) -> list[bytes]:
    door = (ROOT / "assets" / "voxels" / "door.vox").read_bytes()
    cells = struct.pack("<i", 3) + bytes([0, 0, 0, 1, 1, 0, 0, 2, 0, 1, 1, 3])
    chunks = b"SIZE" + struct.pack("<ii", 12, 0) + struct.pack("<iii", 2, 2, 2)
    chunks += b"XYZI" + struct.pack("<ii", len(cells), 0) + cells
    chunks += b"RGBA" + struct.pack("<ii", 1024, 0) + bytes(range(256)) * 4
    small = b"VOX " + struct.pack("<i", 150) + b"MAIN" + struct.pack("<ii", 0, len(chunks)) + chunks
    return [small, door]


def _obj(folder: Path) -> list[bytes]:
    (folder / "a.mtl").write_text("newmtl m\nKd 0.5 0.25 1\nNs 10\nd 0.5\n")
    corners = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = "f 1 2 4 3\nf 5/1/1 6/1/1 8/1/1\nf -1 -2 -3\n"
    text = "mtllib a.mtl\no a\n" + "\n".join(corners) + "\nvt 0 1\nvn 0 0 1\nusemtl m\n" + faces
    return [text.encode()]


def _ply(folder: Path) -> list[bytes]:
    head = "ply\nformat {} 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    head += "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    text = head.format("ascii") + "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 2 3\n"
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4").tobytes()
    faces = struct.pack("<BiiiBiii", 3, 0, 1, 2, 3, 0, 2, 3)
    return [text.encode(), head.format("binary_little_endian").encode() + corners + faces]


def _positions(folder: Path) -> list[bytes]:
    for n in range(4):
        image.write(folder / f"p{n}.png", pixels())
    lines = [f"p{n}.png {0.1 * n} {0.2} {0.9}" for n in range(4)]
    return ["\n".join(["4", *lines]).encode(), "\r\n".join(["4  ", *lines, ""]).encode()]


SCENE = """\
format = 1
time = { duration = 2.0, frame_rate = 24 }
[camera]
position = { times = [0, 2], values = [[0, 1, 6], [1, 1, 6]], interpolation = "smooth" }
target = [0, 1, 0]
lens = { f_number = 2.8, focus_distance = 6.0 }
[[lights]]
type = "sun"
to_light = [1, 1, 1]
irradiance = [3, 3, 3]
[[lights]]
type = "sphere"
position = [1, 2, 1]
radius = 0.2
radiance = [9, 4, 2]
[[billboards]]
name = "oak"
source = "meshes/oak.glb"
height = 2.0
ring = { axis = "view", elevation = 30, lights = 24, terms = 5 }
scatter = { count = 4, seed = 2, box = [[-2, 0, -3], [2, 0, 1]], height = [0.8, 1.2] }
[[meshes]]
name = "bust"
source = "meshes/bust.glb"
position = [1, 0, 0]
lighting = "transfer"
shadow = { l_max = 4 }
[ground]
albedo = [0.2, 0.2, 0.2]
[picture]
sky = { zenith = [0.1, 0.2, 0.4], horizon = [0.5, 0.5, 0.5] }
fog = { extinction = 0.02, radiance = [0.4, 0.4, 0.5] }
bloom = { strength = 0.1, threshold = 1.0 }
film = { exposure = 0.5, tonemap = "filmic", vignette = 0.2 }
[force]
fog = true
"""


def _scenes(folder: Path) -> list[bytes]:
    cubes = (ROOT / "assets" / "scenes" / "cubeworld.toml").read_bytes()
    return [SCENE.encode(), SCENE.encode(), cubes]


def _read_scene(path: Path) -> Any:
    from formats import scene

    return scene.load(path, ROOT / "assets")


def _read_mesh(path: Path) -> Any:
    from bake import sources

    return finite(sources.load(path).vertices)


def _read_vox(path: Path) -> Any:
    return vox_scene.flatten(vox.read(path))


def _asset(folder: Path) -> list[bytes]:
    """Save a tiny environment; its report is what is damaged."""
    from formats.environment import Environment

    Environment(radiance=pixels(8, 16)[..., :3]).save(folder)
    seal.seal(folder)
    return [(folder / "report.json").read_bytes()]


def _read_asset(path: Path) -> Any:
    from formats.environment import Environment

    # What counts is a report that was damaged on purpose, and sealed again
    (path.parent / seal.NAME).unlink(missing_ok=True)
    seal.seal(path.parent)
    return finite(Environment.load(path.parent).radiance)


def _read_seal(path: Path) -> Any:
    return seal.verify(path.parent)


def _seal(folder: Path) -> list[bytes]:
    _asset(folder)
    return [(folder / seal.NAME).read_bytes()]


def _read_exr(path: Path) -> Any:
    return finite(list(exr.read(path).values()))


SUBJECTS = {
    "vox": Subject(".vox", _vox, _read_vox, (*mutations.BINARY, *3 * (mutations.vox,))),
    "lp": Subject(".lp", _positions, lambda p: light_positions.read(p), mutations.TEXT),
    "hdr": Subject(
        ".hdr", written(lambda p: rgbe.write(p, pixels()[..., :3])), lambda p: finite(rgbe.read(p))
    ),
    "exr": Subject(
        ".exr", written(*(lambda p, c=c: _exr(p, c) for c in ("none", "zip", "piz"))), _read_exr
    ),
    "ktx2": Subject(
        ".ktx2",
        written(*(lambda p, k=k: _textures(p, k) for k in ("plain", "half", "blocks", "volume"))),
        lambda p: ktx2.read(p),
    ),
    "dds": Subject(
        ".dds",
        written(*(lambda p, h=h: _dds(p, h) for h in ("dx10", "fourcc"))),
        lambda p: dds.read(p),
    ),
    "png": Subject(
        ".png",
        _plain_png,
        lambda p: finite(image.read(p)),
        (*mutations.BINARY, *3 * (mutations.png,)),
    ),
    "photograph": Subject(".img", _photographs, lambda p: finite(image.read(p))),
    "glb": Subject(
        ".glb", written(_glb), lambda p: glb.read(p), (*mutations.BINARY, *3 * (mutations.glb,))
    ),
    "glb_mesh": Subject(
        ".glb", written(_glb), _read_mesh, (*mutations.BINARY, *3 * (mutations.glb,))
    ),
    "obj": Subject(".obj", _obj, _read_mesh, mutations.TEXT),
    "ply": Subject(".ply", _ply, _read_mesh, (*mutations.TEXT, *mutations.BINARY)),
    "toml": Subject(".toml", _scenes, _read_scene, mutations.TEXT),
    "report": Subject(
        ".json", _asset, _read_asset, (*3 * (mutations.tree,), *mutations.TEXT), "report.json"
    ),
    "reports": Subject(
        ".json", assets.reports, assets.read, (*3 * (mutations.tree,), *mutations.TEXT)
    ),
    "seal": Subject(
        ".json", _seal, _read_seal, (*3 * (mutations.tree,), *mutations.TEXT), seal.NAME
    ),
}


def described(error: BaseException) -> str:
    """Return an exception as one line with the place that raised it."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = ""
    if trace is not None:
        where = f" at {Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"
    return json.dumps(f"{type(error).__name__}: {error}"[:300])[1:-1] + where
