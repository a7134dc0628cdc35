"""The stored light of a world of cubes."""

import numpy as np
import pytest

from formats import voxel_light
from formats.files.texture import BC1, RGBA8
from maths import bc1


def world(
    rng: np.random.Generator, size: tuple[int, int, int], glowing: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return cells with rows 1 to 3 dark, 4 and 5 glowing where chance says so, and emission."""
    cells = rng.integers(0, 4, size).astype(np.uint16)
    lit = rng.random(size) < glowing
    cells[lit] = rng.integers(4, 6, int(lit.sum()))
    emission = np.zeros((6, 3), np.float32)
    emission[4], emission[5] = (8, 6, 1), (0, 2, 4)
    return cells, emission


@pytest.mark.parametrize("size", [(1, 1, 1), (3, 5, 7), (9, 8, 12), (17, 4, 3)])
@pytest.mark.parametrize("glowing", [0.0, 0.02, 0.5])
def test_blocks_are_those_of_the_codec(
    size: tuple[int, int, int], glowing: float, rng: np.random.Generator
) -> None:
    """The table of dark blocks is only faster."""
    cells, emission = world(rng, size, glowing)
    codes = voxel_light.codes(emission, 8.0)
    light, told = voxel_light.stored(cells, emission, 8.0)
    assert told["format"] == light.format.name == "BC1"
    assert np.array_equal(light.levels[0], bc1.encode_volume(codes[cells], exact_black=True))
    texels = voxel_light.texels(light)
    assert texels.shape == (*size, 4)
    assert np.array_equal(texels[..., 3], np.where(cells > 0, 255, 0))
    assert not texels[cells < 4, :3].any()


def test_errors_are_those_of_what_is_stored(rng: np.random.Generator) -> None:
    cells, emission = world(rng, (9, 10, 11), 0.3)
    light, told = voxel_light.stored(cells, emission, 8.0)
    exact = emission[cells].astype(np.float64)
    plain = voxel_light.codes(emission, 8.0)[cells]
    for name, texels in (("error_bc1", voxel_light.texels(light)), ("error_rgba8", plain)):
        error = texels[..., :3] / 255 * 8.0 - exact
        expected = np.sqrt(np.sum(error**2) / np.sum(exact**2))
        # Sums of some 1,000 terms in another order
        assert told[name] == pytest.approx(expected, rel=1e-12)
    assert 0 < told["error_rgba8"] < told["error_bc1"]


def test_a_world_without_light() -> None:
    cells = np.ones((2, 2, 2), np.uint16)
    light, told = voxel_light.stored(cells, np.zeros((2, 3), np.float32), 1.0)
    assert light.format == BC1
    assert (told["error_bc1"], told["error_rgba8"], told["wrong_dark_cells"]) == (0, 0, 0)
    assert np.all(voxel_light.texels(light) == [0, 0, 0, 255])


def test_one_lamp_of_a_colour_that_blocks_hold_is_exact() -> None:
    """One colour and black are two endpoints: full and zero codes have 5 and 6 bits."""
    cells = np.ones((1, 4, 4), np.uint16)
    cells[0, 1, 2], cells[0, 3, 3] = 2, 0
    emission = np.array([[0, 0, 0], [0, 0, 0], [5, 0, 5]], np.float32)
    light, told = voxel_light.stored(cells, emission, 5.0)
    assert told["error_bc1"] == 0
    assert voxel_light.texels(light)[0, 1, 2].tolist() == [255, 0, 255, 255]


def test_light_too_dim_for_a_code_is_counted_as_lost() -> None:
    cells = np.array([[[1, 2]]], np.uint16)
    emission = np.array([[0, 0, 0], [1000, 1000, 1000], [1, 1, 1]], np.float32)
    light, told = voxel_light.stored(cells, emission, 1000.0)
    assert voxel_light.texels(light)[0, 0].tolist() == [[255] * 4, [0, 0, 0, 255]]
    assert told["wrong_dark_cells"] == 0
    assert told["error_rgba8"] == pytest.approx(np.sqrt(3 / 3_000_003), rel=1e-12)


def test_where_dark_would_not_be_black_nothing_is_compressed(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    encode = bc1.encode
    monkeypatch.setattr(bc1, "encode", lambda rgba, exact_black: encode(rgba))
    cells, emission = world(rng, (4, 8, 8), 0.5)
    light, told = voxel_light.stored(cells, emission, 8.0)
    assert told["wrong_dark_cells"] > 0
    assert light.format == RGBA8
    assert told["format"] == "RGBA8"
    assert np.array_equal(voxel_light.texels(light), voxel_light.codes(emission, 8.0)[cells])
