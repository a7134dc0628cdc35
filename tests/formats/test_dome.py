"""The dome kind: codes, constants, and what comes back from a folder."""

from pathlib import Path

import numpy as np
import pytest

from formats import dome, report, seal
from formats.errors import DamagedError
from maths import hemispherical_harmonics


def made(rng: np.random.Generator, channels: int = 6) -> tuple[dome.Dome, np.ndarray]:
    values = rng.normal(size=(5, 7, channels)).astype(np.float32)
    codes, scales = dome.coded(values)
    components = rng.normal(size=(channels, 9, 3))
    return dome.Dome(codes, scales, components, "linear", {"lights": 40}), values


def test_a_folder_comes_back(tmp_path: Path, rng: np.random.Generator) -> None:
    asset, _ = made(rng)
    asset.save(tmp_path)
    seal.seal(tmp_path)
    back = dome.Dome.load(tmp_path)
    assert np.array_equal(back.codes, asset.codes)
    assert np.array_equal(back.scales, asset.scales)
    assert np.array_equal(back.components, asset.components)
    assert (back.space, back.quality, back.channels) == ("linear", {"lights": 40}, 6)


def test_channels_come_back_within_half_a_code(rng: np.random.Generator) -> None:
    asset, values = made(rng)
    assert asset.codes.shape == (2, 5, 7, 4)
    # Channel k in plane k // 4; those past the last are exactly zero
    assert np.all(asset.codes[1, ..., 2:] == 128)
    error = np.abs(asset.decoded() - values).max(axis=(0, 1))
    half = np.abs(values).max(axis=(0, 1)) / 254
    assert np.all(error <= half * (1 + 1e-5))
    assert np.all(error > half / 4)  # 35 values: codes are used as finely as they are


def test_zero_is_exact() -> None:
    values = np.zeros((2, 3, 4), np.float32)
    values[0, 0, 0] = 0.7
    codes, scales = dome.coded(values)
    back = dome.Dome(codes, scales, np.zeros((4, 1, 3)), "linear").decoded()
    assert np.count_nonzero(back) == 1


def test_constants_are_the_components_series(rng: np.random.Generator) -> None:
    asset, _ = made(rng)
    d = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [0.0, 0.6, -0.8]])
    basis = hemispherical_harmonics.evaluate(d, 3)
    slow = np.array([[[sum(b[j] * v[j, c] for j in range(9)) for c in range(3)]
                      for v in asset.components] for b in basis])  # fmt: skip
    constants = asset.constants(d)
    np.testing.assert_allclose(constants[:2], slow[:2], atol=1e-14)
    assert np.all(constants[2] == 0)  # behind


def test_other_kinds_and_textures_are_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    asset, _ = made(rng)
    asset.save(tmp_path)
    data = report.read(tmp_path)
    report.write(tmp_path, {**data, "format": 99})
    with pytest.raises(DamagedError, match="format 99"):
        dome.Dome.load(tmp_path)
    scales = [*data["layout"]["scales"], [1.0, 1.0, 1.0, 1.0]]
    report.write(tmp_path, {**data, "layout": {**data["layout"], "scales": scales}})
    with pytest.raises(DamagedError, match="2 planes"):
        dome.Dome.load(tmp_path)
