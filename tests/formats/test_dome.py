"""The dome kind: codes, slots, coverage, levels, constants, and what comes back from a folder."""

from pathlib import Path

import numpy as np
import pytest

from formats import dome, report, seal
from formats.errors import DamagedError
from maths import hemispherical_harmonics

SIZES = ((6, 8), (3, 4))


def made(
    rng: np.random.Generator, channels: int = 6, coverage: bool = False, views: int = 1
) -> tuple[dome.Dome, list[np.ndarray], list[np.ndarray]]:
    """Return a dome of two levels, and its channels and coverages, a level (views, h, w, ...)."""
    values = [rng.normal(size=(views, *size, channels)).astype(np.float32) for size in SIZES]
    alphas = [rng.random((views, *size)).astype(np.float32) for size in SIZES]
    values[1] *= 0.5  # within the scales of level 0
    levels = tuple(
        np.concatenate(
            [
                dome.placed(v, a if coverage else None)
                for v, a in zip(value * 0.999, alpha, strict=True)
            ]
        )
        for value, alpha in zip(values, alphas, strict=True)
    )
    codes, scales, _ = dome.encode(levels, dome.planes_of(channels, coverage), coverage)
    asset = dome.Dome(
        levels=codes,
        scales=scales,
        components=rng.normal(size=(channels, 9, 3)),
        space="linear",
        coverage=coverage,
        views=views,
        metres_per_texel=0.02,
        pivot=(3.5, 6.25),
        height=1.7,
        max_lod=1.0,
        lens_scale=0.41,
        quality={"lights": 40},
    )
    return asset, [0.999 * v for v in values], alphas


@pytest.mark.parametrize("coverage", [False, True])
def test_a_folder_comes_back(tmp_path: Path, rng: np.random.Generator, coverage: bool) -> None:
    asset, _, _ = made(rng, 7, coverage, 2)
    asset.save(tmp_path)
    seal.seal(tmp_path)
    back = dome.Dome.load(tmp_path)
    assert len(back.levels) == 2
    for ours, theirs in zip(asset.levels, back.levels, strict=True):
        assert np.array_equal(ours, theirs)
    assert np.array_equal(back.scales, asset.scales)
    assert np.array_equal(back.components, asset.components)
    for name in ("space", "coverage", "views", "metres_per_texel", "pivot", "height", "max_lod",
                 "lens_scale", "quality", "channels", "planes", "size"):  # fmt: skip
        assert getattr(back, name) == getattr(asset, name), name
    assert (back.channels, back.planes, back.size) == (7, 2, (8, 6))


@pytest.mark.parametrize("coverage", [False, True])
def test_levels_and_views_come_back_within_half_a_code(
    rng: np.random.Generator, coverage: bool
) -> None:
    asset, values, alphas = made(rng, 6, coverage, 3)
    peak = np.abs(values[0]).max(axis=(0, 1, 2))
    for level in range(2):
        for view in range(3):
            error = np.abs(asset.decoded(level, view) - values[level][view]).max(axis=(0, 1))
            # Half a code, and the rounding of single precision
            assert np.all(error <= peak / 254 * (1 + 1e-5))
            # 12 values or more: codes are used as finely as they are
            assert np.all(error > peak / 254 / 6)
            alpha = np.abs(asset.alpha(level, view) - alphas[level][view]).max()
            assert alpha <= 0.5 / 255 + 1e-7 if coverage else np.all(asset.alpha(level, view) == 1)


def test_slots_lie_around_coverage(rng: np.random.Generator) -> None:
    asset, values, _ = made(rng, 6, True)
    assert asset.levels[0].shape == (2, 6, 8, 4)
    assert dome.slots(6, True).tolist() == [0, 1, 2, 4, 5, 6]
    # The slot past the last channel is exactly zero
    assert np.all(asset.levels[0][1, ..., 3] == 128)
    codes = asset.levels[0][1, ..., 0]
    slow = (codes.astype(float) - 128) / 127 * asset.scales[1, 0]
    np.testing.assert_allclose(slow, values[0][0, ..., 3], atol=asset.scales[1, 0] / 254 * 1.00001)
    assert asset.scales[0, 3] == 1


def test_zero_and_whole_coverage_are_exact() -> None:
    values, alpha = np.zeros((2, 3, 4), np.float32), np.ones((2, 3), np.float32)
    values[0, 0, 0], alpha[1] = 0.7, 0.0
    for coverage in (None, alpha):
        planes = dome.placed(values, coverage)
        codes, scales, clipped = dome.encode((planes,), len(planes), coverage is not None)
        asset = dome.Dome(codes, scales, np.zeros((4, 1, 3)), "linear", coverage is not None)
        assert np.count_nonzero(asset.decoded()) == 1
        assert np.array_equal(asset.alpha(), np.ones((2, 3)) if coverage is None else alpha)
        assert clipped == 0


def test_constants_are_the_components_times_the_light(rng: np.random.Generator) -> None:
    asset, _, _ = made(rng)
    d = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
    power = np.array([[1.0, 2.0, 3.0], [0.5, 0.0, 0.25]])
    light = hemispherical_harmonics.evaluate(d, 3)[..., None] * power[:, None]
    slow = np.array([[[sum(b[j, c] * v[j, c] for j in range(9)) for c in range(3)]
                      for v in asset.components] for b in light])  # fmt: skip
    np.testing.assert_allclose(asset.constants(light), slow, atol=1e-13)
    np.testing.assert_allclose(asset.constants(light[0]), slow[0], atol=1e-13)


def test_other_kinds_and_textures_are_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    asset, _, _ = made(rng)
    asset.save(tmp_path)
    data = report.read(tmp_path)
    report.write(tmp_path, {**data, "format": 1})
    with pytest.raises(DamagedError, match=r"format 1.*bake it again"):
        dome.Dome.load(tmp_path)
    report.write(tmp_path, {**data, "kind": "billboard"})
    with pytest.raises(DamagedError, match="billboard of format 2"):
        dome.Dome.load(tmp_path)
    scales = [*data["layout"]["scales"], [1.0, 1.0, 1.0, 1.0]]
    wrong = [
        ({"scales": scales}, "2 layers of 1 views of 3 planes"),
        ({"views": 2}, "2 layers of 2 views"),
        ({"scales": "many"}, "layout"),
        ({"pivot": [1.0]}, "layout"),
        ({"scales": [[1.0], [1.0]]}, "another shape"),
    ]
    for part, text in wrong:
        report.write(tmp_path, {**data, "layout": {**data["layout"], **part}})
        with pytest.raises(DamagedError, match=text):
            dome.Dome.load(tmp_path)
    report.write(tmp_path, {**data, "layout": {}})
    with pytest.raises(DamagedError, match="layout"):
        dome.Dome.load(tmp_path)


@pytest.mark.parametrize("name", [dome.NAME, dome.COMPONENTS, report.NAME])
def test_a_changed_bit_is_found(tmp_path: Path, rng: np.random.Generator, name: str) -> None:
    made(rng)[0].save(tmp_path)
    seal.seal(tmp_path)
    data = bytearray((tmp_path / name).read_bytes())
    data[len(data) // 2] ^= 4
    (tmp_path / name).chmod(0o644)
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DamagedError):
        dome.Dome.load(tmp_path)
