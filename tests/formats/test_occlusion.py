"""Volumes of occlusion as files: round trips, frames, damage."""

import json
from pathlib import Path

import numpy as np
import pytest

from formats import occlusion, seal
from formats.errors import DamagedError, InputError
from formats.occlusion import Box, Occlusion

BOX = Box((1.0, 2.0, 3.0), (0.5, 2.0, 1.0))


def volume(dtype: type = np.uint8) -> Occlusion:
    rng = np.random.default_rng(1)
    values = rng.uniform(-1, 1, (2, 5, 5, 5, 4)).astype(np.float32)
    basis = np.linalg.qr(rng.normal(size=(9, 6)))[0].T
    scales = np.array([1, 2, 0.5, 0.1, 3, 1, 0, 0], np.float32)
    depth = 8 if dtype is np.uint8 else 16
    return Occlusion(occlusion.encode(values, depth), scales, basis, BOX, {"bytes": 1})


@pytest.mark.parametrize("dtype", [np.uint8, np.float16])
def test_round_trip(dtype: type, tmp_path: Path) -> None:
    asset = volume(dtype)
    asset.save(tmp_path)
    again = Occlusion.load(tmp_path)
    assert again.volumes.dtype == dtype
    assert np.array_equal(again.volumes, asset.volumes)
    assert np.array_equal(again.basis, asset.basis)
    assert np.array_equal(again.scales, asset.scales)
    assert again.box == BOX
    assert (again.l_max, again.components, again.quality) == (2, 6, {"bytes": 1})
    assert again.decoded().shape == (5, 5, 5, 6)
    layout = json.loads((tmp_path / "report.json").read_bytes())["layout"]
    assert (layout["grids"], layout["volumes"], layout["longest_axis"]) == ([[5, 5, 5]], [2], 1)


def two_grids() -> Occlusion:
    """Nine harmonics: four on 5 x 4 x 6 voxels, five on 3 x 4 x 2, finer in the middle."""
    rng = np.random.default_rng(2)
    shapes = ((1, 6, 4, 5, 4), (2, 2, 4, 3, 4))
    fine, coarse = (occlusion.encode(rng.uniform(-1, 1, s).astype(np.float32), 8) for s in shapes)
    scales = rng.uniform(0.1, 2, 12).astype(np.float32)
    return Occlusion(fine, scales, np.eye(9), BOX, {}, coarse=coarse, warp=0.5)


def test_two_grids_round_trip(tmp_path: Path) -> None:
    asset = two_grids()
    asset.save(tmp_path)
    again = Occlusion.load(tmp_path)
    assert again.coarse is not None
    assert np.array_equal(again.volumes, asset.volumes)
    assert np.array_equal(again.coarse, asset.coarse)
    assert (again.warp, again.l_max, again.nbytes) == (0.5, 2, 4 * 120 + 2 * 4 * 24)
    layout = json.loads((tmp_path / "report.json").read_bytes())["layout"]
    assert (layout["grids"], layout["volumes"]) == ([[5, 4, 6], [3, 4, 2]], [1, 2])
    (tmp_path / "coarse.ktx2").unlink()
    with pytest.raises(InputError):
        Occlusion.load(tmp_path)


def test_lookups_in_the_middles_of_voxels_give_what_they_hold() -> None:
    asset = two_grids()
    p = asset.places()
    assert p.shape == (120, 3)
    found = asset.terms(p).reshape(6, 4, 5, 9)
    held = occlusion.decode(asset.volumes)[0] * asset.scales[:4]
    # float32 weights of values up to 2
    np.testing.assert_allclose(found[..., :4], held, atol=2e-5)
    np.testing.assert_allclose(asset.decoded(), found, atol=2e-5)
    # Half a voxel of an axis that is finer in the middle: q / (1.5 - .5 |q|)
    q = 1 - 1 / 5
    assert p[4, 0] == pytest.approx(q / (1.5 - 0.5 * q))
    assert p[:5, 0].tolist() == sorted(p[:5, 0])
    # Beyond the volume its edge
    np.testing.assert_allclose(asset.terms(3 * np.eye(3)), asset.terms(np.eye(3)), atol=1e-6)


def test_one_even_grid_is_read_as_it_is() -> None:
    asset = volume()
    np.testing.assert_allclose(asset.places(), BOX.to_object(BOX.voxel_centres(5)), atol=1e-12)
    expected = asset.decoded().reshape(125, 6) @ asset.basis
    np.testing.assert_allclose(asset.terms(asset.places()), expected, atol=2e-5)


def test_codes_are_within_half_a_step() -> None:
    values = np.linspace(-1, 1, 1001).astype(np.float32)
    error = np.abs(occlusion.decode(occlusion.encode(values, 8)) - values)
    assert error.max() <= 0.5 / 127 + 1e-6
    assert occlusion.encode(np.zeros(1, np.float32), 8)[0] == 128
    assert occlusion.decode(occlusion.encode(np.float32([0.0, 1.0, -1.0]), 8)).tolist() == [
        0,
        1,
        -1,
    ]


def test_voxel_centres_run_from_minus_one_to_one() -> None:
    points = BOX.voxel_centres(4)
    p = BOX.to_object(points).reshape(4, 4, 4, 3)
    at = np.array([-0.75, -0.25, 0.25, 0.75])
    z, y, x = np.meshgrid(at, at, at, indexing="ij")
    np.testing.assert_allclose(p, np.stack([x, y, z], axis=-1), atol=1e-12)
    corner = np.add(BOX.centre, BOX.half_extent)
    np.testing.assert_allclose(BOX.to_object(corner), 0.5)
    assert BOX.longest_axis == 1


def test_damage_is_found(tmp_path: Path) -> None:
    volume().save(tmp_path)
    report = json.loads((tmp_path / "report.json").read_bytes())
    for key, value in (("kind", "dome"), ("format", 99)):
        (tmp_path / "report.json").write_text(json.dumps(report | {key: value}))
        with pytest.raises(DamagedError, match=key if key == "kind" else "format 99"):
            Occlusion.load(tmp_path)
    layout = report["layout"] | {"grids": [[5, 4, 5]]}
    (tmp_path / "report.json").write_text(json.dumps(report | {"layout": layout}))
    with pytest.raises(DamagedError, match="size"):
        Occlusion.load(tmp_path)
    (tmp_path / "report.json").write_text(json.dumps(report))
    seal.seal(tmp_path)
    data = bytearray((tmp_path / "occlusion.ktx2").read_bytes())
    data[-1] ^= 1
    (tmp_path / "occlusion.ktx2").write_bytes(data)
    with pytest.raises(DamagedError):
        Occlusion.load(tmp_path)
