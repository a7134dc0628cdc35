"""A lightmap's folder: what is saved comes back, gutters filled; what is damaged is refused."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake.voxel_faces import layout
from formats import seal
from formats.errors import BakelightError, DamagedError, InputError
from formats.lightmap import LARGEST, Lightmap
from tests.bake import cell_worlds

RNG = np.random.default_rng(0)
FACES = layout(cell_worlds.room(3), texels=2, cell_size=0.5, origin=(1.0, -2.0, 3.5))


def lightmap() -> Lightmap:
    w, h = FACES.size
    there = (FACES.cell() >= 0)[..., None]
    light = (RNG.gamma(1.0, 10.0, (h, w, 3)) * there).astype(np.float32)
    return Lightmap(light, 0.01 * light, FACES, {"rays": 64})


def test_what_is_saved_comes_back(tmp_path: Path) -> None:
    saved = lightmap()
    saved.save(tmp_path)
    seal.seal(tmp_path)
    found = Lightmap.load(tmp_path)
    assert found.quality == {"rays": 64}
    for name in ("texels", "size", "grid", "cell_size", "origin"):
        assert getattr(found.faces, name) == getattr(FACES, name)
    assert np.array_equal(found.faces.rectangles, FACES.rectangles)
    assert np.array_equal(found.faces.pages, FACES.pages)
    assert np.array_equal(found.faces.page_of, FACES.page_of)
    there = FACES.cell() >= 0
    # Half floats round to 11 bits
    np.testing.assert_allclose(found.irradiance[there], saved.irradiance[there], rtol=2**-11)
    np.testing.assert_allclose(found.error[there], saved.error[there], rtol=2**-11, atol=1e-7)


def test_equal_lightmaps_are_equal_files(tmp_path: Path) -> None:
    saved, files = lightmap(), []
    for name in "ab":
        (tmp_path / name).mkdir()
        saved.save(tmp_path / name)
        files.append({p.name: p.read_bytes() for p in (tmp_path / name).iterdir()})
    assert files[0] == files[1]


def test_gutters_are_filled_and_the_rest_is_empty() -> None:
    shown = lightmap()
    padded, source = shown.padded(), FACES.source()
    unused = source[..., 0] < 0
    assert unused.any()
    assert not padded[unused].any()
    assert np.all(padded[~unused][:, 3] == 1)
    x, y = source[~unused].astype(int).T
    assert np.array_equal(padded[~unused][:, :3], shown.irradiance[y, x])


def test_light_beyond_half_floats_is_clamped_and_counted(tmp_path: Path) -> None:
    bright = lightmap()
    y, x = np.argwhere(FACES.cell() >= 0)[0]
    bright.irradiance[y, x, 1] = 1e6
    bright.save(tmp_path)
    assert Lightmap.load(tmp_path).irradiance[y, x, 1] == LARGEST
    assert '"clamped": 1' in (tmp_path / "report.json").read_text()


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
@pytest.mark.parametrize("name", ["irradiance", "error"])
def test_light_that_is_none_is_refused(tmp_path: Path, name: str, value: float) -> None:
    spoilt = getattr(lightmap(), name).copy()
    spoilt[0, 0, 0] = value
    with pytest.raises(InputError, match=name):
        replace(lightmap(), **{name: spoilt}).save(tmp_path)
    with pytest.raises(InputError, match=name):
        replace(lightmap(), **{name: spoilt[:-1]}).save(tmp_path)


@pytest.mark.parametrize("name", ["lightmap.ktx2", "error.ktx2", "faces.npz", "report.json"])
def test_changed_bytes_are_found(tmp_path: Path, name: str) -> None:
    lightmap().save(tmp_path)
    seal.seal(tmp_path)
    data = bytearray((tmp_path / name).read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DamagedError):
        Lightmap.load(tmp_path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("axis", 3),
        ("axis", -1),
        ("sign", 0),
        ("plane", 9),
        ("plane", -1),
        ("u", -1),
        ("v", 4),
        ("width", 99),
        ("width", 0),
        ("height", 2**31 - 1),
        ("x", 0),
        ("y", 16000),
    ],
)
def test_rectangles_out_of_range_are_found(tmp_path: Path, name: str, value: int) -> None:
    spoilt = FACES.rectangles.copy()
    spoilt[name][0] = value
    shown = lightmap()
    # Save what a broken writer would
    shown.save(tmp_path)
    np.savez_compressed(tmp_path / "faces.npz", rectangles=spoilt)
    with pytest.raises(DamagedError, match="rectangles"):
        Lightmap.load(tmp_path)


def test_no_other_bytes_of_rectangles_raise_anything_else(tmp_path: Path) -> None:
    lightmap().save(tmp_path)
    whole = (tmp_path / "faces.npz").read_bytes()
    refused = 0
    for k in range(150):
        data = bytearray(whole)
        at = RNG.integers(len(data), size=3)
        data[at[0]] = RNG.integers(256)
        cut = len(data) if k % 3 else int(at[1])
        (tmp_path / "faces.npz").write_bytes(bytes(data[: max(cut, 1)]))
        with suppress(BakelightError):
            Lightmap.load(tmp_path)
            continue
        refused += 1
    assert refused > 75


def test_another_kind_is_refused(tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text('{"kind": "voxels", "format": 1}')
    with pytest.raises(DamagedError, match="kind"):
        Lightmap.load(tmp_path)
