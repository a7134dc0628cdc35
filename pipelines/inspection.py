"""What an asset is, from its own files, and whether it still is what was sealed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from formats import report, seal
from formats.errors import InputError
from formats.files.reading import MAX_JSON_BYTES, read_bytes, strict_json


def inspect(path: Path) -> dict[str, Any]:
    """Describe a baked folder or a file. InputError, DamagedError."""
    if path.is_dir():
        return _folder(path)
    if not path.is_file():
        raise InputError(path, "", "no such file or folder", "check the path")
    describe = _DESCRIBE.get(path.suffix.lower())
    if describe is None:
        if path.suffix.lower() in (".glb", ".gltf", ".obj", ".ply", ".stl", ".off"):
            return _mesh(path)
        remedy = "inspect a baked folder, a mesh, .vox, .xraw, .ktx2, .exr or .hdr"
        raise InputError(path, "suffix", path.suffix, remedy)
    return {"file": str(path), "bytes": path.stat().st_size, **describe(path)}


def _folder(path: Path) -> dict[str, Any]:
    if (path / "manifest.json").is_file():
        seal.verify(path)
        manifest = _json(path / "manifest.json")
        called = [e["name"] for e in manifest["plan"]["effects"] if e["called"]]
        return {
            "kind": "scene",
            "name": manifest["name"],
            "effects": called,
            "assets": manifest["assets"],
            "seal": "intact",
        }
    if not seal.is_sealed(path):
        raise InputError(
            path, "", "not a baked folder", "name a folder that holds seal.json or manifest.json"
        )
    seal.verify(path)
    size = sum(file.stat().st_size for file in path.iterdir())
    data = report.read(path)
    if data.get("kind") == "voxels":
        data = _voxels(data)
    return {"folder": str(path), "bytes": size, "seal": "intact", **data}


def _voxels(data: dict[str, Any]) -> dict[str, Any]:
    """Leave out what is one line a colour, but for those that glow."""
    layout = dict(data["layout"])
    albedo, emission = layout.pop("albedo"), layout.pop("emission")
    glowing = {str(row): rgb for row, rgb in enumerate(emission) if any(rgb)}
    return data | {"layout": layout | {"rows": len(albedo), "glowing_rows": glowing}}


def _json(path: Path) -> dict[str, Any]:
    data = strict_json(read_bytes(path, MAX_JSON_BYTES), path)
    return data if isinstance(data, dict) else {"content": data}


def _ktx2(path: Path) -> dict[str, Any]:
    from formats.files import ktx2

    texture = ktx2.read(path)
    layers, height, width = texture.size
    return {
        "kind": texture.kind, "layers": layers, "width": width, "height": height,
        "levels": len(texture.levels), "type": str(texture.levels[0].dtype),
        "format": texture.format.name,
        "metadata": texture.metadata,
    }  # fmt: skip


def _exr(path: Path) -> dict[str, Any]:
    from formats.files import apart

    return {"parts": {name: list(image.shape) for name, image in apart.read_exr(path).items()}}


def _hdr(path: Path) -> dict[str, Any]:
    from formats.files import rgbe

    image = rgbe.read(path)
    return {"shape": list(image.shape), "peak": float(image.max())}


def _vox(path: Path) -> dict[str, Any]:
    from formats.files import vox, vox_scene

    file = vox.read(path)
    placed, scene = vox_scene.placements(file), vox_scene.flatten(file)
    return {
        "kind": "vox", "version": file.version, "models": len(file.models), "placed": len(placed),
        "hidden": sum(p.hidden for p in placed), "size_z_up": list(scene.cells.shape[::-1]),
        "cells": int((scene.cells > 0).sum()),
        "emissive": {str(i): m.emission for i, m in enumerate(file.materials) if m.emission},
        "notes": list(scene.notes),
    }  # fmt: skip


def _xraw(path: Path) -> dict[str, Any]:
    from formats.files import xraw

    file = xraw.read(path)
    size, count = list(file.cells.shape[::-1]), int((file.cells > 0).sum())
    return {"kind": "xraw", "size_z_up": size, "cells": count, "colours": len(file.palette)}


def _mesh(path: Path) -> dict[str, Any]:
    from bake import sources

    mesh = sources.load(path)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return {
        "file": str(path), "kind": "mesh", "faces": len(mesh.faces), "vertices": len(mesh.vertices),
        "size": [float(x) for x in high - low], "materials": [m.name for m in mesh.materials],
        "texture": any(m.texture is not None for m in mesh.materials),
        "vertex_colours": mesh.colours is not None, "notes": list(mesh.notes),
    }  # fmt: skip


_DESCRIBE = {
    ".ktx2": _ktx2,
    ".exr": _exr,
    ".hdr": _hdr,
    ".json": _json,
    ".vox": _vox,
    ".xraw": _xraw,
}
