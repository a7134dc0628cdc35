"""Sets of photographs as arrays: spaces, sizes, alpha, and what the reader is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bake import photographs
from formats.errors import InputError, MachineError
from formats.files import image
from pipelines.studies.glossy_ball import ball, lights
from tests.bake.domes import written


def test_pictures_come_back_in_both_spaces(tmp_path: Path) -> None:
    path = written(tmp_path, lights(6), 8)
    linear = photographs.load(path)
    stored = photographs.load(path, space="stored")
    truth = ball(lights(6), 8)
    # Half a code of sRGB is at most .5 / 255 times its steepest slope, 2.28
    np.testing.assert_allclose(linear.pictures, truth, atol=0.5 / 255 * 2.28)
    for n in range(6):
        expected = image.read(tmp_path / f"light {n}.png", space="stored")
        assert np.array_equal(stored.pictures[n], expected)
    # Nine decimals are written
    np.testing.assert_allclose(linear.directions, lights(6), atol=1e-9)
    assert (linear.space, stored.space, linear.notes) == ("linear", "stored", ())


def test_grey_is_spread_and_opaque_alpha_dropped(tmp_path: Path) -> None:
    path = written(tmp_path, lights(2), 4)
    image.write(tmp_path / "light 0.png", np.full((4, 4, 1), 100, np.uint8))
    opaque = np.full((4, 4, 4), 255, np.uint8)
    image.write(tmp_path / "light 1.png", opaque)
    loaded = photographs.load(path, space="stored")
    assert np.all(loaded.pictures[0] == np.float32(100 / 255))
    opaque[0, 0, 3] = 254
    image.write(tmp_path / "light 1.png", opaque)
    with pytest.raises(InputError, match=r"light 1\.png: alpha"):
        photographs.load(path)


def test_another_size_is_refused_by_name(tmp_path: Path) -> None:
    path = written(tmp_path, lights(5), 6)
    image.write(tmp_path / "light 3.png", np.zeros((6, 7, 3), np.uint8))
    with pytest.raises(InputError, match=r"light 3\.png: size: 7 x 6 -- light 0\.png has 6 x 6"):
        photographs.load(path)


def test_what_cannot_be_held_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, lights(3), 4)
    monkeypatch.setattr(photographs, "MAX_BYTES", 3 * 4 * 4 * 3 * 4 - 1)
    with pytest.raises(MachineError, match="3 photographs of 4 x 4"):
        photographs.load(path)


def test_black_white_and_grazing_are_told(tmp_path: Path) -> None:
    low = lights(6)
    low[5] = [np.cos(0.08), 0, np.sin(0.08)]  # 4.6 degrees
    path = written(tmp_path, low, 4)
    image.write(tmp_path / "light 1.png", np.zeros((4, 4, 3), np.uint8))
    image.write(tmp_path / "light 2.png", np.full((4, 4, 3), 255, np.uint8))
    notes = photographs.load(path).notes
    assert "light 1.png is black" in notes
    assert "light 2.png is overexposed: 100% of it is white" in notes
    assert "1 lights stand under 5 degrees" in notes[-1]


def test_a_photograph_stands_a_metre_high_on_its_lower_edge() -> None:
    pictures = np.zeros((3, 8, 5, 3), np.float32)
    made = photographs.Photographs(pictures, lights(3), "linear")
    assert (made.metres_per_texel, made.pivot, made.height) == (1 / 8, (2.5, 8.0), 1.0)
    two = photographs.Photographs(pictures, lights(3), "linear", views=2)
    assert (two.metres_per_texel, two.pivot) == (1 / 4, (2.5, 4.0))
    kept = photographs.Photographs(
        pictures, lights(3), "linear", metres_per_texel=0.5, pivot=(1.0, 2.0), height=4.0
    )
    assert (kept.metres_per_texel, kept.pivot, kept.height) == (0.5, (1.0, 2.0), 4.0)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("views", 3),
        ("space", "log"),
        ("coverage", np.full((8, 5), 1.5, np.float32)),
        ("coverage", np.ones((5, 8), np.float32)),
        ("directions", np.zeros((3, 3))),
        ("pictures", np.full((3, 8, 5, 3), np.nan, np.float32)),
    ],
)
def test_broken_sets_are_refused_by_field(field: str, value: object) -> None:
    made = photographs.Photographs(np.zeros((3, 8, 5, 3), np.float32), lights(3), "linear")
    with pytest.raises(InputError) as refusal:
        replace(made, **{field: value}).checked()  # type: ignore[arg-type]
    assert refusal.value.field == field
