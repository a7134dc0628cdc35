"""Pictures of people's own making become sprites, or are refused in one line."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import png
import pytest
from PIL import Image

from bake import mips, picture
from formats import picture_files
from formats.errors import InputError
from formats.files import exr, image
from formats.picture import Picture
from maths import colour

HALF = 2.0**-11  # relative rounding of a half float


def blob(height: int = 24, width: int = 36) -> Any:
    """Straight sRGB floats (h, w, 4): an ellipse that fades, of a hue that changes."""
    y, x = (np.arange(n) + 0.5 - n / 2 for n in (height, width))
    r = np.hypot(x[None] / width, y[:, None] / height) * 2
    alpha = np.clip((0.9 - r) / 0.3, 0, 1)
    shade = np.stack([0.9 * np.ones_like(r), 0.5 + 0.3 * r / 2, 0.2 + 0 * r], axis=-1)
    return np.concatenate([shade, alpha[..., None]], axis=-1)


def saved(path: Path, mode: str, codes: Any, **more: Any) -> Path:
    Image.fromarray(codes, mode).save(path, **more)
    return path


def test_a_png_becomes_premultiplied_linear_light(tmp_path: Path) -> None:
    codes = np.rint(blob() * 255).astype(np.uint8)
    path = saved(tmp_path / "a.png", "RGBA", codes)
    found = picture.load(path)
    alpha = codes[..., 3:] / 255
    expected = np.concatenate([colour.srgb_decode(codes[..., :3] / 255) * alpha, alpha], axis=-1)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7)


def test_an_exr_is_taken_as_it_is(tmp_path: Path) -> None:
    values = blob().astype(np.float32)
    values[..., :3] *= 7 * values[..., 3:]
    exr.write(tmp_path / "a.exr", {"": values})
    np.testing.assert_array_equal(picture.load(tmp_path / "a.exr"), values)
    # Light without coverage stays: it adds
    values[..., 3] = 0
    exr.write(tmp_path / "b.exr", {"": values})
    np.testing.assert_array_equal(picture.load(tmp_path / "b.exr"), values)
    assert picture_files.size(tmp_path / "b.exr") == (36, 24)


def deep(path: Path, codes: Any) -> Path:
    with path.open("wb") as file:
        writer = png.Writer(
            codes.shape[1], codes.shape[0], bitdepth=16, greyscale=False, alpha=True
        )
        writer.write(file, codes.reshape(len(codes), -1).tolist())
    return path


def test_every_kind_of_png_is_read(tmp_path: Path) -> None:
    codes = np.rint(blob(7, 13) * 255).astype(np.uint8)
    grey, alpha = codes[..., 0], codes[..., 3]
    kinds = {
        "grey": saved(tmp_path / "grey.png", "L", grey),
        "grey-alpha": saved(tmp_path / "la.png", "LA", np.stack([grey, alpha], axis=-1)),
        "opaque": saved(tmp_path / "rgb.png", "RGB", np.ascontiguousarray(codes[..., :3])),
        "palette": saved(tmp_path / "p.png", "P", grey % 4),
        "bits": saved(tmp_path / "one.png", "1", grey > 100),
        "deep": deep(tmp_path / "deep.png", codes.astype(np.uint16) * 257),
    }
    steps = np.repeat(np.arange(13, dtype=np.uint8)[None, :, None] * 18, 7, axis=0)
    colours = Image.fromarray(np.repeat(steps, 3, axis=2)).quantize(8)
    colours.save(kinds["palette"], transparency=0)
    found = {name: picture.load(path) for name, path in kinds.items()}
    assert {each.shape for each in found.values()} == {(7, 13, 4)}
    assert all(found[name][..., 3].min() == 1 for name in ("grey", "opaque", "bits"))
    assert all(found[name][..., 3].min() == 0 for name in ("grey-alpha", "palette", "deep"))
    np.testing.assert_array_equal(*np.moveaxis(found["grey"][..., :2], -1, 0))
    whole = picture.load(saved(tmp_path / "a.png", "RGBA", codes))
    np.testing.assert_allclose(found["deep"], whole, rtol=1e-6, atol=1e-7)
    for path in kinds.values():
        baked = picture.prepare(picture.load(path), params=picture.of_file(path, 0, 0.0))
        assert baked.quality["size"] == [13, 7]


def refused(path: Path, resolution: int = 0) -> InputError:
    with pytest.raises(InputError) as caught:
        picture.prepare(picture.load(path), params=picture.of_file(path, resolution, 0.0))
    assert "\n" not in str(caught.value)
    return caught.value


def test_what_cannot_be_shown_is_refused(tmp_path: Path) -> None:
    saved(tmp_path / "none.png", "RGBA", np.zeros((5, 5, 4), np.uint8))
    assert "all transparent" in str(refused(tmp_path / "none.png"))
    for name, data in (("empty.png", b""), ("text.png", b"hello"), ("text.exr", b"hello")):
        (tmp_path / name).write_bytes(data)
        refused(tmp_path / name)
        with pytest.raises(InputError):
            picture_files.size(tmp_path / name)
    whole = io.BytesIO()
    Image.fromarray(np.rint(blob() * 255).astype(np.uint8)).save(whole, "PNG")
    (tmp_path / "cut.png").write_bytes(whole.getvalue()[:-40])
    refused(tmp_path / "cut.png")
    (tmp_path / "jpeg.png").write_bytes(b"\xff\xd8\xff\xe0" + bytes(100))
    refused(tmp_path / "jpeg.png")
    two = {name: blob().astype(np.float32) for name in ("left", "right")}
    exr.write(tmp_path / "two.exr", two)
    assert "left, right" in str(refused(tmp_path / "two.exr"))


def test_huge_pictures_are_refused_or_shrunk(tmp_path: Path) -> None:
    wide = np.zeros((2, 5000, 4), np.uint8)
    wide[:, :, 0] = wide[:, :, 3] = 255
    path = saved(tmp_path / "wide.png", "RGBA", wide)
    assert "resolution = 4096" in str(refused(path))
    params = picture.of_file(path, 100, 0.0)
    assert (params.width, params.height) == (100, 1)
    baked = picture.prepare(picture.load(path), params=params)
    border = baked.quality["border"]
    assert np.all(baked.levels[0][0, border, border : border + 100] == [1, 0, 0, 1])


def test_shrinking_keeps_light_and_coverage() -> None:
    values = blob(50, 70).astype(np.float32)
    small = picture.shrunk(values, 7, 5)
    # By whole blocks it is their mean, to the rounding of floats
    expected = values.reshape(5, 10, 7, 10, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(small, expected, atol=1e-6)


def premultiplied() -> Any:
    values = blob().astype(np.float32)
    values[..., :3] *= values[..., 3:]
    return values


@pytest.mark.parametrize("max_lod", [0.0, 4.0])
def test_levels_keep_light_and_fade_out_without_fringes(max_lod: float) -> None:
    values = premultiplied()
    params = picture.Params(width=36, height=24, max_lod=max_lod)
    baked = picture.prepare(values, params=params)
    light = values.sum(axis=(0, 1))
    counted = 1 + int(max(max_lod, np.log2(36 / picture.FEWEST)))
    for n, level in enumerate(baked.levels[:counted]):
        total = level[0].astype(np.float64).sum(axis=(0, 1)) * 4.0**n
        # Rounding to half floats
        np.testing.assert_allclose(total, light, rtol=HALF)
        assert not level[:, [0, -1]].any()
        assert not level[:, :, [0, -1]].any()
        assert level.min() >= 0
        assert level[..., 3].max() <= 1
        # The same red everywhere that shows: no dark or bright rim of straight alpha
        shows = level[0, ..., 3] > 0.01
        red = level[0, shows, 0].astype(float) / level[0, shows, 3]
        np.testing.assert_allclose(red, 0.9, rtol=4 * HALF)
    assert baked.brightest == pytest.approx(0.9, rel=0.02)


def test_a_picture_is_saved_and_read(tmp_path: Path) -> None:
    baked = picture.prepare(premultiplied(), params=picture.Params(width=36, height=24, max_lod=3))
    assert baked.lens_scale == mips.FILTERS["gaussian"].lens_scale
    assert baked.metres_per_texel == 1 / 24
    border = baked.quality["border"]
    assert baked.pivot == (border + 18, border + 24)
    baked.save(tmp_path)
    found = Picture.load(tmp_path)
    assert all(np.array_equal(a, b) for a, b in zip(found.levels, baked.levels, strict=True))
    assert (found.pivot, found.brightest, found.max_lod) == (
        baked.pivot,
        baked.brightest,
        baked.max_lod,
    )
    assert found.quality == baked.quality


def test_an_image_written_by_this_project_is_read_back(tmp_path: Path) -> None:
    image.write(tmp_path / "a.png", blob().astype(np.float32))
    assert picture_files.size(tmp_path / "a.png") == (36, 24)
    assert picture_files.baked_size(tmp_path / "a.png", 12) == (12, 8)
