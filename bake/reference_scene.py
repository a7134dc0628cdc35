"""A scene at one moment as one Embree scene: meshes, sprites as the meshes they were baked from,
cubes as squares, and a ground that is a plane without triangles.

Memory: 1.8 GB measured for 3.7 million triangles, Embree's own included; MAX_TRIANGLES take 2.4 GB.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bake import billboard, reference_cubes, sources
from formats.errors import InputError
from formats.mesh import Mesh
from formats.scene import Billboards, Scene
from maths import transforms

Array = NDArray[np.float64]

MAX_TRIANGLES = 5_000_000


@dataclass(frozen=True, eq=False)
class Part:
    """One mesh at k places. world_from_mesh : (k, 4, 4), each a scale, turn, mirror and shift.
    tint : (k, 3) factors on its colour. transmission : of its thin sheets."""

    mesh: Mesh
    world_from_mesh: Array
    tint: Array
    transmission: float = 0.0


@dataclass(frozen=True, eq=False)
class Merged:
    """All parts as one mesh in world space. instance : (m,) a face's place, an index into tint
    (places, 3). transmission : of each material."""

    mesh: Mesh
    instance: NDArray[np.int32]
    tint: Array
    transmission: Array


def parts_of(scene: Scene, time: float, yaw: float, eye: Array) -> tuple[list[Part], list[str]]:
    """Return what stands in a scene at `time`, and notes on what cannot be traced.

    yaw : of the camera, radians, which sprites share. eye : (3,) the camera's place, which chooses
    their view. Raises InputError for a source that cannot be read and for too many triangles.
    """
    read: dict[Path, Mesh] = {}
    parts, notes = [], []
    for mesh in scene.meshes:
        place = mesh.world_from_mesh(time)[None]
        parts.append(Part(_read(mesh.source, read), place, np.ones((1, 3))))
    for group in scene.billboards:
        if group.pictured:
            notes.append(f"{group.name}: left out, a picture has no mesh to trace")
        elif group.photographed:
            notes.append(f"{group.name}: left out, photographs have no mesh to trace")
        elif len(group.instances()):
            parts.append(_sprites(group, _read(group.source, read), yaw, eye))
    notes += [f"{each.name}: left out, particles are not traced" for each in scene.particles]
    for cubes in reference_cubes.meshes(scene, time, most=MAX_TRIANGLES):
        parts.append(Part(cubes, np.eye(4)[None], np.ones((1, 3))))
    total = sum(len(part.mesh.faces) * len(part.tint) for part in parts)
    if total > MAX_TRIANGLES:
        remedy = f"the reference traces at most {MAX_TRIANGLES:,}; leave out some sprites or cells"
        raise InputError(scene.file, "triangles", f"{total:,}", remedy)
    return parts, notes


def _read(source: Path, read: dict[Path, Mesh]) -> Mesh:
    if source not in read:
        read[source] = sources.load(source).checked(source)
    return read[source]


def _sprites(group: Billboards, mesh: Mesh, yaw: float, eye: Array) -> Part:
    """Stand the source of a set where its sprites are, turned and mirrored as they are drawn."""
    instances = group.instances()
    frame = billboard.frame_of(mesh, billboard.Params(resolution=64, views=1))
    scale = group.height / frame.object_height * instances.scale
    towards = eye - instances.positions
    # The view of the bake that is nearest to where it is seen from
    step = 2 * np.pi / group.views
    azimuth = np.arctan2(towards[:, 0], towards[:, 2]) - instances.yaw
    view = np.rint(azimuth / step).astype(np.int64) % group.views
    turned = np.stack([transforms.rotation("y", -step * v) for v in range(group.views)])[view]
    turned[instances.flip, 0] *= -1
    place = np.tile(np.eye(4), (len(instances), 1, 1))
    place[:, :3, :3] = transforms.rotation("y", yaw) @ turned * scale[:, None, None]
    place[:, :3, 3] = instances.positions - place[:, :3, :3] @ frame.origin
    return Part(mesh, place, np.asarray(instances.tint, np.float64), group.transmission)


def merged(parts: list[Part]) -> Merged:
    """Put parts into one mesh in world space, an instance at a time."""
    counts = [(len(p.tint), len(p.mesh.vertices), len(p.mesh.faces)) for p in parts]
    points, faces = (sum(c[0] * c[i] for c in counts) for i in (1, 2))
    coloured = any(p.mesh.colours is not None for p in parts)
    textured = any(p.mesh.uv is not None for p in parts)
    into = Mesh(
        vertices=np.empty((points, 3)),
        faces=np.empty((faces, 3), np.int64),
        normals=np.empty((faces, 3, 3), np.float32),
        material=np.empty(faces, np.int32),
        materials=tuple(m for p in parts for m in p.mesh.materials),
        uv=np.zeros((points, 2), np.float32) if textured else None,
        colours=np.ones((points, 3), np.float32) if coloured else None,
    )
    instance, number = np.empty(faces, np.int32), 0
    point = face = material = 0
    for part in parts:
        for matrix in part.world_from_mesh:
            _put(into, part.mesh, matrix, point, face, material)
            instance[face : face + len(part.mesh.faces)] = number
            point, face = point + len(part.mesh.vertices), face + len(part.mesh.faces)
            number += 1
        material += len(part.mesh.materials)
    return Merged(
        mesh=into,
        instance=instance,
        tint=np.concatenate([p.tint for p in parts] or [np.ones((0, 3))]),
        transmission=np.array([p.transmission for p in parts for _ in p.mesh.materials]),
    )


def _put(into: Mesh, mesh: Mesh, matrix: Array, point: int, face: int, material: int) -> None:
    """Copy a mesh under a similarity into the arrays of another, from these rows on."""
    linear = matrix[:3, :3]
    points = slice(point, point + len(mesh.vertices))
    faces = slice(face, face + len(mesh.faces))
    into.vertices[points] = mesh.vertices @ linear.T + matrix[:3, 3]
    unit = linear / np.cbrt(np.abs(np.linalg.det(linear)))
    # A mirrored face is wound the other way round
    order = slice(None, None, -1 if np.linalg.det(linear) < 0 else 1)
    into.faces[faces] = mesh.faces[:, order] + point
    into.normals[faces] = (mesh.normals @ unit.T.astype(np.float32))[:, order]
    into.material[faces] = mesh.material + material
    if into.uv is not None and mesh.uv is not None:
        into.uv[points] = mesh.uv
    if into.colours is not None and mesh.colours is not None:
        into.colours[points] = mesh.colours
