"""A transfer mesh goes to its files and comes back as the player reads it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats import report, seal, transfer
from formats.errors import BakelightError, DamagedError, InputError
from formats.mesh import Material, Mesh
from formats.transfer import Layout, Transfer


def small(rng: np.random.Generator, depth: int = 8, channels: int = 3) -> Transfer:
    """Two materials, four vertices, six components, bands up to 2."""
    mesh = Mesh(
        vertices=rng.normal(size=(4, 3)),
        faces=np.array([[0, 1, 2], [3, 2, 1]]),
        normals=np.tile(np.float32([0, 0, 1]), (2, 3, 1)),
        material=np.array([1, 0], np.int32),
        materials=(Material("a"), Material("b", (0.1, 0.2, 0.3))),
        colours=rng.uniform(0, 1, (4, 3)).astype(np.float32),
        uv=rng.uniform(0, 1, (4, 2)).astype(np.float32),
    )
    codes = rng.integers(1, 256, (4, 8)).astype(np.uint8)
    if depth == 16:
        codes = rng.uniform(-1, 1, (4, 8)).astype(np.float16)
    scales = np.append(rng.uniform(0.1, 2, 6), [0, 0]).astype(np.float32)
    box = np.array([[0.0, -1, 3], [4, 2, 3]])
    return Transfer(mesh, codes, Layout(scales, rng.normal(size=(6, channels, 9)), box, depth))


@pytest.mark.parametrize("depth", [8, 16])
@pytest.mark.parametrize("channels", [1, 3])
def test_codes_and_layout_come_back_bit_for_bit(
    rng: np.random.Generator, tmp_path: Path, depth: int, channels: int
) -> None:
    asset = small(rng, depth, channels)
    asset.save(tmp_path)
    seal.seal(tmp_path)
    layout = Layout.load(tmp_path)
    np.testing.assert_array_equal(layout.scales, asset.layout.scales)
    np.testing.assert_array_equal(layout.basis, asset.layout.basis)
    np.testing.assert_array_equal(layout.box, asset.layout.box)
    assert (layout.depth, layout.l_max) == (depth, 2)
    parts = transfer.primitives(tmp_path)
    assert [p.material.name for p in parts] == ["a", "b"]
    for part, face in zip(parts, ([3, 2, 1], [0, 1, 2]), strict=True):
        found = np.concatenate(transfer.codes_of(part), axis=1)[part.indices[0]]
        stored = asset.codes.view(np.uint16) if depth == 16 else asset.codes
        np.testing.assert_array_equal(found, stored[face])
        np.testing.assert_array_equal(
            part.positions[part.indices[0]], asset.mesh.vertices[face].astype(np.float32)
        )
        assert part.uv is not None
        assert asset.mesh.uv is not None
        np.testing.assert_allclose(
            part.uv[part.indices[0]], asset.mesh.uv[face] * [1, -1] + [0, 1], atol=1e-7
        )
    data = report.read(tmp_path)
    assert data["kind"] == "transfer"
    assert data["bounds"][0] == asset.mesh.vertices.min(axis=0).tolist()


def test_irradiance_is_vector_times_light_linear_in_between(rng: np.random.Generator) -> None:
    asset = small(rng)
    middle, slopes = rng.normal(size=(9, 3)), rng.normal(size=(3, 9, 3))
    # The middles of the sides of the box, which is flat along z
    points = [[0, 0.5, 3], [4, 0.5, 3], [2, -1, 3], [2, 2, 3], [2, 0.5, 3], [2, 0.5, 3]]
    np.testing.assert_array_equal(asset.layout.points, points)
    slopes[2] = 0

    def light_at(p: np.ndarray) -> np.ndarray:
        x, y = (p[..., 0] - 2) / 2, (p[..., 1] - 0.5) / 1.5
        return np.asarray(
            middle + np.multiply.outer(x, slopes[0]) + np.multiply.outer(y, slopes[1])
        )

    light = light_at(np.array(points))
    mixed = light_at(asset.mesh.vertices)
    expected = np.einsum("nck,nkc->nc", asset.decoded(), mixed)
    # Vectors come out as float32, of sums up to 100
    np.testing.assert_allclose(asset.irradiance(light), expected, atol=2e-5)


def test_one_channel_serves_all_colours(rng: np.random.Generator) -> None:
    asset = small(rng, channels=1)
    light = rng.normal(size=(6, 9, 3))
    light[:, :, 2] = light[:, :, 0]
    found = asset.irradiance(light)
    np.testing.assert_allclose(found[:, 2], found[:, 0])
    assert np.abs(found[:, 1] - found[:, 0]).max() > 0.1


def test_damage_and_other_kinds_are_refused(rng: np.random.Generator, tmp_path: Path) -> None:
    small(rng).save(tmp_path)
    seal.seal(tmp_path)
    path = tmp_path / transfer.NAME
    data = bytearray(path.read_bytes())
    data[-5] ^= 1
    path.chmod(0o644)
    path.write_bytes(data)
    with pytest.raises(DamagedError):
        transfer.primitives(tmp_path)
    other = tmp_path / "other"
    other.mkdir()
    report.write(other, {"kind": "mesh", "format": 1})
    for read in (transfer.primitives, Layout.load):
        with pytest.raises(DamagedError, match="kind"):
            read(other)


def test_a_mesh_without_the_numbers_is_refused(rng: np.random.Generator, tmp_path: Path) -> None:
    asset = small(rng)
    asset.save(tmp_path)
    plain = tmp_path / "plain"
    plain.mkdir()
    asset.mesh.save(plain)
    (tmp_path / transfer.NAME).write_bytes((plain / "mesh.glb").read_bytes())
    with pytest.raises(BakelightError, match="_TRANSFER"):
        transfer.primitives(tmp_path)


def test_no_faces_no_file(rng: np.random.Generator, tmp_path: Path) -> None:
    asset = small(rng)
    none = replace(
        asset.mesh,
        faces=asset.mesh.faces[:0],
        normals=asset.mesh.normals[:0],
        material=asset.mesh.material[:0],
    )
    with pytest.raises(InputError, match="faces"):
        replace(asset, mesh=none).save(tmp_path)
