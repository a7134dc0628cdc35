"""The environment kind: what half floats cost, and what comes back."""

from pathlib import Path

import numpy as np
import pytest

from formats import report, seal
from formats.environment import Environment
from formats.errors import DamagedError, InputError
from formats.files import ktx2


def test_radiance_comes_back_within_half_a_bit(tmp_path: Path, rng: np.random.Generator) -> None:
    radiance = np.exp(rng.normal(0, 3, (8, 16, 3))).astype(np.float32)
    Environment(radiance, {"source": "made"}).save(tmp_path)
    seal.seal(tmp_path)
    back = Environment.load(tmp_path)
    assert back.quality == {"source": "made"}
    assert back.radiance.dtype == np.float32
    # Half floats have 11 bits: rounding is at most 2^-11 of a normal value
    np.testing.assert_allclose(back.radiance, radiance, rtol=2.0**-11, atol=2.0**-25)


def test_report_tells_what_was_lost(tmp_path: Path) -> None:
    radiance = np.ones((4, 8, 3), np.float32)
    Environment(radiance).save(tmp_path)
    data = report.read(tmp_path)
    assert (data["size"], data["clamped"], data["power_lost"]) == ([8, 4], 0, 0.0)
    # The solid angles of a lat-long map add up to 4 pi: 32 roundings of double precision
    np.testing.assert_allclose(data["mean_radiance"], [1, 1, 1], rtol=32 * 2.0**-53)
    radiance[1, 2] = 131008.0  # twice the largest half: half of this texel's light is lost
    Environment(radiance).save(tmp_path)
    data = report.read(tmp_path)
    texel = np.pi / 4 * np.cos(np.pi / 4)  # 2 pi / 8 * (cos(pi / 4) - cos(pi / 2))
    expected = 65504.0 * texel / (4 * np.pi + 131007.0 * texel)
    assert data["clamped"] == 3
    assert data["power_lost"] == pytest.approx(expected, rel=1e-12)


def test_black_is_black(tmp_path: Path) -> None:
    Environment(np.zeros((2, 4, 3), np.float32)).save(tmp_path)
    assert not Environment.load(tmp_path).radiance.any()
    assert report.read(tmp_path)["power_lost"] == 0.0


def test_other_engines_see_a_plain_half_float_picture(tmp_path: Path) -> None:
    Environment(np.full((2, 4, 3), 0.5, np.float32)).save(tmp_path)
    (level,) = ktx2.read(tmp_path / "environment.ktx2").levels
    assert level.shape == (1, 2, 4, 4)
    np.testing.assert_array_equal(level[0, 0, 0], np.float16([0.5, 0.5, 0.5, 1.0]))


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_impossible_radiance_is_refused(value: float, tmp_path: Path) -> None:
    radiance = np.ones((2, 4, 3), np.float32)
    radiance[1, 1, 1] = value
    with pytest.raises(InputError):
        Environment(radiance).save(tmp_path)
    assert not list(tmp_path.iterdir())


def test_damage_and_other_kinds_are_refused(tmp_path: Path) -> None:
    Environment(np.ones((2, 4, 3), np.float32)).save(tmp_path)
    seal.seal(tmp_path)
    path = tmp_path / "environment.ktx2"
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(DamagedError):
        Environment.load(tmp_path)
    path.write_bytes(data)
    Environment.load(tmp_path)
    (tmp_path / "seal.json").unlink()
    report.write(tmp_path, {"kind": "billboard", "format": 1})
    with pytest.raises(DamagedError, match="billboard"):
        Environment.load(tmp_path)
