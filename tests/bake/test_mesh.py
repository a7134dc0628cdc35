"""A mesh made ready for the player keeps what can be seen."""

from dataclasses import replace

import numpy as np
import pytest

from bake import mesh as stage
from formats.errors import InputError
from formats.mesh import Material, Mesh

PARAMS = stage.Params()


def strip(*materials, vertices=None):
    """Three triangles in a row, material i for triangle i."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0.0]])
    return Mesh(
        vertices=points if vertices is None else vertices,
        faces=np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4]]),
        normals=np.tile(np.float32([0, 0, 1]), (3, 3, 1)),
        material=np.arange(3, dtype=np.int32),
        materials=materials,
    )


def test_equal_materials_become_one_and_others_stay():
    picture = np.ones((2, 2, 3), np.float32)
    a, b = Material("a", texture=picture), Material("b", texture=picture.copy())
    found = stage.prepare(strip(a, b, replace(a, emissive=(1, 0, 0))), params=PARAMS)
    assert [m.emissive for m in found.materials] == [(0.0, 0.0, 0.0), (1, 0, 0)]
    assert found.material.tolist() == [0, 0, 1]
    for change in (
        {"base_color": (0.1, 0.1, 0.1)},
        {"texture": 0.5 * picture},
        {"texture": np.ones((1, 4, 3), np.float32)},
        {"double_sided": True},
        {"roughness": 0.1},
        {"metallic": 0.1},
    ):
        found = stage.prepare(strip(a, b, replace(a, **change)), params=PARAMS)
        assert len(found.materials) == 2, change


def test_faces_that_vanish_in_float32_are_dropped_and_told():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1e-9, 0], [0, 2, 0.0]])
    points[2:] += [1000, 1000, 0]
    points[3] = points[2] + [1e-6, 0, 0]  # a float32 near 1000 is no finer than 6e-5
    found = stage.prepare(strip(*[Material()] * 3, vertices=points), params=PARAMS)
    assert len(found.faces) == len(found.normals) == len(found.material) == 1
    assert found.notes == ("dropped 2 faces without area in float32",)


def test_a_sound_mesh_keeps_every_face():
    sound = strip(*[Material()] * 3)
    found = stage.prepare(sound, params=PARAMS)
    np.testing.assert_array_equal(found.faces, sound.faces)
    assert found.notes == ()


def test_nothing_left_and_far_away_are_refused():
    with pytest.raises(InputError, match="area"):
        stage.prepare(strip(*[Material()] * 3, vertices=np.zeros((5, 3))), params=PARAMS)
    far = np.full((5, 3), 2e6)
    with pytest.raises(InputError, match="1e\\+06"):
        stage.prepare(strip(*[Material()] * 3, vertices=far), params=PARAMS)
