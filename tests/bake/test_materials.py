"""Colours and materials of mesh files: linear, and only what the file says."""

import json

import numpy as np
import pytest
from PIL import Image

from bake import sources
from formats.errors import InputError
from formats.files import glb
from formats.files import image as picture
from maths.colour import srgb_decode
from tests.bake.mesh_files import RGB, TRIANGLE, glb_of, gltf_of, texture, triangle, write


def test_obj_with_material_and_texture(tmp_path):
    texture(tmp_path, "bark.png")
    mtl = write(tmp_path, "tree.mtl", "newmtl bark\nKd 0.5 0.25 1\nmap_Kd bark.png\n")
    text = "mtllib tree.mtl\n" + TRIANGLE + "vt 0 0\nvt 1 0\nvt 0 1\nusemtl bark\nf 1/1 2/2 3/3\n"
    path = write(tmp_path, "tree.obj", text)
    mesh = sources.load(path)
    (material,) = mesh.materials
    # Exact: a factor is not rounded to eight bits, a texture is decoded from sRGB
    assert material.base_color == (0.5, 0.25, 1.0)
    np.testing.assert_allclose(material.texture, srgb_decode(RGB / 255), rtol=1e-6)
    corners = np.asarray(mesh.vertices[mesh.faces[0]])
    np.testing.assert_array_equal(mesh.uv[mesh.faces[0]], corners[:, :2])
    assert sources.files(path) == (path, mtl, tmp_path / "bark.png")


def test_obj_textures_without_a_colour_are_not_darkened(tmp_path):
    texture(tmp_path, "bark.png")
    write(tmp_path, "tree.mtl", "newmtl bark\nmap_Kd bark.png\n")
    text = "mtllib tree.mtl\n" + TRIANGLE + "vt 0 0\nvt 1 0\nvt 0 1\nusemtl bark\nf 1/1 2/2 3/3\n"
    (material,) = sources.load(write(tmp_path, "tree.obj", text)).materials
    assert material.base_color == (1.0, 1.0, 1.0)
    assert material.texture.shape == (2, 2, 3)


@pytest.mark.parametrize("uv", [True, False])
def test_obj_without_materials_is_neutral(tmp_path, uv):
    """No grey picture of trimesh's own, which would darken the mesh to a twentieth."""
    text = TRIANGLE + ("vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n" if uv else "f 1 2 3\n")
    (material,) = sources.load(write(tmp_path, "plain.obj", text)).materials
    assert material.base_color == (0.5, 0.5, 0.5)
    assert material.texture is None
    assert not material.double_sided


def test_obj_vertex_colours_are_decoded(tmp_path):
    text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0.5 0.5 0.5\nf 1 2 3\n"
    mesh = sources.load(write(tmp_path, "colours.obj", text))
    shade = float(srgb_decode(0.5))
    # Colours pass through eight bits: half a step of the steepest part of the curve
    expected = [[1, 0, 0], [0, 1, 0], [shade] * 3]
    np.testing.assert_allclose(mesh.colours[mesh.faces[0]], expected, atol=2.4 / 510)
    assert mesh.materials[0].base_color == (1.0, 1.0, 1.0)


def test_ply_with_vertex_colours(tmp_path):
    header = (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = "0 0 0 255 0 0\n1 0 0 0 188 0\n0 1 0 0 0 64\n3 0 1 2\n"
    mesh = sources.load(write(tmp_path, "colours.ply", header + rows))
    expected = srgb_decode(np.diag([255, 188, 64]) / 255)
    np.testing.assert_allclose(mesh.colours, expected, rtol=1e-6)
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2]])


def test_glb_factors_texture_and_sides(tmp_path):
    png = texture(tmp_path, "t.png").read_bytes()
    uv = np.array([[0, 1], [1, 1], [0, 0]], np.float32)
    material = glb.Material(
        "leaf", (0.2, 0.4, 0.6, 1), png, roughness=0.3, metallic=0.25, double_sided=True
    )
    path = glb_of(tmp_path / "leaf.glb", [glb.Node("n", (triangle(uv=uv, material=material),))])
    mesh = sources.load(path)
    (found,) = mesh.materials
    assert found.name == "leaf"
    assert found.double_sided
    assert found.roughness == pytest.approx(0.3)
    assert found.metallic == pytest.approx(0.25)
    # trimesh keeps factors in eight bits
    np.testing.assert_allclose(found.base_color, (0.2, 0.4, 0.6), atol=0.5 / 255)
    np.testing.assert_allclose(found.texture, srgb_decode(RGB / 255), rtol=1e-6)
    # (0, 0) is at the bottom left here, at the top left in glTF
    np.testing.assert_allclose(mesh.uv[:, 1], 1 - uv[:, 1], atol=1e-7)


def test_glb_vertex_colours_are_linear_already(tmp_path):
    colours = np.array([[1, 0, 0], [0, 0.5, 0], [0, 0, 0.25]], np.float32)
    path = glb_of(tmp_path / "c.glb", [glb.Node("n", (triangle(colours=colours),))])
    np.testing.assert_allclose(sources.load(path).colours, colours, atol=0.5 / 255)


def test_a_texture_shared_by_parts_is_held_once(tmp_path):
    png = texture(tmp_path, "t.png").read_bytes()
    material = glb.Material("shared", texture=png)
    uv = np.zeros((3, 2), np.float32)
    nodes = [glb.Node(f"n{i}", (triangle(uv=uv, material=material),)) for i in range(3)]
    textures = [m.texture for m in sources.load(glb_of(tmp_path / "s.glb", nodes)).materials]
    assert all(t is textures[0] for t in textures)


def test_sixteen_bits_of_grey_are_not_cut_off(tmp_path):
    ramp = np.array([[0, 20000], [40000, 65535]], np.uint16)
    Image.fromarray(ramp).save(tmp_path / "grey.png")
    write(tmp_path, "t.mtl", "newmtl m\nKd 1 1 1\nmap_Kd grey.png\n")
    text = "mtllib t.mtl\n" + TRIANGLE + "vt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
    (material,) = sources.load(write(tmp_path, "t.obj", text)).materials
    expected = np.repeat(srgb_decode(ramp / 65535)[..., None], 3, axis=-1)
    np.testing.assert_allclose(material.texture, expected, rtol=1e-5, atol=1e-7)


def test_a_picture_of_the_project_reads_the_same_as_a_texture(tmp_path):
    """Row 0 is on top in both readers."""
    texture(tmp_path, "t.png")
    write(tmp_path, "t.mtl", "newmtl m\nKd 1 1 1\nmap_Kd t.png\n")
    text = "mtllib t.mtl\n" + TRIANGLE + "vt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
    (material,) = sources.load(write(tmp_path, "t.obj", text)).materials
    np.testing.assert_allclose(material.texture, picture.read(tmp_path / "t.png"), atol=1e-6)


def glowing(path, factor=(0.5, 1.0, 0.25), strength=8.0, names=("lamp", "paper"), **changes):
    """Write a GLB of two materials, of which the first glows; returns its path."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    emissive = [tuple(strength * f for f in factor), changes.get("second", (0.0, 0.0, 0.0))]
    parts = [
        glb.Primitive(points + i, np.array([[0, 1, 2]]), material=glb.Material(name, emissive=e))
        for i, (name, e) in enumerate(zip(names, emissive, strict=True))
    ]
    return glb_of(path, [glb.Node("a", tuple(parts))])


def test_emission_has_its_strength(tmp_path):
    mesh = sources.load(glowing(tmp_path / "lamp.glb"))
    by_name = {m.name: m.emissive for m in mesh.materials}
    np.testing.assert_allclose(by_name["lamp"], [4.0, 8.0, 2.0], rtol=1e-7)
    assert by_name["paper"] == (0.0, 0.0, 0.0)


def test_emission_without_strength_is_the_factor(tmp_path):
    mesh = sources.load(glowing(tmp_path / "dim.glb", strength=1.0))
    np.testing.assert_allclose(mesh.materials[0].emissive, [0.5, 1.0, 0.25], rtol=1e-7)


def test_emission_beyond_reason_is_cut(tmp_path):
    mesh = sources.load(glowing(tmp_path / "nova.glb", strength=1e30))
    assert mesh.materials[0].emissive == (1e6, 1e6, 1e6)


def test_one_name_with_two_strengths_is_refused(tmp_path):
    path = glowing(tmp_path / "two.glb", names=("lamp", "lamp"), second=(3.0, 3.0, 3.0))
    with pytest.raises(InputError, match="lamp"):
        sources.load(path)


def test_a_glowing_picture_counts_by_its_mean(tmp_path):
    texture(tmp_path, "glow.png")
    path = gltf_of(
        tmp_path,
        materials=[
            {
                "name": "screen",
                "emissiveFactor": [1, 1, 0.5],
                "emissiveTexture": {"index": 0},
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
            }
        ],
        textures=[{"source": 0}],
        images=[{"uri": "glow.png"}],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 0}, "material": 0}]}],
    )
    tree = json.loads(path.read_text())
    tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 1
    tree["accessors"].append({"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2"})
    path.write_text(json.dumps(tree))
    mesh = sources.load(path)
    mean = srgb_decode(RGB / 255).mean(axis=(0, 1))
    np.testing.assert_allclose(mesh.materials[0].emissive, mean * [4, 4, 2], rtol=1e-6)
    assert any("screen glows evenly" in note for note in mesh.notes)


def test_a_name_that_is_none_is_no_name(tmp_path):
    path = glowing(tmp_path / "odd.glb")
    path.write_bytes(path.read_bytes().replace(b'"lamp"', b"[1, 2]"))
    mesh = sources.load(path)
    assert {m.name for m in mesh.materials} == {"", "paper"}
