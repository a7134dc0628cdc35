"""GLB: what trimesh reads from our files, what we read from others', and what is refused."""

import io
import json
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from formats.errors import InputError
from formats.files import glb
from formats.files.glb_buffers import pack, unpack

TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.5]], np.float32)
CORNERS = np.array([[0, 1, 2]])


def _png(colour: tuple[int, int, int]) -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (2, 2), colour).save(stream, "PNG")
    return stream.getvalue()


def _rich(rng: np.random.Generator) -> list[glb.Node]:
    """Two nodes, three materials, every attribute."""
    leaf = glb.Material("leaf", (0.2, 0.5, 0.1, 1.0), roughness=0.8, double_sided=True)
    lamp = glb.Material("lamp", texture=_png((9, 8, 7)), emissive=(8.0, 2.0, 0.0))
    normals = np.tile([[0.0, 0.0, 1.0]], (3, 1))
    matrix = np.eye(4)
    matrix[:3, 3] = (1.0, 2.0, 3.0)
    first = glb.Primitive(
        TRIANGLE,
        CORNERS,
        normals=normals,
        uv=rng.random((3, 2)),
        colours=rng.integers(0, 256, (3, 3), np.uint8),
        attributes={"_B": rng.random((3, 4)), "_A": np.array([1, 2, 300], np.uint16)},
        material=lamp,
    )
    second = glb.Primitive(TRIANGLE, CORNERS, colours=rng.random((3, 4)), material=leaf)
    return [glb.Node("one", (first, second)), glb.Node("two", (second,), matrix)]


def test_everything_comes_back(tmp_path: Path, rng: np.random.Generator) -> None:
    nodes = _rich(rng)
    glb.write(tmp_path / "a.glb", nodes)
    back = glb.read(tmp_path / "a.glb")
    assert [node.name for node in back] == ["one", "two"]
    for old_node, new_node in zip(nodes, back, strict=True):
        np.testing.assert_array_equal(new_node.matrix, old_node.matrix)
        for old, new in zip(old_node.primitives, new_node.primitives, strict=True):
            assert new.material == old.material
            np.testing.assert_array_equal(new.indices, old.indices)
            for field in ("positions", "normals", "uv", "colours"):
                before, after = getattr(old, field), getattr(new, field)
                assert (before is None) == (after is None)
                if before is not None:
                    kind = before.dtype if before.dtype.kind == "u" else np.float32
                    np.testing.assert_array_equal(after, before.astype(kind), strict=True)
            assert sorted(new.attributes) == sorted(old.attributes)
            for name, values in old.attributes.items():
                np.testing.assert_array_equal(new.attributes[name], np.float32(values))


def test_trimesh_reads_the_same(tmp_path: Path, rng: np.random.Generator) -> None:
    glb.write(tmp_path / "a.glb", _rich(rng))
    scene = trimesh.load(tmp_path / "a.glb")
    meshes = list(scene.geometry.values())
    assert sorted(len(mesh.faces) for mesh in meshes) == [1, 1, 1]
    np.testing.assert_array_equal(scene.bounds, [[0, 0, 0], [2, 4, 3.5]])
    textured = next(m for m in meshes if m.visual.kind == "texture")
    assert textured.visual.material.baseColorTexture.getpixel((0, 0)) == (9, 8, 7)


@pytest.mark.parametrize("double_sided", [True, False])
def test_trimesh_sees_material_and_texture(double_sided: bool, tmp_path: Path) -> None:
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [0.25, 0.75]])
    material = glb.Material(
        "m", (0.2, 0.4, 0.6, 1.0), _png((255, 0, 0)), 0.3, 0.7, double_sided=double_sided
    )
    primitive = glb.Primitive(TRIANGLE, CORNERS, uv=uv, material=material)
    glb.write(tmp_path / "a.glb", [glb.Node("n", (primitive,))])
    (mesh,) = trimesh.load(tmp_path / "a.glb").geometry.values()
    seen = mesh.visual.material
    assert seen.doubleSided is double_sided
    assert (seen.roughnessFactor, seen.metallicFactor) == (0.3, 0.7)
    assert seen.baseColorTexture.getpixel((0, 0)) == (255, 0, 0)
    # trimesh keeps v = 0 at the bottom and its factor as 8-bit codes
    np.testing.assert_array_equal(mesh.visual.uv, uv * [1, -1] + [0, 1])
    np.testing.assert_array_equal(seen.baseColorFactor, [51, 102, 153, 255])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [3, 4])
def test_trimesh_sees_vertex_colours(dtype: type, channels: int, tmp_path: Path) -> None:
    codes = np.array([[0, 51, 255, 255], [10, 20, 30, 255], [255, 0, 5, 255]])[:, :channels]
    scale = {np.uint8: 1, np.uint16: 257, np.float32: np.float32(1 / 255)}[dtype]
    colours = (codes * scale).astype(dtype)
    glb.write(
        tmp_path / "a.glb", [glb.Node("n", (glb.Primitive(TRIANGLE, CORNERS, colours=colours),))]
    )
    (mesh,) = trimesh.load(tmp_path / "a.glb").geometry.values()
    np.testing.assert_array_equal(mesh.visual.vertex_attributes["color"], colours, strict=True)


def test_bytes_depend_on_nothing_but_the_arguments(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    nodes = _rich(rng)
    glb.write(tmp_path / "a.glb", nodes)
    again = [glb.Node(n.name, tuple(n.primitives), n.matrix.copy()) for n in nodes]
    glb.write(tmp_path / "b.glb", again)
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def test_equal_materials_and_textures_are_stored_once(tmp_path: Path) -> None:
    materials = [glb.Material(name, texture=_png((1, 2, 3))) for name in ("a", "b", "a")]
    primitives = tuple(glb.Primitive(TRIANGLE, CORNERS, material=m) for m in materials)
    glb.write(tmp_path / "a.glb", [glb.Node("n", primitives)])
    gltf, _ = unpack((tmp_path / "a.glb").read_bytes(), "a")
    assert (len(gltf["materials"]), len(gltf["images"])) == (2, 1)


def test_container_follows_the_specification(tmp_path: Path, rng: np.random.Generator) -> None:
    glb.write(tmp_path / "a.glb", _rich(rng))
    data = (tmp_path / "a.glb").read_bytes()
    gltf, binary = unpack(data, "a")
    assert int.from_bytes(data[8:12], "little") == len(data)
    assert int.from_bytes(data[12:16], "little") % 4 == 0
    assert len(binary) - gltf["buffers"][0]["byteLength"] in range(4)
    for view in gltf["bufferViews"]:
        assert view["byteOffset"] % 4 == 0
        assert view.get("byteStride", 4) % 4 == 0
    positions = [p["attributes"]["POSITION"] for m in gltf["meshes"] for p in m["primitives"]]
    for index in positions:
        accessor = gltf["accessors"][index]
        assert (accessor["min"], accessor["max"]) == ([0, 0, 0], [1, 2, 0.5])
    emissive = gltf["materials"][0]
    assert emissive["emissiveFactor"] == [1.0, 0.25, 0.0]
    assert gltf["extensionsUsed"] == list(emissive["extensions"])


@pytest.mark.parametrize(("count", "component"), [(65535, 5123), (65536, 5125)])
def test_indices_are_short_where_they_fit(count: int, component: int, tmp_path: Path) -> None:
    positions = np.zeros((count, 3), np.float32)
    positions[:, 0] = np.arange(count)
    triangles = np.array([[0, 1, count - 1]])
    glb.write(tmp_path / "a.glb", [glb.Node("n", (glb.Primitive(positions, triangles),))])
    gltf, _ = unpack((tmp_path / "a.glb").read_bytes(), "a")
    used = gltf["meshes"][0]["primitives"][0]["indices"]
    assert gltf["accessors"][used]["componentType"] == component
    (node,) = glb.read(tmp_path / "a.glb")
    np.testing.assert_array_equal(node.primitives[0].indices, triangles)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("indices", np.array([[0, 1, 3]])),
        ("indices", np.array([[0, 1, -1]])),
        ("indices", np.array([0, 1, 2])),
        ("indices", np.zeros((0, 3), int)),
        ("indices", np.array([[0.0, 1.0, 2.0]])),
        ("positions", np.full((3, 3), np.nan)),
        ("positions", np.full((3, 3), 1e300)),
        ("positions", np.zeros((3, 2))),
        ("normals", np.zeros((2, 3))),
        ("uv", np.full((3, 2), np.inf)),
        ("colours", np.full((3, 3), 1.5)),
        ("colours", np.zeros((3, 3), np.int32)),
        ("attributes", {"A": np.zeros(3)}),
        ("attributes", {"_A": np.zeros((3, 5))}),
        ("material", glb.Material(roughness=2.0)),
        ("material", glb.Material(emissive=(-1.0, 0.0, 0.0))),
        ("material", glb.Material(texture=b"GIF89a")),
        ("material", glb.Material(alpha_mode="mask")),
    ],
)
def test_unfit_primitives_are_refused_by_name(field: str, value: object, tmp_path: Path) -> None:
    given = {"positions": TRIANGLE, "indices": CORNERS} | {field: value}
    with pytest.raises(InputError, match=r"tree|material"):
        glb.write(tmp_path / "a.glb", [glb.Node("tree", (glb.Primitive(**given),))])
    assert not list(tmp_path.iterdir())


def _changed(tmp_path: Path, change: dict[str, object]) -> Path:
    """A sound file with entries of its JSON replaced."""
    path = tmp_path / "a.glb"
    glb.write(path, [glb.Node("n", (glb.Primitive(TRIANGLE, CORNERS),))])
    gltf, binary = unpack(path.read_bytes(), "a")
    path.write_bytes(pack(json.loads(json.dumps(gltf)) | change, bytes(binary)))
    return path


def test_transforms_multiply_down_the_tree(tmp_path: Path) -> None:
    half = 0.5**0.5
    nodes = [
        {"children": [1], "translation": [1, 2, 3], "rotation": [0, half, 0, half]},
        {"mesh": 0, "scale": [2, 3, 4]},
    ]
    change = {"nodes": nodes, "scenes": [{"nodes": [0]}]}
    (node,) = glb.read(_changed(tmp_path, change))
    # A quarter turn about +y takes +x to -z and +z to +x
    expected = [[0, 0, 4, 1], [0, 3, 0, 2], [-2, 0, 0, 3], [0, 0, 0, 1]]
    # 4 ulp of the largest product; sqrt(1/2) is not exact
    np.testing.assert_allclose(node.matrix, expected, rtol=0, atol=4 * 4 * 2.0**-53)


@pytest.mark.parametrize(
    "change",
    [
        {"nodes": [{"mesh": 0, "children": [0]}]},
        {"nodes": [{"children": [1]}, {"children": [0]}]},
        {"nodes": [{"mesh": 1}]},
        {"nodes": [{"mesh": True}]},
        {"nodes": [{"mesh": 0, "matrix": [1e308] * 16}, {"mesh": 0}]},
        {"scenes": [{"nodes": [7]}]},
        {"extensionsRequired": ["KHR_draco_mesh_compression"]},
        {"extensionsRequired": [{}]},
        {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}]},
        {"meshes": [{"primitives": [{"attributes": {"POSITION": 99}}]}]},
        {"meshes": {}},
        {"accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}] * 2},
        {"accessors": [{"bufferView": 0, "componentType": 5126, "count": -3, "type": "VEC3"}] * 2},
        {"accessors": None},
    ],
)
def test_broken_scenes_are_refused(change: dict[str, object], tmp_path: Path) -> None:
    if "matrix" in str(change):
        change = change | {"nodes": [change["nodes"][0] | {"children": [1]}, change["nodes"][0]]}
    with pytest.raises(InputError):
        glb.read(_changed(tmp_path, change))


def test_overlapping_accessors_cannot_fill_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("formats.files.glb_buffers.MAX_DECODED_BYTES", 1000)
    accessor = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
    primitives = [{"attributes": {"POSITION": i}} for i in range(40)]
    change = {"accessors": [accessor] * 40, "meshes": [{"primitives": primitives}]}
    with pytest.raises(InputError, match="over 1000 bytes"):
        glb.read(_changed(tmp_path, change))


@pytest.mark.skipif(
    "BAKELIGHT_DATA" not in os.environ, reason="BAKELIGHT_DATA is not set: real GLB files"
)
@pytest.mark.parametrize("name", ["BoxInterleaved", "BoxTextured", "Duck", "cubevc", "nested"])
def test_real_files_agree_with_trimesh(name: str, tmp_path: Path) -> None:
    path = Path(os.environ["BAKELIGHT_DATA"]) / "meshes" / "trimesh" / "models" / f"{name}.glb"
    nodes = glb.read(path)
    glb.write(tmp_path / "again.glb", nodes)
    points = np.concatenate(
        [p.positions @ n.matrix[:3, :3].T + n.matrix[:3, 3] for n in nodes for p in n.primitives]
    )
    for file in (path, tmp_path / "again.glb"):
        scene = trimesh.load(file)
        faces = sum(
            len(scene.geometry[scene.graph[n][1]].faces) for n in scene.graph.nodes_geometry
        )
        assert faces == sum(len(p.indices) for n in nodes for p in n.primitives)
        # Transforms are products of up to four float64 matrices of single-precision numbers
        scale = np.abs(scene.bounds).max()
        np.testing.assert_allclose(
            [points.min(0), points.max(0)], scene.bounds, rtol=0, atol=1e-12 * scale
        )
