"""A mesh in order, or a refusal that names the array."""

from dataclasses import replace

import numpy as np
import pytest

from formats.errors import InputError
from formats.mesh import LARGEST, Material, Mesh

GOOD = Mesh(
    vertices=np.eye(3),
    faces=np.array([[0, 1, 2]]),
    normals=np.full((1, 3, 3), 3**-0.5, np.float32),
    material=np.zeros(1, np.int32),
    materials=(Material(),),
    uv=np.zeros((3, 2), np.float32),
    colours=np.ones((3, 3), np.float32),
    notes=("a note",),
)


def test_a_good_mesh_passes_as_it_is():
    checked = GOOD.checked()
    for name in ("vertices", "faces", "normals", "material", "uv", "colours"):
        found = getattr(checked, name)
        np.testing.assert_array_equal(found, getattr(GOOD, name))
        assert found.flags.c_contiguous
    assert checked.notes == GOOD.notes
    assert replace(GOOD, uv=None, colours=None).checked().uv is None


def test_layouts_and_types_are_brought_to_the_declared_ones():
    odd = replace(
        GOOD,
        vertices=np.asfortranarray(np.eye(3, dtype=">f8")),
        faces=np.array([[0, 1, 2]], np.uint8),
        normals=GOOD.normals.astype(np.float64),
        uv=np.zeros((3, 4), np.float32)[:, ::2],
    ).checked()
    assert odd.vertices.dtype == np.float64
    assert odd.vertices.dtype.isnative
    assert odd.faces.dtype == np.int64
    assert odd.normals.dtype == np.float32
    assert odd.uv.flags.c_contiguous


def spoilt(array, value):
    changed = np.array(array)
    changed.reshape(-1)[-1] = value
    return changed


BAD = {
    "NaN vertex": ("vertices", spoilt(GOOD.vertices, np.nan)),
    "infinite vertex": ("vertices", spoilt(GOOD.vertices, np.inf)),
    "vertex beyond the largest": ("vertices", spoilt(GOOD.vertices, 1.1 * LARGEST)),
    "flat vertices": ("vertices", np.zeros(9)),
    "text": ("vertices", GOOD.vertices.astype(str)),
    "index beyond the last": ("faces", spoilt(GOOD.faces, 3)),
    "negative index": ("faces", spoilt(GOOD.faces, -1)),
    "float faces": ("faces", GOOD.faces.astype(float)),
    "quads": ("faces", np.zeros((1, 4), np.int64)),
    "normals a vertex": ("normals", np.zeros((3, 3), np.float32)),
    "long normal": ("normals", spoilt(GOOD.normals, 2.0)),
    "NaN normal": ("normals", spoilt(GOOD.normals, np.nan)),
    "material beyond the last": ("material", np.ones(1, np.int32)),
    "uv of other vertices": ("uv", np.zeros((4, 2), np.float32)),
    "NaN uv": ("uv", spoilt(GOOD.uv, np.nan)),
    "negative colour": ("colours", spoilt(GOOD.colours, -0.1)),
    "colour above one": ("colours", spoilt(GOOD.colours, 1.1)),
}


@pytest.mark.parametrize(("field", "value"), BAD.values(), ids=BAD)
def test_bad_arrays_are_named(field, value):
    with pytest.raises(InputError) as refusal:
        replace(GOOD, **{field: value}).checked("tree.glb")
    assert refusal.value.field == field
    assert str(refusal.value).startswith("tree.glb: " + field)


BAD_MATERIALS = [
    (Material(base_color=(0.5, np.nan, 0.5)), "base_color[1] nan"),
    (Material(base_color=(0.5, 0.5, 1.5)), "base_color[2] 1.5"),
    (Material(metallic=-0.1), "metallic -0.1"),
    (Material(roughness=np.inf), "roughness inf"),
    (Material(texture=np.zeros((2, 2, 4), np.float32)), "texture is float32 (2, 2, 4)"),
    (Material(texture=np.zeros((2, 2, 3), np.uint8)), "texture is uint8"),
    (Material(texture=np.zeros((0, 2, 3), np.float32)), "texture is empty"),
    (Material(texture=np.full((2, 2, 3), np.nan, np.float32)), "texture is empty, or not from 0"),
]


@pytest.mark.parametrize(("material", "fault"), BAD_MATERIALS)
def test_bad_materials_are_named(material, fault):
    assert fault in material.fault()
    with pytest.raises(InputError) as refusal:
        replace(GOOD, materials=(Material(), material)).checked()
    assert refusal.value.field == "materials[1]"


def test_good_materials_have_no_fault():
    assert Material().fault() == ""
    assert (
        Material(texture=np.ones((2, 3, 3), np.float32), metallic=1.0, roughness=0.0).fault() == ""
    )
