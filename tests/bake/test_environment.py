"""Environment maps made small: energy, turns, refusals."""

import struct
from functools import partial

import numpy as np
import pytest

from bake import environment
from bake.environment import Params, load, resample
from formats.errors import InputError
from formats.files import exr, image, rgbe
from maths.circular_harmonics import project_environment
from maths.transforms import latlong_direction, latlong_solid_angles
from tests.bake import stage_battery


def energy(radiance):
    weights = latlong_solid_angles(*radiance.shape[:2])
    return np.einsum("h,hwc->c", weights, radiance.astype(np.float64))


@pytest.mark.parametrize("source", [(64, 128), (50, 100), (7, 14), (16, 32), (1, 2)])
@pytest.mark.parametrize("width", [2, 14, 64])
@pytest.mark.parametrize("rotate", [0.0, 1.0, -40.0])
def test_energy_is_kept(source, width, rotate, rng):
    """Down and up, by whole factors and not, turned or not."""
    radiance = rng.uniform(0, 5, (*source, 3)).astype(np.float32)
    small = resample(radiance, params=Params(width=width, rotate=rotate))
    assert small.radiance.shape == (width // 2, width, 3)
    # float32 storage: 2^-24 of each texel
    np.testing.assert_allclose(energy(small.radiance), energy(radiance), rtol=2.0**-23)
    assert small.quality["energy_error"] < 1e-12


def test_a_constant_map_stays_constant():
    small = resample(np.full((30, 60, 3), 2.5, np.float32), params=Params(width=16, rotate=0.3))
    np.testing.assert_allclose(small.radiance, 2.5, rtol=2.0**-23)


def test_the_same_size_is_the_same_map(rng):
    radiance = rng.uniform(0, 5, (16, 32, 3)).astype(np.float32)
    small = resample(radiance, params=Params(width=32))
    np.testing.assert_allclose(small.radiance, radiance, rtol=2.0**-22)


def test_whole_factors_are_means_by_solid_angle(rng):
    radiance = rng.uniform(0, 5, (8, 16, 3)).astype(np.float32)
    small = resample(radiance, params=Params(width=8))
    weights = latlong_solid_angles(8, 16)
    for row, column in np.ndindex(4, 8):
        block = radiance[2 * row : 2 * row + 2, 2 * column : 2 * column + 2].astype(np.float64)
        w = weights[2 * row : 2 * row + 2]
        expected = np.einsum("h,hwc->c", w, block) / (2 * w.sum())
        np.testing.assert_allclose(small.radiance[row, column], expected, rtol=2.0**-22)


def test_turning_moves_the_sun_counter_clockwise_from_above():
    """A sun in -z, turned by 90 degrees about +y, stands in -x."""
    u, v = (np.arange(64) + 0.5) / 64, (np.arange(32) + 0.5) / 32
    directions = latlong_direction(np.stack(np.meshgrid(u, v), axis=-1))
    sun = np.maximum(0, directions @ [0, 0, -1]) ** 20
    radiance = np.repeat(sun[..., None], 3, axis=-1).astype(np.float32)
    turned = resample(radiance, params=Params(width=64, rotate=np.pi / 2)).radiance
    # Where the turned map has light from: the mean of its directions
    mean = np.einsum("hwc,hwd,h->d", turned[..., :1], directions, latlong_solid_angles(32, 64))
    np.testing.assert_allclose(mean / np.linalg.norm(mean), [-1, 0, 0], atol=1e-6)


def test_turns_of_whole_texels_are_rolls_and_any_number_of_them(rng):
    radiance = rng.uniform(0, 5, (8, 16, 3)).astype(np.float32)
    for texels in (1, 5, -3, 16 * 7 + 2):
        turned = resample(radiance, params=Params(width=16, rotate=2 * np.pi * texels / 16))
        # Edges of 7 turns are good to 1e-15 of a turn: 1e-13 of the map
        expected = np.roll(radiance, -texels, axis=1)
        np.testing.assert_allclose(turned.radiance, expected, rtol=1e-6, atol=1e-6)


def test_few_terms_see_no_difference(rng):
    """What the player projects of the small map is what it would of the large one."""
    u, v = (np.arange(256) + 0.5) / 256, (np.arange(128) + 0.5) / 128
    directions = latlong_direction(np.stack(np.meshgrid(u, v), axis=-1))
    sky = 0.3 + np.maximum(0, directions[..., 1])
    sky = sky + 50 * (directions @ np.array([0.6, 0.48, 0.64]) > 0.98)
    radiance = np.repeat(sky[..., None], 3, axis=-1).astype(np.float32)
    small = resample(radiance, params=Params()).radiance
    settings = {"axis": "view", "elevation": 0.5, "one_sided": False}
    full = project_environment(radiance, 5, **settings)
    found = project_environment(small, 5, **settings)
    # A texel of 5.6 degrees under a basis of two waves a turn: 1 - sinc(2 pi / 64) is .16 %
    assert np.abs(found - full).max() < 0.002 * np.abs(full).max()


BAD = {
    "NaN": (lambda a: a.__setitem__((2, 3, 1), np.nan), "column 3, row 2"),
    "infinity": (lambda a: a.__setitem__((0, 0, 0), np.inf), "column 0, row 0"),
    "far below 0": (lambda a: a.__setitem__((7, 15, 2), -1e35), "column 15, row 7"),
    "too bright": (lambda a: a.__setitem__((1, 1, 1), 1e35), "column 1, row 1"),
}


@pytest.mark.parametrize(("spoil", "where"), BAD.values(), ids=BAD)
def test_bad_radiance_is_named_by_its_texel(spoil, where):
    radiance = np.ones((8, 16, 3), np.float32)
    spoil(radiance)
    with pytest.raises(InputError, match=where):
        resample(radiance, params=Params())


def test_a_little_below_zero_counts_as_zero_and_is_told():
    radiance = np.ones((8, 16, 3), np.float32)
    radiance[7, 15, 2] = -1.5
    found = resample(radiance, params=Params(width=16))
    assert found.radiance.min() == 0
    clean = resample(np.maximum(radiance, 0), params=Params(width=16))
    np.testing.assert_array_equal(found.radiance, clean.radiance)
    assert found.quality["negative_values"] == pytest.approx(1 / radiance.size)
    assert "count as 0" in found.quality["notes"][0]
    assert "notes" not in clean.quality


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_a_map_of_much_below_zero_is_refused(share):
    radiance = np.ones((8, 16, 3), np.float32)
    radiance[:, : round(16 * share)] = -1
    with pytest.raises(InputError, match="below 0"):
        resample(radiance, params=Params())


@pytest.mark.parametrize("width", [0, 1, 7, 5000])
def test_bad_widths_are_refused(width):
    with pytest.raises(InputError) as refusal:
        resample(np.ones((8, 16, 3), np.float32), params=Params(width=width))
    assert refusal.value.field == "width"


@pytest.mark.parametrize("rotate", [np.nan, np.inf, 1e9])
def test_bad_turns_are_refused(rotate):
    with pytest.raises(InputError) as refusal:
        resample(np.ones((8, 16, 3), np.float32), params=Params(rotate=rotate))
    assert refusal.value.field == "rotate"


BATTERY_MAP = np.random.default_rng(3).uniform(0.1, 5, (8, 16, 3)).astype(np.float32)


@pytest.mark.parametrize("case", stage_battery.cases(BATTERY_MAP), ids=str)
def test_battery(case, tmp_path):
    stage_battery.check(case, resample, (BATTERY_MAP,), Params(width=8), tmp_path)


# Files


WRITERS = {
    "sky.exr": lambda path, values: exr.write(path, {"sky": values}, half=False),
    "sky.hdr": rgbe.write,
    "sky.png": image.write,
}


@pytest.mark.parametrize("name", WRITERS)
def test_maps_are_read(name, tmp_path, rng):
    values = rng.uniform(0.1, 1, (8, 16, 3)).astype(np.float32)
    WRITERS[name](tmp_path / name, values)
    found = load(tmp_path / name)
    assert found.dtype == np.float32
    # float32; 8 bits of a shared exponent; 8 bits of sRGB, whose steps are at most 2.4 / 255
    tolerance = {".exr": 0, ".hdr": 1 / 128, ".png": 1.3 / 255}[(tmp_path / name).suffix]
    np.testing.assert_allclose(found, values, rtol=0, atol=tolerance)


def test_a_grey_map_becomes_three_channels(tmp_path, rng):
    values = rng.uniform(0, 1, (4, 8, 1)).astype(np.float32)
    exr.write(tmp_path / "grey.exr", {"grey": values}, half=False)
    np.testing.assert_array_equal(load(tmp_path / "grey.exr"), np.repeat(values, 3, axis=2))


def test_files_that_are_no_maps_are_refused(tmp_path):
    image.write(tmp_path / "square.png", np.ones((8, 8, 3), np.float32))
    (tmp_path / "sky.tga").write_bytes(b"x")
    (tmp_path / "noise.hdr").write_bytes(struct.pack("<I", 7) * 20)
    (tmp_path / "noise.exr").write_bytes(struct.pack("<I", 7) * 20)
    for name in ("square.png", "sky.tga", "missing.exr", "noise.hdr", "noise.exr"):
        with pytest.raises(InputError) as refusal:
            load(tmp_path / name)
        assert name in str(refusal.value)
        assert refusal.value.exit_code == 2


def test_a_damaged_exr_is_one_line(tmp_path, capfd):
    """OpenEXR prints lines of its own."""
    exr.write(tmp_path / "sky.exr", {"": np.ones((4, 8, 3), np.float32)})
    data = (tmp_path / "sky.exr").read_bytes()
    (tmp_path / "sky.exr").write_bytes(data[:-30] + bytes(30))
    with pytest.raises(InputError, match=r"sky\.exr.*export it again"):
        load(tmp_path / "sky.exr")
    assert "".join(capfd.readouterr()) == ""


def test_load_is_a_source_of_the_store(tmp_path):
    """`partial(load, path)` is how a pipeline hands a map over."""
    rgbe.write(tmp_path / "sky.hdr", np.ones((4, 8, 3), np.float32))
    baked = resample(partial(environment.load, tmp_path / "sky.hdr")(), params=Params(width=4))
    np.testing.assert_allclose(baked.radiance, 1, rtol=1 / 128)
