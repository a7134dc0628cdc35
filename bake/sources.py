"""Meshes from files, through trimesh: OBJ, PLY, STL, OFF, GLB and glTF, with their colours.

What a file means, and what was mended, is said in `Mesh.notes`; what cannot be used is one
InputError.
"""

from __future__ import annotations

import contextlib
import json
import re
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from bake import crowded_points, materials, mesh_reading
from formats import interrupts
from formats.errors import BakelightError, InputError, reason
from formats.files.glb_buffers import unpack
from formats.files.reading import refusing
from formats.mesh import Mesh

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")
MAX_BYTES = 1 << 30
MAX_FACES = 20_000_000
PLY_HEADER = 1 << 16
CREASE = np.cos(np.radians(40))  # faces that meet at less than 40 degrees are shaded as one surface


def files(path: Path) -> tuple[Path, ...]:
    """Return all files that a mesh file consists of: itself, then materials, buffers, textures.

    Only files in the mesh's own folder, or below it, are read, and so listed.
    """
    found = [path]
    suffix = path.suffix.lower()
    if suffix == ".obj":
        for library in _present(path, _lines(path, rb"mtllib\s+(.+)")):
            found.append(library)
            images = _lines(library, rb"map_\w+\s+(?:-\S+\s+\S+\s+)*(.+)")
            found += _present(path, images)
    elif suffix in (".gltf", ".glb"):
        found += _present(path, _uris(path))
    elif suffix == ".ply":
        found += _present(path, _lines(path, rb"comment\s+TextureFile\s+(.+)", PLY_HEADER))
    return tuple(dict.fromkeys(found))


def _lines(path: Path, pattern: bytes, most: int = -1) -> list[str]:
    """List what `pattern` captures at the starts of lines, of the first `most` bytes."""
    if not path.is_file() or path.stat().st_size > MAX_BYTES:
        return []
    with open(path, "rb") as file:
        names = re.findall(rb"(?im)^[ \t]*" + pattern + rb"$", file.read(most))
    return [name.strip().decode(errors="replace") for name in names]


def _uris(path: Path) -> list[str]:
    """List the buffers and images that a glTF file keeps in files of their own."""
    if not path.is_file() or path.stat().st_size > MAX_BYTES:
        return []
    try:
        data = path.read_bytes()
        tree = unpack(data, path)[0] if path.suffix.lower() == ".glb" else json.loads(data)
        items = [item for key in ("buffers", "images") for item in tree.get(key, [])]
        return [str(item["uri"]) for item in items if "uri" in item]
    except (ValueError, TypeError, AttributeError, RecursionError, struct.error, InputError):
        # `load` says what is wrong with it
        return []


def _present(path: Path, names: list[str]) -> list[Path]:
    """Find files by the names that a mesh file mentions, where trimesh looks for them."""
    root, found = path.parent.resolve(), []
    for name in names:
        if name.startswith("data:") or "\0" in name:
            continue
        for spelling in (name, unquote(name), name.lstrip("/"), name.rsplit("/", 1)[-1]):
            file = path.parent / spelling
            with contextlib.suppress(OSError):  # such as a name that is too long
                if file.resolve().is_relative_to(root) and file.is_file():
                    found.append(file)
                    break
    return found


def load(path: Path) -> Mesh:
    """Read a mesh file. InputError names the file, what is wrong with it and the remedy."""
    check_file(path)
    with interrupts.held():
        # Its imports swallow every exception, Ctrl-C too
        import trimesh
    tree = mesh_reading.gltf_tree(path)
    try:
        with mesh_reading.listening(path) as notes:
            scene = trimesh.load_scene(path, resolver=_resolver(path), process=False)
            placed = _placed(scene)
            linear = path.suffix.lower() in (".glb", ".gltf")
            reader = materials.Reader(linear=linear, strengths=_strengths(tree, path))
            parts = [_part(*item, path, reader) for item in placed]
        told = mesh_reading.gltf_notes(tree)
    except BakelightError:
        raise
    except Exception as error:
        remedy = "this mesh cannot be read; export it again as GLB"
        raise InputError(path, "", reason(error)[:160], remedy) from error
    parts = [part for part in parts if len(part.faces)]
    if not parts:
        raise InputError(path, "faces", 0, "the file holds no triangles; export a mesh with faces")
    joined = _joined(parts, path)
    return replace(joined, notes=(*told, *notes, *joined.notes))


def _strengths(tree: dict[str, Any], path: Path) -> dict[str, float]:
    """Read what trimesh leaves out of a glTF: the strengths of emission, by the material's name."""
    found: dict[str, float] = {}
    with refusing(path, "glTF file"):
        for material in tree.get("materials", []):
            extension = material.get("extensions", {}).get("KHR_materials_emissive_strength", {})
            strength = float(extension.get("emissiveStrength", 1.0))
            name = str(material.get("name") or "")
            glows = any(material.get("emissiveFactor", ()))
            if glows and found.setdefault(name, strength) != strength:
                remedy = "two materials of this name glow with different strengths; rename one"
                raise InputError(path, "materials", name, remedy)
    return found


def _resolver(path: Path) -> Any:
    """Find side files as trimesh does, in the mesh's folder only, and by percent-encoded names."""
    from trimesh.resolvers import FilePathResolver

    class Resolver(FilePathResolver):  # type: ignore[misc, unused-ignore]
        def absolute(self, name: str) -> Path:
            found: Path = super().absolute(name)
            # Pipes and devices would never end
            if found.exists() and not found.is_file():
                raise ValueError(f"{name!r} is not a regular file")
            return found

        def get(self, name: str) -> Any:
            try:
                return super().get(name)
            except FileNotFoundError:
                return super().get(unquote(name))

    return Resolver(str(path))


def check_file(path: Path) -> None:
    """Refuse what is not there, not a mesh, empty, or too large to be read into memory."""
    if not path.is_file():
        raise InputError(path, "", "no such file", "check the path")
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(path, "suffix", path.suffix, f"use one of {', '.join(SUFFIXES)}")
    size = path.stat().st_size
    if size == 0 or size > MAX_BYTES:
        limit = f"the limit is {MAX_BYTES} bytes; simplify the mesh"
        raise InputError(path, "bytes", size, limit if size else "export it again")


def _placed(scene: Any) -> list[tuple[Any, NDArray[np.float64]]]:
    """List (mesh, world_from_mesh) of every triangle mesh that the scene's graph places."""
    placed = []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if hasattr(geometry, "faces"):
            placed.append((geometry, np.asarray(matrix, np.float64)))
    return placed


def _part(mesh: Any, matrix: NDArray[np.float64], path: Path, reader: materials.Reader) -> Mesh:
    """Turn one trimesh geometry into a Mesh in world space."""
    corners = np.asarray(mesh.vertices, np.float64)
    if corners.ndim != 2 or corners.shape[1] != 3:
        remedy = "vertices have three coordinates each; export it again"
        raise InputError(path, "vertices", f"an array of shape {corners.shape}", remedy)
    with np.errstate(all="ignore"):
        vertices = corners @ matrix[:3, :3].T + matrix[:3, 3]
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
        remedy = f"the file has {len(vertices)} vertices; export it again"
        raise InputError(path, "faces", int(faces.max()), remedy)
    used = np.unique(faces)
    bad = used[~np.isfinite(vertices[used]).all(axis=1)]
    if bad.size:
        remedy = "coordinates must be finite; repair the mesh"
        raise InputError(path, f"vertices[{bad[0]}]", vertices[bad[0]].tolist(), remedy)
    # What no face uses does not matter
    vertices[~np.isfinite(vertices).all(axis=1)] = 0
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    # Drop faces without area: they cannot be hit and have no normal
    faces, kept, dropped = _with_area(vertices, faces)
    given = mesh._cache.cache.get("vertex_normals") if hasattr(mesh, "_cache") else None
    if given is not None and np.shape(given) == vertices.shape and np.isfinite(given).all():
        linear = matrix[:3, :3]
        inverse = np.linalg.inv(linear) if np.linalg.det(linear) != 0 else np.eye(3)
        normals = _unit(np.asarray(given, np.float64) @ inverse)[faces]
    else:
        normals = corner_normals(vertices, faces)
    look = reader.look(mesh, kept)
    return Mesh(
        vertices=vertices,
        faces=faces,
        normals=normals.astype(np.float32),
        material=np.zeros(len(faces), np.int32),
        materials=(look.material,),
        uv=look.uv,
        colours=look.colours,
        notes=(*((f"dropped {dropped} faces without area",) if dropped else ()), *look.notes),
    )


def _with_area(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_], int]:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    extent = np.abs(vertices[faces.ravel()]).max(initial=0.0) or 1.0
    with np.errstate(all="ignore"):
        area = np.linalg.norm(np.cross((b - a) / extent, (c - a) / extent), axis=1)
    kept = area > 0
    return faces[kept], kept, int(np.count_nonzero(~kept))


def corner_normals(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return unit normals (m, 3, 3), one a corner: the area-weighted mean of the faces about the
    corner's point that meet this face at less than the crease angle, wherever a seam splits the
    point's vertices."""
    from scipy.sparse import csr_array

    if not len(faces):
        return np.zeros((0, 3, 3))
    _, point = np.unique(vertices, axis=0, return_inverse=True)
    point = point.reshape(-1)[faces]
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    extent = np.abs(vertices[faces.ravel()] - vertices[faces[0, 0]]).max() or 1.0
    weighted = np.cross((b - a) / extent, (c - a) / extent)
    unit = _unit(weighted)
    count = len(faces)
    face_of_corner = np.repeat(np.arange(count), 3)
    faces_of_point = csr_array(
        (np.ones(3 * count, np.int8), (point.ravel(), face_of_corner)),
        shape=(point.max() + 1, count),
    )
    # List every pair (corner, face about its point), in blocks that bound the memory
    normals = np.empty((3 * count, 3))
    first, corner_point = faces_of_point.indptr, point.ravel()
    degree = np.diff(first)[corner_point]
    crowded = np.flatnonzero(degree > crowded_points.CROWDED)
    degree[crowded] = 0
    ends = np.concatenate([[0], np.cumsum(degree)])
    start = 0
    while start < 3 * count:
        stop = max(start + 1, int(np.searchsorted(ends, ends[start] + 4_000_000, side="right")) - 1)
        corner = np.repeat(np.arange(start, stop), degree[start:stop])
        slot = np.arange(ends[start], ends[stop]) - ends[corner] + first[corner_point[corner]]
        other = faces_of_point.indices[slot]
        same = np.einsum("ij,ij->i", unit[face_of_corner[corner]], unit[other]) > CREASE
        for axis in range(3):
            total = np.bincount(
                corner[same] - start, weighted[other[same], axis], minlength=stop - start
            )
            normals[start:stop, axis] = total
        start = stop
    crowded = crowded[np.argsort(corner_point[crowded], kind="stable")]
    for corners in np.split(crowded, np.flatnonzero(np.diff(corner_point[crowded])) + 1):
        if not len(corners):
            continue
        face = face_of_corner[corners]
        normals[corners] = crowded_points.sums(unit[face], weighted[face], CREASE)
    smooth = _unit(normals).reshape(count, 3, 3)
    return np.where(np.any(smooth != 0, axis=2, keepdims=True), smooth, unit[:, None])


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, where=length > 0, out=np.zeros_like(vectors)))


def _joined(parts: list[Mesh], path: Path) -> Mesh:
    """Concatenate parts; one without uv or colours gets neutral ones where another has them."""
    total = sum(len(p.faces) for p in parts)
    if total > MAX_FACES:
        raise InputError(path, "faces", total, f"the limit is {MAX_FACES}; simplify the mesh")
    starts = np.cumsum([0] + [len(p.vertices) for p in parts])
    uv = colours = None
    if any(p.uv is not None for p in parts):
        uv = np.concatenate(
            [np.zeros((len(p.vertices), 2), np.float32) if p.uv is None else p.uv for p in parts]
        )
    if any(p.colours is not None for p in parts):
        white = [
            np.ones((len(p.vertices), 3), np.float32) if p.colours is None else p.colours
            for p in parts
        ]
        colours = np.concatenate(white)
    material = np.concatenate([np.full(len(p.faces), i, np.int32) for i, p in enumerate(parts)])
    return Mesh(
        vertices=np.concatenate([p.vertices for p in parts]),
        faces=np.concatenate([p.faces + start for p, start in zip(parts, starts, strict=False)]),
        normals=np.concatenate([p.normals for p in parts]),
        material=material,
        materials=tuple(m for p in parts for m in p.materials),
        uv=uv,
        colours=colours,
        notes=tuple(note for p in parts for note in p.notes),
    )
