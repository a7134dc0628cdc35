"""Edges are halved until all are short; the surface stays where it was and nothing tears."""

import numpy as np
import pytest

from bake import subdivision
from formats.errors import InputError
from formats.mesh import Mesh
from tests.bake.small_meshes import box, joined, mesh_of, plate, sphere


def edges(mesh: Mesh) -> np.ndarray:
    ends = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    return np.asarray(ends)


def lengths(mesh: Mesh) -> np.ndarray:
    a, b = mesh.vertices[edges(mesh)].swapaxes(0, 1)
    return np.asarray(np.linalg.norm(a - b, axis=1))


def area(mesh: Mesh) -> np.ndarray:
    """Vector areas (m, 3) of the faces."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return np.asarray(np.cross(b - a, c - a) / 2)


@pytest.mark.parametrize("longest", [3.0, 1.1, 0.5, 0.13])
def test_no_edge_stays_long_and_the_area_stays(longest: float) -> None:
    mesh = box((1.0, 0.6, 0.3))
    cut = subdivision.subdivide(mesh, longest)
    assert lengths(cut).max() <= longest
    # No face turned over and none overlaps: areas along each axis add up as before
    for sign in (1, -1):
        before, after = (np.maximum(sign * area(m), 0).sum(axis=0) for m in (mesh, cut))
        np.testing.assert_allclose(after, before, rtol=1e-12)


def test_a_closed_mesh_stays_closed(rng: np.random.Generator) -> None:
    mesh = sphere(6, 9)
    mesh = mesh_of(mesh.vertices * rng.uniform(0.5, 2, (len(mesh.vertices), 1)), mesh.faces)
    cut = subdivision.subdivide(mesh, 0.4)
    assert len(cut.faces) > 2 * len(mesh.faces)
    ways, count = np.unique(edges(cut), axis=0, return_counts=True)
    assert count.max() == 1
    # Each edge is there the other way round, once
    assert {tuple(w) for w in ways} == {tuple(w[::-1]) for w in ways}


def test_what_vertices_carry_is_interpolated() -> None:
    flat = plate(half=1.0)
    mesh = mesh_of(
        flat.vertices,
        flat.faces,
        uv=flat.vertices[:, :2].astype(np.float32),
        colours=(0.5 + 0.5 * flat.vertices).astype(np.float32),
    )
    cut = subdivision.subdivide(mesh, 0.3)
    assert cut.uv is not None
    assert cut.colours is not None
    # Halves of halves of -1 and 1 are exact
    np.testing.assert_array_equal(cut.uv, cut.vertices[:, :2])
    np.testing.assert_array_equal(cut.colours, (0.5 + 0.5 * cut.vertices).astype(np.float32))
    np.testing.assert_array_equal(cut.normals, np.broadcast_to([0, 0, 1], cut.normals.shape))


def test_normals_between_corners_stay_unit() -> None:
    cut = subdivision.subdivide(sphere(4, 6), 0.2)
    np.testing.assert_allclose(np.linalg.norm(cut.normals, axis=-1), 1, atol=1e-6)


def test_materials_stay_with_their_faces() -> None:
    cut = subdivision.subdivide(joined(plate((0, 1, 0)), plate((1, 0, 0))), 0.4)
    up = np.abs(area(cut)[:, 1]) > 1e-9
    assert set(cut.material[up]) & set(cut.material[~up]) == set()


def test_too_many_faces_are_refused() -> None:
    with pytest.raises(InputError, match="edge"):
        subdivision.subdivide(plate(half=1.0), 1e-4)
