"""A mesh in order, or a refusal that names the array."""

from dataclasses import replace

import numpy as np
import pytest

from formats import report, seal
from formats.errors import DamagedError, InputError
from formats.files import glb
from formats.mesh import LARGEST, NAME, Material, Mesh, primitives
from maths import colour

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
    (Material(emissive=(0.0, -1.0, 0.0)), "emissive[1] -1"),
    (Material(emissive=(np.inf, 0.0, 0.0)), "emissive[0] inf"),
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


@pytest.fixture
def painted(rng):
    """Two materials on a strip of triangles that share vertices, but not all their normals."""
    m = 6
    faces = np.arange(m)[:, None] + np.arange(3)
    normals = np.repeat(rng.normal(size=(m, 1, 3)), 3, axis=1)
    normals[2] = normals[1]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    # 8-bit sRGB codes: what a texture is stored as
    codes = rng.integers(0, 256, (4, 5, 3))
    picture = np.asarray(colour.srgb_decode(codes / 255), np.float32)
    return Mesh(
        vertices=rng.normal(size=(m + 2, 3)),
        faces=faces,
        normals=normals.astype(np.float32),
        material=np.array([1, 0, 1, 0, 1, 1], np.int32),
        materials=(
            Material("bark", (0.25, 0.5, 1.0), picture, 0.0, 0.5, True),
            Material("lamp", (1.0, 0.5, 0.25), None, 1.0, 0.25, False, (34.0, 15.0, 4.5)),
            Material("used by none"),
        ),
        uv=rng.uniform(-1, 2, (m + 2, 2)).astype(np.float32),
        colours=rng.uniform(0, 1, (m + 2, 3)).astype(np.float32),
        notes=("dropped 3 faces without area",),
    )


def by_face(mesh):
    """What each face is, faces in an order of their own: corners, normals, uv, colours, name."""
    names = np.array([m.name for m in mesh.materials])[mesh.material]
    order = np.lexsort((mesh.vertices[mesh.faces].astype(np.float32)[:, 0, 0], names))
    corners = mesh.faces[order]
    return names[order], [
        mesh.vertices[corners],
        mesh.normals[order],
        mesh.uv[corners],
        mesh.colours[corners],
    ]


def test_what_is_saved_is_loaded(tmp_path, painted):
    painted.save(tmp_path)
    found = Mesh.load(tmp_path)
    names, arrays = by_face(painted)
    loaded_names, loaded = by_face(found)
    assert loaded_names.tolist() == names.tolist()
    # Coordinates become float32; v is turned over and back; emission is divided and multiplied
    for expected, got in zip(arrays, loaded, strict=True):
        np.testing.assert_allclose(got, expected, rtol=2e-7, atol=3e-7)
    for material in found.materials:
        original = next(m for m in painted.materials if m.name == material.name)
        np.testing.assert_allclose(material.emissive, original.emissive, rtol=1e-12)
        for name in ("base_color", "metallic", "roughness", "double_sided"):
            assert getattr(material, name) == getattr(original, name)
    bark = next(m for m in found.materials if m.name == "bark")
    np.testing.assert_array_equal(bark.texture, painted.materials[0].texture)
    assert found.notes == painted.notes


def test_saving_again_gives_the_same_bytes_and_no_vertex_twice(tmp_path, painted):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        painted.save(tmp_path / name)
    assert (tmp_path / "a" / NAME).read_bytes() == (tmp_path / "b" / NAME).read_bytes()
    for part in primitives(tmp_path / "a"):
        rows = np.concatenate([part.positions, part.normals], axis=1)
        assert len(np.unique(rows, axis=0)) == len(rows) <= 3 * len(part.indices)
    smooth = replace(painted, normals=np.full((6, 3, 3), 3**-0.5, np.float32))
    smooth = replace(smooth, material=np.zeros(6, np.int32))
    (tmp_path / "c").mkdir()
    smooth.save(tmp_path / "c")
    (part,) = primitives(tmp_path / "c")
    assert len(part.positions) == len(painted.vertices)


def test_the_report_says_what_it_is(tmp_path, painted):
    painted.save(tmp_path)
    found = report.read(tmp_path)
    assert (found["kind"], found["faces"], found["textures"]) == ("mesh", 6, 1)
    assert [m["name"] for m in found["materials"]] == ["bark", "lamp"]
    assert found["emissive"]
    assert found["notes"] == ["dropped 3 faces without area"]
    expected = [painted.vertices.min(axis=0), painted.vertices.max(axis=0)]
    np.testing.assert_array_equal(found["bounds"], expected)


def test_a_mesh_without_faces_is_not_saved(tmp_path):
    empty = replace(
        GOOD,
        faces=np.zeros((0, 3), np.int64),
        normals=np.zeros((0, 3, 3), np.float32),
        material=np.zeros(0, np.int32),
    )
    with pytest.raises(InputError, match="faces"):
        empty.save(tmp_path)


def test_damage_is_found(tmp_path, painted):
    painted.save(tmp_path)
    seal.seal(tmp_path)
    data = bytearray((tmp_path / NAME).read_bytes())
    data[-5] ^= 1
    (tmp_path / NAME).write_bytes(bytes(data))
    with pytest.raises(DamagedError, match="sha256"):
        Mesh.load(tmp_path)


def test_another_kind_and_a_file_of_others_are_refused(tmp_path, painted):
    painted.save(tmp_path)
    glb.write(tmp_path / NAME, [glb.Node("x", (glb.Primitive(np.eye(3), [[0, 1, 2]]),))])
    with pytest.raises(DamagedError, match="normals"):
        Mesh.load(tmp_path)
    report.write(tmp_path, {"kind": "billboard", "format": 1})
    with pytest.raises(DamagedError, match="billboard"):
        Mesh.load(tmp_path)
