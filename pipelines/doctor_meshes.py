"""What is wrong with a mesh, and with a model of cubes, and what a bake will do about it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.mesh import Mesh
from pipelines.diagnosis import Diagnosis, Level, amount

Array = NDArray[np.float64]
FAR = 1e4  # offset over size; float32 of a file keeps 7 digits, so 1e-3 of the size is left
NEEDLE = 1e-3  # height over longest side
GRID, CELLS = 32, 64  # of an occlusion volume and of a world of cubes, as by default
THIN = 0.02
LARGE, SMALL = 1e3, 1e-2  # metres; a scene gives sprites their height
HEAVY = 300_000  # faces


def mesh(path: Path) -> Diagnosis:
    """Read a mesh and look at it. InputError for what cannot be read."""
    from bake import sources

    found = sources.load(path)
    told = Diagnosis(str(path), "mesh")
    low, high = found.vertices.min(axis=0), found.vertices.max(axis=0)
    size = high - low
    longest = float(size.max())
    told.facts.append(
        f"{len(found.faces)} faces, {len(found.vertices)} vertices, "
        f"{' x '.join(f'{x:.3g}' for x in size)} m"
    )
    told.facts.append(_look(found))
    told.noted(found.notes)
    if longest == 0:
        told.find("fault", "the mesh has no size", 0, "m", "refused")
        return told.finished()
    _placed(told, (low + high) / 2, longest)
    _edges(told, found)
    _shapes(told, found)
    _thin(told, found)
    for what in _unsupported(path):
        told.find("note", what, 1, "", "left out")
    return told.finished()


def _look(found: Mesh) -> str:
    textures = [m.texture for m in found.materials if m.texture is not None]
    glow = sum(max(m.emissive) > 0 for m in found.materials)
    sheets = sum(m.double_sided for m in found.materials)
    parts = [amount(len(found.materials), "material"), amount(len(textures), "texture")]
    parts += [f"largest {max(t.shape[1] for t in textures)} texels wide"] if textures else []
    parts += [amount(glow, "glowing one")] if glow else []
    parts += [f"{sheets} double-sided (light passes)"] if sheets else []
    return ", ".join(parts) + (", colours at vertices" if found.colours is not None else "")


def _placed(told: Diagnosis, middle: Array, longest: float) -> None:
    from bake.mesh import LARGEST

    offset = float(np.abs(middle).max()) / longest
    if offset > FAR:
        bake = "moved to the origin in double precision; what the file lost stays lost"
        what = f"it lies {offset:.2g} times its size from the origin"
        told.find("warning", what, offset, "sizes", bake)
    reach = float(np.abs(middle).max()) + longest / 2
    if reach > LARGEST:
        bake = f"as a mesh of a scene and by transfer it is refused: they keep within {LARGEST:g} m"
        told.find("warning", f"it reaches {reach:.3g} m from the origin", reach, "m", bake)
    if not SMALL <= longest <= LARGE:
        what = f"its longest side is {longest:.3g} m"
        told.find("note", what, longest, "m", "sprites get the scene's height; give meshes a scale")


def _edges(told: Diagnosis, found: Mesh) -> None:
    """Count what keeps a surface from being closed and one-sided; corners at one place are one."""
    from bake.occlusion_inside import is_inverted

    same = np.unique(found.vertices + 0.0, axis=0, return_inverse=True)[1].ravel()
    faces = same[found.faces]
    kept = np.unique(np.sort(faces, axis=1), axis=0)
    doubled = len(faces) - len(kept)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    n = np.int64(len(found.vertices) + 1)
    undirected, count = np.unique(np.minimum(start, end) * n + np.maximum(start, end),
                                  return_counts=True)  # fmt: skip
    along = np.unique(start * n + end, return_counts=True)[1]
    open_edges, crowded = int(np.sum(count == 1)), int(np.sum(count > 2))
    twice = int(np.sum(along > 1))
    told.facts.append(f"{_parts(faces)} separate parts" if _parts(faces) > 1 else "one part")
    if open_edges:
        # Leaves are open on purpose: their materials say that they are sheets
        sheets = any(m.double_sided for m in found.materials)
        few = sheets or open_edges < 0.05 * len(undirected)
        level: Level = "note" if few else "warning"
        told.find(level, amount(open_edges, "open edge", len(undirected)), open_edges, "edges",
                  "inside is decided by votes of rays; no closedness is assumed")  # fmt: skip
    if crowded:
        told.find("note", amount(crowded, "edge") + " of more than two faces", crowded, "edges",
                  "taken as it is")  # fmt: skip
    if twice and not doubled:
        told.find(
            "warning",
            amount(twice, "edge") + " whose faces look to different sides",
            twice,
            "edges",
            "front and back are decided face by face; transfer sees some as backs",
        )
    if doubled:
        told.find("note", amount(doubled, "face", len(faces)) + " twice in the same place", doubled,
                  "faces", "harmless for rays; baked and drawn twice")  # fmt: skip
    if is_inverted(found.vertices, found.faces):
        told.find(
            "warning",
            "the surface is closed and looks inward",
            1,
            "",
            "occlusion turns it round; sprites and meshes see backs: flip its faces",
        )


def _parts(faces: NDArray[np.int64]) -> int:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    used, index = np.unique(faces, return_inverse=True)
    index = index.reshape(faces.shape)
    a, b = np.concatenate([index[:, :2], index[:, 1:]]).T
    graph = coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(len(used), len(used)))
    return int(connected_components(graph, directed=False, return_labels=False))


def _shapes(told: Diagnosis, found: Mesh) -> None:
    """Count needles, and what is heavy."""
    corners = found.vertices[found.faces]
    corners = (corners - corners.min((0, 1))) / np.ptp(found.vertices, axis=0).max()
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    needles = int(np.sum(area < NEEDLE * sides**2))
    if needles:
        told.find(
            "note",
            amount(needles, "needle", len(area)) + ", a thousand times as long as wide",
            needles,
            "faces",
            "rays meet them where they are; normals may be rough",
        )
    if len(found.faces) > HEAVY:
        told.find("note", f"{len(found.faces)} faces", len(found.faces), "faces",
                  "drawn as a mesh it is heavy; as a sprite it costs nothing")  # fmt: skip


def _thin(told: Diagnosis, found: Mesh) -> None:
    """Tell how much of the surface is thinner than a voxel of what is baked by default."""
    from bake.occlusion_inside import is_oriented, thin_share
    from bake.rays import RayScene

    used, faces = np.unique(found.faces, return_inverse=True)
    vertices = found.vertices[used]
    scene = RayScene(vertices, faces.reshape(-1, 3))
    half = np.ptp(vertices, axis=0) / 2 * scene.scale
    oriented = is_oriented(vertices, faces.reshape(-1, 3))
    for name, pitch in (
        (
            f"a voxel of an occlusion volume of {GRID}",
            4 * np.maximum(half, 0.25 * half.max()) / GRID,
        ),
        (f"a cube of a world of {CELLS}", np.full(3, 2 * half.max() / CELLS)),
    ):
        share = thin_share(scene, pitch, oriented=oriented)
        if share > THIN:
            metres = float(pitch.max() / scene.scale)
            what = f"{share:.0%} of the surface is sheets, or thinner than {name} ({metres:.2g} m)"
            told.find(
                "note",
                what,
                share,
                "of the area",
                "shadows of both sides mix there; a finer grid helps",
            )


TEXTURES = ("normalTexture", "occlusionTexture")
ROUGH = ("metallicRoughnessTexture",)


def _unsupported(path: Path) -> list[str]:
    """Return what a glTF file says of its surface that no stage uses."""
    tree = _tree(path)
    found = []
    for material in tree.get("materials", []):
        name = material.get("name") or "a material"
        rough = material.get("pbrMetallicRoughness", {})
        named = [t for t in TEXTURES if t in material] + [t for t in ROUGH if t in rough]
        found += [f"{name}: {', '.join(named)}"] if named else []
        mode = material.get("alphaMode", "OPAQUE")
        found += [f"{name}: alphaMode {mode}, taken as opaque"] if mode != "OPAQUE" else []
        found += [
            f"{name}: {x}"
            for x in material.get("extensions", {})
            if x != "KHR_materials_emissive_strength"
        ]
    for what in ("animations", "skins", "cameras"):
        found += [amount(len(tree[what]), what[:-1])] if tree.get(what) else []
    return found


def _tree(path: Path) -> dict[str, Any]:
    """Return the JSON of a glTF file, nothing of other files; it has been read before."""
    from formats.files.glb_buffers import unpack

    try:
        if path.suffix.lower() == ".glb":
            return unpack(path.read_bytes(), path)[0]
        found = json.loads(path.read_bytes()) if path.suffix.lower() == ".gltf" else {}
        return found if isinstance(found, dict) else {}
    except (ValueError, OSError):
        return {}


def voxels(path: Path) -> Diagnosis:
    """Read a model of cubes and look at it. InputError for what cannot be read."""
    from bake import voxels as stage
    from bake.voxel_faces import exposed_faces
    from formats.files import vox, vox_scene, xraw

    told = Diagnosis(str(path), "voxels")
    if path.suffix.lower() == ".vox":
        file = vox.read(path)
        world = stage.from_vox(file, params=stage.Params())
        placed = vox_scene.placements(file)
        hidden = sum(p.hidden for p in placed)
        told.facts.append(f"version {file.version}, {amount(len(placed), 'placed model')}")
        if hidden:
            told.find(
                "note", amount(hidden, "hidden model", len(placed)), hidden, "models", "left out"
            )
        if any(p.frames > 1 for p in placed):
            told.find("note", "an animation of models", 1, "", "its first frame is baked")
    else:
        world = stage.from_xraw(xraw.read(path), params=stage.Params())
    solid = world.solid
    faces = sum(int(exposed_faces(solid, a, s).sum()) for a in range(3) for s in (1, -1))
    size = " x ".join(str(n) for n in world.size)
    told.facts.append(f"{size} cells, {int(solid.sum())} solid, {amount(faces, 'exposed face')}")
    told.facts.append(f"a lightmap of 2 texels a side holds {faces * 4 / 1e6:.2g} million texels")
    told.noted(world.quality.get("notes", ()))
    rows = np.unique(world.cells[solid])
    told.facts.append(amount(len(rows), "colour"))
    if not world.glowing.any():
        told.find("note", "nothing glows", 0, "cells",
                  "light comes from outside, or name what glows with --emissive")  # fmt: skip
    if faces * 4 > 16384**2 / 2:
        told.find(
            "fault", "more faces than an atlas holds", faces, "faces", "refused: bake fewer texels"
        )
    return told.finished()
