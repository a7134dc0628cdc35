"""What trimesh passes over in silence when it reads a mesh file: refused, or told in a note."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from formats.errors import InputError
from formats.files.glb_buffers import unpack
from formats.files.reading import refusing

MAX_COUNT = 60_000_000
"""Most elements of a glTF accessor, three a face of the largest mesh."""

_HARMLESS = ("KHR_materials_", "KHR_lights_punctual", "KHR_mesh_quantization", "KHR_xmp")
_KNOWN = ("EXT_texture_webp",)
_LOST = "failed to load mesh"
_NOTES = {
    "image": "a picture could not be read, or lies outside the file's folder: left out",
    "texture": "a picture could not be read, or lies outside the file's folder: left out",
    "unable to load materials": "the materials' file could not be read, or lies outside: left out",
    "specified material": "a material is named that is not there: grey instead",
    "failed to load vertex_colors": "colours of vertices could not be read: left out",
    "failed to load colors": "colours of vertices could not be read: left out",
    "skipping primitive with mode": "points or lines: left out",
}


@contextmanager
def listening(path: Path) -> Iterator[list[str]]:
    """Yield the notes that come of what trimesh logs in the block; none of it is printed.

    Raises InputError where a part of the file was dropped because it could not be read.
    """
    notes: list[str] = []
    heard = _Heard()
    logger = logging.getLogger("trimesh")
    kept = logger.level, logger.propagate
    logger.addHandler(heard)
    logger.setLevel(logging.DEBUG)
    logger.propagate = False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield notes
    finally:
        logger.removeHandler(heard)
        logger.level, logger.propagate = kept
    for said in heard.said:
        if said.startswith(_LOST):
            remedy = "a part of it cannot be read: export it again as GLB"
            raise InputError(path, "meshes", said, remedy)
        notes += [note for key, note in _NOTES.items() if key in said and note not in notes]


class _Heard(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.DEBUG)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        told = record.getMessage()
        self.said.append(f"{told} ({error})"[:160] if error else told[:160])


def gltf_tree(path: Path) -> dict[str, Any]:
    """Return the JSON of a .glb or .gltf file, what it may hold checked; {} of other files.

    Raises InputError for what trimesh would leave out without a word: extensions that a reader must
    know, sparse or normalised numbers, numbers that lie nowhere or are too many.
    """
    if path.suffix.lower() not in (".glb", ".gltf"):
        return {}
    with refusing(path, "glTF file"):
        data = path.read_bytes()
        tree = unpack(data, path)[0] if path.suffix.lower() == ".glb" else json.loads(data)
        if not isinstance(tree, dict):
            raise ValueError("its JSON is not an object")
        for name in tree.get("extensionsRequired", []):
            if name not in _KNOWN and not str(name).startswith(_HARMLESS):
                raise InputError(path, "extensionsRequired", name, "export it without")
        for index in _used(tree):
            _require_plain(tree["accessors"][index], f"accessors[{index}]", path)
        if any(accessor.get("count", 0) > MAX_COUNT for accessor in tree.get("accessors", [])):
            raise ValueError(f"an accessor holds more than {MAX_COUNT} elements")
    return tree


def gltf_notes(tree: dict[str, Any]) -> tuple[str, ...]:
    """Return what moves in a glTF file but stands still here."""
    found = []
    if any("skin" in node for node in tree.get("nodes", [])):
        found.append("it has a skin: taken as its vertices stand, without bones")
    shapes = (p for mesh in tree.get("meshes", []) for p in mesh.get("primitives", []))
    if any(shape.get("targets") for shape in shapes):
        found.append("it has morph targets: taken without them")
    return tuple(found)


def _used(tree: dict[str, Any]) -> set[int]:
    """Return the accessors that surfaces are read from."""
    found = set()
    for mesh in tree.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            attributes = primitive.get("attributes", {})
            wanted = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0")
            found |= {attributes[name] for name in wanted if name in attributes}
            found |= {primitive["indices"]} if "indices" in primitive else set()
    return found


def _require_plain(accessor: dict[str, Any], field: str, path: Path) -> None:
    if "sparse" in accessor or "bufferView" not in accessor:
        what = "sparse" if "sparse" in accessor else "without a bufferView"
        raise InputError(path, field, what, "export it without sparse accessors and compression")
    # Colours of vertices, which are read as what they are, may be
    if accessor.get("normalized") and accessor.get("type") == "VEC2":
        remedy = "export texture coordinates as floats"
        raise InputError(path, field, "normalized texture coordinates", remedy)
