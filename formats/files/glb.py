"""Binary glTF 2.0: triangle meshes and their materials in one self-contained file.

Right-handed, +y up, metres. Written bytes depend on nothing but the arguments. Custom vertex
attributes carry a leading underscore (`_TRANSFER_0`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files import atomic
from formats.files.glb_buffers import Reader, Writer, item, pack, unpack
from formats.files.glb_nodes import placed
from formats.files.reading import read_bytes, refusing

MAX_FILE_BYTES = 1 << 30
"""Largest file."""

_SIGNATURES = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}
_STRENGTH = "KHR_materials_emissive_strength"
_UNDERSTOOD = re.compile(r"KHR_mesh_quantization|KHR_lights_punctual|KHR_materials_\w+")
_CUSTOM = re.compile(r"_[A-Za-z0-9_]+")
_WIDTHS = {"POSITION": (3,), "NORMAL": (3,), "TEXCOORD_0": (2,), "COLOR_0": (3, 4)}


@dataclass(frozen=True)
class Material:
    """Metallic-roughness material.

    base_color : linear rgb and alpha, 0..1, times `texture`: bytes of an sRGB PNG or JPEG, or None.
    emissive : linear radiance, from 0, unbounded (KHR_materials_emissive_strength above 1).
    alpha_mode : OPAQUE, MASK (cut at 0.5) or BLEND.
    """

    name: str = ""
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    texture: bytes | None = None
    roughness: float = 1.0
    metallic: float = 0.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    double_sided: bool = False
    alpha_mode: str = "OPAQUE"


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles of one material.

    positions : (n, 3) float32. indices : (m, 3) corners, counter-clockwise from outside.
    normals : (n, 3) float32 unit. uv : (n, 2) float32, (0, 0) at the *top* left of the texture.
    colours : (n, 3) or (n, 4) linear; float 0..1, or uint8 or uint16 meaning code / maximum.
    attributes : `_NAME` -> (n,) or (n, k) of float32, uint8 or uint16, k <= 4.
    """

    positions: NDArray[Any]
    indices: NDArray[Any]
    normals: NDArray[Any] | None = None
    uv: NDArray[Any] | None = None
    colours: NDArray[Any] | None = None
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    material: Material = field(default_factory=Material)


@dataclass(frozen=True, eq=False)
class Node:
    """A placed mesh. matrix : (4, 4) world_from_node, multiplies column vectors."""

    name: str
    primitives: tuple[Primitive, ...]
    matrix: NDArray[Any] = field(default_factory=lambda: np.eye(4))


def write(path: Path, nodes: Iterable[Node]) -> None:
    """Write a scene of placed meshes atomically.

    Equal materials and textures are stored once. Raises InputError naming the node and the field
    for arrays of wrong shape or type, indices out of range, and values that are not finite.
    """
    writer, tables = Writer(), _Tables()
    gltf_nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    for node in nodes:
        where = f"node {node.name!r}"
        entry: dict[str, Any] = {"name": node.name}
        matrix = _array(path, f"{where} matrix", node.matrix, (4, 4))
        if not np.array_equal(matrix, np.eye(4)):
            entry["matrix"] = matrix.T.ravel().tolist()
        if node.primitives:
            entry["mesh"] = len(meshes)
            added = [_add(path, where, p, writer, tables) for p in node.primitives]
            meshes.append({"name": node.name, "primitives": added})
        gltf_nodes.append(entry)
    if not meshes:
        raise InputError(path, "nodes", "no triangles", "give at least one primitive")
    binary = bytes(writer.binary)
    gltf = {
        "asset": {"version": "2.0", "generator": "bakelight"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(gltf_nodes)))}],
        "nodes": gltf_nodes,
        "meshes": meshes,
        "accessors": writer.accessors,
        "bufferViews": writer.views,
        "buffers": [{"byteLength": len(binary)}],
    } | tables.gltf()
    atomic.write_bytes(Path(path), pack(gltf, binary))


def read(path: Path) -> list[Node]:
    """Placed meshes of a GLB file, transforms multiplied out, in the order of the scene.

    Positions, normals and uv come as float32, indices as (m, 3) uint32, colours as stored. Cameras,
    skins and animations are left out. Raises InputError for damaged files and for what would change
    the shape unseen: sparse accessors, strips, lines, external files, unknown required extensions.
    """
    data = read_bytes(path, MAX_FILE_BYTES)
    with refusing(path, "GLB file"):
        gltf, binary = unpack(data, path)
        for extension in gltf.get("extensionsRequired", []):
            if not _UNDERSTOOD.fullmatch(extension):
                remedy = "export it without this extension (no compression)"
                raise InputError(path, "extensionsRequired", extension, remedy)
        reader = Reader(gltf, binary)
        meshes: dict[int, tuple[Primitive, ...]] = {}
        nodes = []
        for entry, matrix in placed(gltf):
            if "mesh" not in entry:
                continue
            mesh = item(gltf, "meshes", entry["mesh"])
            if entry["mesh"] not in meshes:
                meshes[entry["mesh"]] = tuple(_primitive(reader, p) for p in mesh["primitives"])
            name = entry.get("name") or mesh.get("name") or f"mesh {entry['mesh']}"
            nodes.append(Node(str(name), meshes[entry["mesh"]], matrix))
        return nodes


class _Tables:
    """Materials, textures and images, each stored once."""

    def __init__(self) -> None:
        self.materials: dict[str, int] = {}
        self.images: dict[bytes, int] = {}
        self.gltf_images: list[dict[str, Any]] = []
        self.strong = False

    def add_material(self, path: Path, material: Material, writer: Writer) -> int:
        where = f"material {material.name!r}"
        colour = _array(path, f"{where} base_color", material.base_color, (4,))
        emissive = _array(path, f"{where} emissive", material.emissive, (3,))
        factors = _array(path, f"{where} factors", (material.metallic, material.roughness), (2,))
        codes = np.concatenate([colour, factors])
        if codes.min() < 0.0 or codes.max() > 1.0 or emissive.min() < 0.0:
            raise InputError(path, where, codes.tolist(), "keep factors in 0..1, emission from 0")
        if material.alpha_mode not in ("OPAQUE", "MASK", "BLEND"):
            raise InputError(path, where, material.alpha_mode, "use OPAQUE, MASK or BLEND")
        surface: dict[str, Any] = {
            "baseColorFactor": colour.tolist(),
            "metallicFactor": factors[0].item(),
            "roughnessFactor": factors[1].item(),
        }
        if material.texture is not None:
            surface["baseColorTexture"] = {"index": self._add_image(path, where, material, writer)}
        strength = max(1.0, emissive.max().item())
        entry = {
            "name": material.name,
            "pbrMetallicRoughness": surface,
            "emissiveFactor": (emissive / strength).tolist(),
            "doubleSided": bool(material.double_sided),
            "alphaMode": material.alpha_mode,
        }
        if strength > 1.0:
            entry["extensions"] = {_STRENGTH: {"emissiveStrength": strength}}
            self.strong = True
        return self.materials.setdefault(json.dumps(entry, sort_keys=True), len(self.materials))

    def _add_image(self, path: Path, where: str, material: Material, writer: Writer) -> int:
        data = material.texture or b""
        kinds = [kind for signature, kind in _SIGNATURES.items() if data.startswith(signature)]
        if not kinds:
            raise InputError(path, f"{where} texture", data[:8], "give the bytes of a PNG or JPEG")
        if data not in self.images:
            self.images[data] = len(self.images)
            view = writer.add_bytes(data)
            self.gltf_images.append({"bufferView": view, "mimeType": kinds[0]})
        return self.images[data]

    def gltf(self) -> dict[str, Any]:
        tables: dict[str, Any] = {"materials": [json.loads(text) for text in self.materials]}
        if self.gltf_images:
            tables["images"] = self.gltf_images
            tables["textures"] = [{"source": i} for i in range(len(self.gltf_images))]
        return tables | ({"extensionsUsed": [_STRENGTH]} if self.strong else {})


def _add(
    path: Path, where: str, primitive: Primitive, writer: Writer, tables: _Tables
) -> dict[str, Any]:
    n = len(np.atleast_1d(primitive.positions))
    positions = _array(path, f"{where} positions", primitive.positions, (n, 3), np.float32)
    indices = np.asarray(primitive.indices)
    if (
        indices.ndim != 2
        or indices.shape[1] != 3
        or not indices.size
        or indices.dtype.kind not in "iu"
    ):
        value = f"{indices.shape} {indices.dtype}"
        raise InputError(path, f"{where} indices", value, "give (m, 3) whole numbers, m from 1")
    if indices.min() < 0 or indices.max() >= n:
        value = f"{indices.min()} to {indices.max()}"
        raise InputError(path, f"{where} indices", value, f"use 0 to {n - 1}")
    entries = {"POSITION": writer.add_vertices(positions, bounds=True)}
    if primitive.normals is not None:
        normals = _array(path, f"{where} normals", primitive.normals, (n, 3), np.float32)
        entries["NORMAL"] = writer.add_vertices(normals)
    if primitive.uv is not None:
        uv = _array(path, f"{where} uv", primitive.uv, (n, 2), np.float32)
        entries["TEXCOORD_0"] = writer.add_vertices(uv)
    if primitive.colours is not None:
        colours = _colours(path, f"{where} colours", primitive.colours, n)
        entries["COLOR_0"] = writer.add_vertices(colours, normalized=colours.dtype.kind == "u")
    for name in sorted(primitive.attributes):
        custom = _custom(path, f"{where} {name}", name, primitive.attributes[name], n)
        entries[name] = writer.add_vertices(custom)
    return {
        "attributes": entries,
        "indices": writer.add_indices(indices, n),
        "material": tables.add_material(path, primitive.material, writer),
    }


def _array(
    path: Path, where: str, values: Any, shape: tuple[int, ...], dtype: type = np.float64
) -> NDArray[Any]:
    array = np.asarray(values)
    if array.shape != shape or array.dtype.kind not in "fiu" or 0 in shape:
        value = f"{array.shape} {array.dtype}"
        raise InputError(path, where, value, f"give numbers of shape {shape}")
    if not np.all(np.isfinite(array)) or np.abs(array).max() > np.finfo(np.float32).max:
        raise InputError(path, where, "not finite", "replace NaN and infinity")
    return array.astype(dtype)


def _colours(path: Path, where: str, values: NDArray[Any], n: int) -> NDArray[Any]:
    array = np.asarray(values)
    width = 4 if array.ndim == 2 and array.shape[1] == 4 else 3
    if array.dtype in (np.uint8, np.uint16) and array.shape == (n, width):
        return array
    floats = _array(path, where, array, (n, width), np.float32)
    if array.dtype.kind != "f" or floats.min() < 0.0 or floats.max() > 1.0:
        raise InputError(path, where, str(array.dtype), "give uint8, uint16, or floats in 0..1")
    return floats


def _custom(path: Path, where: str, name: str, values: NDArray[Any], n: int) -> NDArray[Any]:
    array = np.asarray(values)
    if not _CUSTOM.fullmatch(name):
        raise InputError(path, where, name, "start custom attributes with an underscore")
    if array.shape not in [(n,), *((n, k) for k in range(1, 5))]:
        raise InputError(path, where, array.shape, f"give ({n},) or ({n}, k) with k up to 4")
    if array.dtype in (np.uint8, np.uint16):
        return array
    return _array(path, where, array, array.shape, np.float32)


def _primitive(reader: Reader, entry: dict[str, Any]) -> Primitive:
    if entry.get("mode", 4) != 4:
        raise ValueError("it holds points, lines or strips; only triangles are supported")
    names = entry["attributes"]
    positions = reader.floats(names["POSITION"])
    n = len(positions)
    indices = reader.array(entry["indices"]) if "indices" in entry else np.arange(n)
    triangles = indices.reshape(-1, 3).astype(np.uint32)
    if triangles.max() >= n:
        raise ValueError(f"an index of {triangles.max()} into {n} vertices")
    floats = {k: reader.floats(names[k]) for k in ("NORMAL", "TEXCOORD_0") if k in names}
    colours = reader.array(names["COLOR_0"]) if "COLOR_0" in names else None
    custom = {k: reader.array(v) for k, v in names.items() if _CUSTOM.fullmatch(k)}
    for name, array in {"POSITION": positions, "COLOR_0": colours, **floats, **custom}.items():
        if array is None:
            continue
        if len(array) != n or array.shape[1] not in _WIDTHS.get(name, (1, 2, 3, 4)):
            raise ValueError(f"{name} is {array.shape} beside {n} positions")
    return Primitive(
        positions=positions,
        indices=triangles,
        normals=floats.get("NORMAL"),
        uv=floats.get("TEXCOORD_0"),
        colours=colours,
        attributes={k: v[:, 0] if v.shape[1] == 1 else v for k, v in custom.items()},
        material=_material(reader, entry["material"])
        if "material" in entry
        else Material(metallic=1.0),
    )


def _material(reader: Reader, index: int) -> Material:
    entry = item(reader.gltf, "materials", index)
    surface = entry.get("pbrMetallicRoughness", {})
    strength = entry.get("extensions", {}).get(_STRENGTH, {}).get("emissiveStrength", 1.0)
    texture = surface.get("baseColorTexture")
    red, green, blue, alpha = (float(v) for v in surface.get("baseColorFactor", (1, 1, 1, 1)))
    emission = [float(v) * float(strength) for v in entry.get("emissiveFactor", (0, 0, 0))]
    return Material(
        name=str(entry.get("name", "")),
        base_color=(red, green, blue, alpha),
        texture=_texture(reader, texture) if texture else None,
        roughness=float(surface.get("roughnessFactor", 1.0)),
        metallic=float(surface.get("metallicFactor", 1.0)),
        emissive=(emission[0], emission[1], emission[2]),
        double_sided=bool(entry.get("doubleSided", False)),
        alpha_mode=str(entry.get("alphaMode", "OPAQUE")),
    )


def _texture(reader: Reader, texture: dict[str, Any]) -> bytes:
    if texture.get("texCoord", 0) != 0:
        raise ValueError("a texture uses a second set of coordinates")
    source = item(reader.gltf, "textures", texture["index"])["source"]
    image = item(reader.gltf, "images", source)
    if "bufferView" not in image:
        raise ValueError("a texture lies outside the file: embed it")
    return bytes(reader.view(image["bufferView"]))
