"""Meshes from files, through trimesh: OBJ, PLY, STL, OFF, GLB and glTF, with their colours.

What a file means, and what was mended, is said in `Mesh.notes`; what cannot be used is one InputError.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.mesh import Material, Mesh
from maths.colour import srgb_decode

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")
MAX_BYTES = 1 << 30
MAX_FACES = 20_000_000
CREASE = np.cos(np.radians(40))  # faces that meet at less than 40 degrees are shaded as one surface


def files(path: Path) -> tuple[Path, ...]:
    """Return all the files that a mesh file consists of: itself, then materials, buffers, textures."""
    found = [path]
    if path.suffix.lower() == ".obj":
        for library in _mentioned(path, rb"^\s*mtllib\s+(.+?)\s*$"):
            found.append(library)
            found += _mentioned(library, rb"^\s*map_\w+\s+(?:-\S+\s+\S+\s+)*(.+?)\s*$")
    elif path.suffix.lower() == ".gltf":
        found += _mentioned(path, rb'"uri"\s*:\s*"(?!data:)([^"]+)"')
    return tuple(dict.fromkeys(found))


def _mentioned(path: Path, pattern: bytes) -> list[Path]:
    names = re.findall(pattern, path.read_bytes(), re.MULTILINE)
    mentioned = [path.parent / unquote(name.decode(errors="replace")) for name in names]
    return [
        m for m in mentioned if m.is_file() and m.resolve().is_relative_to(path.parent.resolve())
    ]


def load(path: Path) -> Mesh:
    """Read a mesh file. InputError names the file, what is wrong with it and the remedy."""
    check_file(path)
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
        parts = [_part(*item, path) for item in _placed(scene)]
    except InputError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"[:160]
        raise InputError(
            path, "", reason, "this mesh cannot be read; export it again as GLB"
        ) from error
    parts = [part for part in parts if len(part.faces)]
    if not parts:
        raise InputError(path, "faces", 0, "the file holds no triangles; export a mesh with faces")
    return _joined(parts, path)


def check_file(path: Path) -> None:
    """Refuse what is not there, not a mesh, empty, or too large to be read into memory."""
    if not path.is_file():
        raise InputError(path, "", "no such file", "check the path")
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(path, "suffix", path.suffix, f"use one of {', '.join(SUFFIXES)}")
    size = path.stat().st_size
    if size == 0 or size > MAX_BYTES:
        remedy = (
            "export it again" if size == 0 else f"the limit is {MAX_BYTES} bytes; simplify the mesh"
        )
        raise InputError(path, "bytes", size, remedy)


def _placed(scene: Any) -> list[tuple[Any, NDArray[np.float64]]]:
    """List (mesh, world_from_mesh) of every triangle mesh that the scene's graph places."""
    placed = []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if hasattr(geometry, "faces"):
            placed.append((geometry, np.asarray(matrix, np.float64)))
    return placed


def _part(mesh: Any, matrix: NDArray[np.float64], path: Path) -> Mesh:
    """Turn one trimesh geometry into a Mesh in world space."""
    with np.errstate(all="ignore"):
        vertices = np.asarray(mesh.vertices, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise InputError(
            path,
            "faces",
            int(faces.max()),
            f"the file has {len(vertices)} vertices; export it again",
        )
    used = np.unique(faces)
    bad = used[~np.isfinite(vertices[used]).all(axis=1)]
    if bad.size:
        raise InputError(
            path,
            f"vertices[{bad[0]}]",
            vertices[bad[0]].tolist(),
            "coordinates must be finite; repair the mesh",
        )
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    # Drop faces without area: they cannot be hit and have no normal
    faces, kept, dropped = _with_area(vertices, faces)
    given = mesh._cache.cache.get("vertex_normals") if hasattr(mesh, "_cache") else None
    if given is not None and np.shape(given) == vertices.shape and np.isfinite(given).all():
        inverse = (
            np.linalg.inv(matrix[:3, :3]) if abs(np.linalg.det(matrix[:3, :3])) > 0 else np.eye(3)
        )
        normals = _unit(np.asarray(given, np.float64) @ inverse)[faces]
    else:
        normals = corner_normals(vertices, faces)
    uv, colours, material = _looks(mesh, path, len(vertices), kept)
    notes = (f"dropped {dropped} faces without area",) if dropped else ()
    return Mesh(
        vertices,
        faces,
        normals.astype(np.float32),
        np.zeros(len(faces), np.int32),
        (material,),
        uv,
        colours,
        notes,
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
    """Return unit normals (m, 3, 3), one a corner: the area-weighted mean of the faces about the corner's
    point that meet this face at less than the crease angle, wherever a seam splits the point's vertices."""
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
    smooth = _unit(normals).reshape(count, 3, 3)
    return np.where(np.any(smooth != 0, axis=2, keepdims=True), smooth, unit[:, None])


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, where=length > 0, out=np.zeros_like(vectors))


def _looks(
    mesh: Any, path: Path, count: int, kept: NDArray[np.bool_]
) -> tuple[NDArray[np.float32] | None, NDArray[np.float32] | None, Material]:
    """Return uv, vertex colours and material of one trimesh geometry, all linear."""
    visual = mesh.visual
    stored_linear = path.suffix.lower() in (".glb", ".gltf")
    uv, material, raw = None, Material(), None
    if getattr(visual, "kind", None) == "texture":
        raw = visual.vertex_attributes.get("color")
        uv = None if visual.uv is None else np.asarray(visual.uv, np.float32)
        if uv is not None and (uv.shape != (count, 2) or not np.isfinite(uv).all()):
            uv = None
        material = _material(visual.material, has_uv=uv is not None)
    elif getattr(visual, "kind", None) == "vertex":
        raw, material = visual.vertex_colors, Material(base_color=(1.0, 1.0, 1.0))
    elif getattr(visual, "kind", None) == "face":
        shade = _colours(visual.face_colors[kept].mean(axis=0)[None], stored_linear)[0]
        material = Material(base_color=(float(shade[0]), float(shade[1]), float(shade[2])))
    colours = None if raw is None else _colours(np.asarray(raw), stored_linear)
    if colours is not None and len(colours) != count:
        colours = None
    return uv, colours, material


def _colours(raw: NDArray[Any], stored_linear: bool) -> NDArray[np.float32]:
    """Bring vertex colours (n, 3 or 4) of any type to linear 0..1; integers outside glTF are sRGB."""
    top = float(np.iinfo(raw.dtype).max) if raw.dtype.kind in "iu" else 1.0
    colours = np.nan_to_num(raw[:, :3].astype(np.float64) / top).clip(0, 1)
    return (colours if stored_linear else srgb_decode(colours)).astype(np.float32)


def _material(material: Any, *, has_uv: bool) -> Material:
    pbr = (
        material.to_pbr()
        if hasattr(material, "to_pbr") and not hasattr(material, "baseColorFactor")
        else material
    )
    factor = getattr(pbr, "baseColorFactor", None)
    image = getattr(pbr, "baseColorTexture", None) if has_uv else None
    base = np.ones(4) if factor is None else np.asarray(factor, np.float64)
    base = base / 255 if base.max() > 1 else base
    texture = None
    if image is not None:
        texture = srgb_decode(
            np.asarray(image.convert("RGB"), np.float32) / np.float32(255)
        ).astype(np.float32)
    metallic, roughness = (
        getattr(pbr, "metallicFactor", None),
        getattr(pbr, "roughnessFactor", None),
    )
    return Material(
        name=str(getattr(pbr, "name", "") or ""),
        base_color=(float(base[0]), float(base[1]), float(base[2])),
        texture=texture,
        metallic=0.0 if metallic is None else float(metallic),
        roughness=0.7 if roughness is None else float(roughness),
        double_sided=bool(getattr(pbr, "doubleSided", False)),
    )


def _joined(parts: list[Mesh], path: Path) -> Mesh:
    """Concatenate parts; one without uv or colours gets neutral ones where another has them."""
    if sum(len(p.faces) for p in parts) > MAX_FACES:
        raise InputError(
            path,
            "faces",
            sum(len(p.faces) for p in parts),
            f"the limit is {MAX_FACES}; simplify the mesh",
        )
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
