"""Meshes from files: what each format says, what is mended, what is refused."""

import os
import struct
from pathlib import Path

import numpy as np
import pytest

from bake import sources
from formats.errors import InputError
from formats.files import glb
from formats.mesh import Mesh
from tests.bake import small_meshes, stage_battery
from tests.bake.mesh_files import TRIANGLE, glb_of, gltf_of, texture, triangle, write

# OBJ


def test_obj_normals_are_kept(tmp_path):
    text = TRIANGLE + "vn 1 0 0\nvn 0 1 0\nvn 0 0 1\nf 1//1 2//2 3//3\n"
    mesh = sources.load(write(tmp_path, "normals.obj", text))
    np.testing.assert_allclose(mesh.normals, [np.eye(3)], atol=1e-7)


def test_obj_polygons_are_cut_into_triangles(tmp_path):
    text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n"
    mesh = sources.load(write(tmp_path, "quad.obj", text))
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(4)


# PLY, STL, OFF


def stl_of(mesh):
    records = [struct.pack("<12f2x", 0, 0, 0, *mesh.vertices[face].ravel()) for face in mesh.faces]
    return b"\0" * 80 + struct.pack("<I", len(records)) + b"".join(records)


def test_stl_is_smoothed_across_its_separate_triangles(tmp_path):
    path = write(tmp_path, "ball.stl", stl_of(small_meshes.sphere(16, 32)))
    mesh = sources.load(path)
    assert len(mesh.vertices) == 3 * len(mesh.faces)
    outward = mesh.vertices[mesh.faces]
    # Area-weighted: off the true normal by a fraction of the facets' angle of .2 rad
    error = np.linalg.norm(mesh.normals - outward, axis=-1).max()
    assert error < 0.05


def test_off(tmp_path):
    path = write(tmp_path, "one.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    np.testing.assert_allclose(sources.load(path).vertices[2], [0, 1, 0])


# GLB


def test_glb_normals_follow_scaled_and_mirrored_nodes(tmp_path):
    """A sphere squashed, mirrored and moved: normals of an ellipsoid, faces still looking out."""
    ball = small_meshes.sphere(24, 48)
    points = np.asarray(ball.vertices, np.float32)
    primitive = glb.Primitive(points, ball.faces.astype(np.uint32), normals=points)
    matrix = np.diag([-2.0, 0.5, 1.0, 1.0])
    matrix[:3, 3] = [5, 6, 7]
    mesh = sources.load(glb_of(tmp_path / "m.glb", [glb.Node("n", (primitive,), matrix)]))
    local = mesh.vertices[mesh.faces] - [5, 6, 7]
    expected = local / np.square([2.0, 0.5, 1.0])
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(mesh.normals, expected, atol=1e-5)  # float32 vertices and normals
    a, b, c = (local[:, i] for i in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c)
    assert (outward > 0).all()


def test_glb_nodes_are_placed_in_the_world(tmp_path):
    nodes = []
    for x in (0.0, 10.0):
        matrix = np.eye(4)
        matrix[0, 3] = x
        nodes.append(glb.Node(f"n{x}", (triangle(material=glb.Material(f"m{x}")),), matrix))
    mesh = sources.load(glb_of(tmp_path / "two.glb", nodes))
    assert len(mesh.faces) == 2
    corners = sorted(float(mesh.vertices[face][:, 0].min()) for face in mesh.faces)
    assert corners == [0.0, 10.0]
    far = [mesh.vertices[face][:, 0].min() > 5 for face in mesh.faces]
    names = [mesh.materials[i].name for i in mesh.material]
    assert names == ["m10.0" if f else "m0.0" for f in far]


def test_nested_transforms_and_a_side_buffer(tmp_path):
    path = gltf_of(tmp_path)
    mesh = sources.load(path)
    found = {tuple(v) for v in mesh.vertices.tolist()}
    assert found == {(10, 0, 0), (9, 0, 0), (10, 1, 0)}
    # Mirrored: the face is turned so that it looks to +z as the artist's did
    np.testing.assert_allclose(mesh.normals[0], [[0, 0, 1]] * 3, atol=1e-7)
    assert sources.files(path) == (path, tmp_path / "a buffer.bin")


# Parts


def test_parts_of_different_kinds_are_joined(tmp_path):
    plain = glb.Node("a", (triangle(),))
    shift = np.eye(4)
    shift[2, 3] = 2
    colours = np.full((3, 3), 0.25, np.float32)
    coloured = glb.Node("b", (triangle(colours=colours, uv=np.zeros((3, 2), np.float32)),), shift)
    mesh = sources.load(glb_of(tmp_path / "parts.glb", [plain, coloured])).checked()
    part = mesh.vertices[mesh.faces][:, 0, 2] > 1
    np.testing.assert_allclose(mesh.colours[mesh.faces[part]], 0.25, atol=0.5 / 255)
    # White where a part has none: it multiplies
    np.testing.assert_array_equal(mesh.colours[mesh.faces[~part]], 1)


# Normals


def test_a_box_keeps_flat_faces():
    box = small_meshes.box((1.0, 2.0, 3.0))
    a, b, c = (box.vertices[box.faces[:, i]] for i in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    np.testing.assert_allclose(box.normals, np.repeat(flat[:, None], 3, axis=1), atol=1e-7)


def test_a_sphere_becomes_smooth():
    ball = small_meshes.sphere(16, 32)
    outward = ball.vertices[ball.faces]
    assert np.abs(np.linalg.norm(ball.normals, axis=-1) - 1).max() < 1e-6
    # Facets turn by .2 rad, flat normals would be off by half of that (measured: .034)
    assert np.linalg.norm(ball.normals - outward, axis=-1).max() < 0.04


@pytest.mark.parametrize(("angle", "smooth"), [(30, True), (39, True), (41, False), (90, False)])
def test_the_crease_angle(angle, smooth):
    """Two squares that share an edge of separate vertices, at some angle."""
    s, c = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    points = [
        [0, 0, 0],
        [1, 0, 0],
        [1, 1, 0],
        [0, 1, 0],
        [1, 0, 0],
        [1, 1, 0],
        [1 + c, 1, -s],
        [1 + c, 0, -s],
    ]
    faces = [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]]
    normals = sources.corner_normals(np.array(points, float), np.array(faces))
    shared = normals[0, 1]  # of vertex 1, on the first square
    assert bool(abs(shared[0]) > 0.01) == smooth
    np.testing.assert_allclose(normals[0, 0], [0, 0, 1], atol=1e-12)


def slow_corner_normals(vertices, faces):
    areas = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    unit = areas / np.linalg.norm(areas, axis=1, keepdims=True)
    normals = np.zeros((len(faces), 3, 3))
    for f, corners in enumerate(faces):
        for i, corner in enumerate(corners):
            for g, others in enumerate(faces):
                touches = any((vertices[o] == vertices[corner]).all() for o in others)
                if touches and unit[f] @ unit[g] > np.cos(np.radians(40)):
                    normals[f, i] += areas[g]
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def test_corner_normals_against_the_slow_version(rng):
    ball = small_meshes.sphere(6, 9)
    bumpy = ball.vertices * rng.uniform(0.7, 1.3, (len(ball.vertices), 1))
    expected = slow_corner_normals(bumpy, ball.faces)
    np.testing.assert_allclose(sources.corner_normals(bumpy, ball.faces), expected, atol=1e-12)


def test_faces_without_area_are_dropped_and_noted(tmp_path):
    path = write(tmp_path, "thin.obj", TRIANGLE + "v 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\n")
    mesh = sources.load(path)
    assert len(mesh.faces) == 1
    assert mesh.notes == ("dropped 2 faces without area",)


# Refusals


REFUSED = {
    "missing.obj": None,
    "empty.obj": b"",
    "points.obj": TRIANGLE.encode(),
    "flat.obj": (TRIANGLE + "v 2 0 0\nf 1 2 4\n").encode(),
    "nan.obj": b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
    "infinite.obj": b"v 0 0 0\nv 1e999 0 0\nv 0 1 0\nf 1 2 3\n",
    "beyond.obj": (TRIANGLE + "f 1 2 9\n").encode(),
    "words.obj": b"v a b c\nf 1 2 3\n",
    "picture.fbx": b"Kaydara FBX Binary",
    "noise.glb": b"glTF" + bytes(range(200)),
    "noise.stl": bytes(range(100)),
    "noise.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\n",
    "cut.gltf": b'{"asset": {"version": "2.0"}, "meshes": [',
    "deep.gltf": b"[" * 100_000,
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_mesh_is_refused_in_one_line(name, tmp_path):
    path = tmp_path / name
    if REFUSED[name] is not None:
        path.write_bytes(REFUSED[name])
    with pytest.raises(InputError) as refusal:
        sources.load(path)
    assert name in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert refusal.value.exit_code == 2
    # Its files can be listed all the same: a store asks before it loads
    assert sources.files(path)[0] == path


def test_nan_in_a_vertex_without_faces_does_not_matter(tmp_path):
    path = write(tmp_path, "spare.obj", TRIANGLE + "v nan nan nan\nf 1 2 3\n")
    stage_battery.require_finite(sources.load(path))


def test_damaged_bytes_end_in_a_mesh_or_one_refusal(tmp_path, rng):
    """A GLB and an OBJ with a few wrong bytes: finite or refused, never another exception."""
    uv = np.zeros((3, 2), np.float32)
    png = texture(tmp_path, "t.png").read_bytes()
    whole = glb_of(
        tmp_path / "w.glb", [glb.Node("n", (triangle(uv=uv, material=glb.Material(texture=png)),))]
    ).read_bytes()
    text = ("mtllib t.mtl\n" + TRIANGLE + "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n").encode()
    outcomes = set()
    for name, data in (("d.glb", whole), ("d.obj", text)):
        for _ in range(120):
            damaged = np.frombuffer(data, np.uint8).copy()
            where = rng.integers(0, len(damaged), rng.integers(1, 5))
            damaged[where] = rng.integers(0, 256, len(where))
            path = write(tmp_path, name, damaged.tobytes())
            outcomes.add(outcome(path))
    assert outcomes == {"mesh", "refused"}


def outcome(path):
    try:
        mesh = sources.load(path)
    except InputError as error:
        return "refused" if "\n" not in str(error) else "refused in two lines"
    assert isinstance(mesh, Mesh)
    stage_battery.require_finite(mesh.checked(path))
    return "mesh"


# Side files


def test_side_files_stay_in_the_folder(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    texture(tmp_path, "secret.png")
    write(tmp_path, "secret.mtl", "newmtl m\nKd 1 0 0\n")
    (inner / "link.png").symlink_to(tmp_path / "secret.png")
    maps = "".join(
        f"map_Kd {n}\n" for n in ("../secret.png", "link.png", str(tmp_path / "secret.png"))
    )
    mtl = write(inner, "m.mtl", "newmtl m\nKd 0 1 0\n" + maps)
    text = "mtllib ../secret.mtl\nmtllib m.mtl\n" + TRIANGLE + "usemtl m\nf 1 2 3\n"
    path = write(inner, "m.obj", text)
    assert sources.files(path) == (path, mtl)
    gltf_of(inner)
    outside = gltf_of(inner, buffers=[{"uri": "../inner/../secret.mtl", "byteLength": 36}])
    assert sources.files(outside) == (outside,)
    with pytest.raises(InputError):
        sources.load(outside)


def test_side_files_are_found_where_they_are_read(tmp_path):
    """Case, blanks, a path from another machine whose last part is here, percent signs."""
    texture(tmp_path, "My Bark.png")
    texture(tmp_path, "far.png")
    texture(tmp_path, "50%25.png")
    lines = ["newmtl m", "Kd 1 1 1", "\tmap_kd  My Bark.png ", "MAP_KD C:/x/far.png"]
    lines += ["map_Kd 50%25.png", "map_Kd gone.png", ""]
    mtl = write(tmp_path, "a tree.mtl", "\r\n".join(lines))
    path = write(tmp_path, "a tree.obj", "  mtllib a tree.mtl\r\n" + TRIANGLE + "f 1 2 3\n")
    names = [p.name for p in sources.files(path)]
    assert names == ["a tree.obj", "a tree.mtl", "My Bark.png", "far.png", "50%25.png"]
    assert mtl in sources.files(path)


def test_formats_of_one_file_have_no_others(tmp_path):
    for name in ("a.glb", "a.stl", "a.ply"):
        path = write(tmp_path, name, b"mtllib a.mtl")
        assert sources.files(path) == (path,)


# Real files


@pytest.mark.skipif(
    "BAKELIGHT_DATA" not in os.environ, reason="BAKELIGHT_DATA is not set: hard mesh files"
)
def test_hard_files_end_in_a_mesh_or_one_refusal():
    files = [p for p in (Path(os.environ["BAKELIGHT_DATA"]) / "meshes").rglob("*") if p.is_file()]
    known = [p for p in files if p.suffix.lower() in sources.SUFFIXES]
    outcomes = [outcome(path) for path in known]
    assert all(outcome(path) == "refused" for path in files if path not in known)
    # As counted: of 72 mesh files 53 hold triangles, 19 are empty or hold points only
    assert outcomes.count("mesh") >= 50
    assert outcomes.count("refused") >= 15
    assert all(path in sources.files(path) for path in known)
