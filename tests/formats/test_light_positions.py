"""Files of light positions as they are found in the wild, and what is refused by name and line."""

from pathlib import Path

import numpy as np
import pytest

from formats.errors import InputError
from formats.files import light_positions


def written(folder: Path, text: str | bytes, *names: str) -> Path:
    """A .lp file, and empty photographs beside it: the reader only asks whether they are there."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")
    path = folder / "set.lp"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_plain_file(tmp_path: Path) -> None:
    path = written(tmp_path, "2\na.jpg 0 0 1\nb.jpg 0.6 0 0.8\n", "a.jpg", "b.jpg")
    lights = light_positions.read(path)
    assert lights.files == (tmp_path / "a.jpg", tmp_path / "b.jpg")
    # One rounding of a division by a length of 1 within two
    np.testing.assert_allclose(lights.directions, [[0, 0, 1], [0.6, 0, 0.8]], rtol=4 * 2.0**-53)
    assert lights.notes == ()


def test_bytes_of_other_machines(tmp_path: Path) -> None:
    text = (
        b"\xef\xbb\xbf3   \r\n"
        b"C:\\photos of 2019\\big coin 1.jpg\t0\t0.5\t0.5 \r\n"
        b"\r\n"
        b"sub\\two.png 0.3 -0.4 0\r\n"
        b"/home/user/set/three .tif 1e0 0 -0.001\r\n\r\n"
    )
    names = ("big coin 1.jpg", "sub/two.png", "three .tif")
    lights = light_positions.read(written(tmp_path, text, *names))
    assert lights.files == tuple(tmp_path / name for name in names)
    np.testing.assert_allclose(
        lights.directions,
        [[0, 0.5**0.5, 0.5**0.5], [0.6, -0.8, 0], np.array([1, 0, -0.001]) / (1 + 1e-6) ** 0.5],
        rtol=1e-15,
    )
    assert [note for note in lights.notes if "below the horizon" in note and "1 light" in note]


def test_latin_names_are_read(tmp_path: Path) -> None:
    path = written(tmp_path, "1\nm\xfcnze.jpg 0 0 1\n".encode("latin-1"), "m\xfcnze.jpg")
    assert light_positions.read(path).files == (tmp_path / "m\xfcnze.jpg",)


@pytest.mark.parametrize("coding", ["utf-16-le", "utf-16-be"])
def test_sixteen_bits_a_letter_are_read(tmp_path: Path, coding: str) -> None:
    text = "\ufeff1\r\na\u0142.jpg 0 0 1\r\n".encode(coding)
    path = written(tmp_path, text, "a\u0142.jpg")
    assert light_positions.read(path).files == (tmp_path / "a\u0142.jpg",)


def test_case_is_forgiven_where_one_file_alone_can_be_meant(tmp_path: Path) -> None:
    path = written(tmp_path, "2\nC:\\A.JPG 0 0 1\nb.jpg 0 0 1\n", "a.jpg", "b.jpg", "B.jpg")
    if len(list(tmp_path.iterdir())) < 4:
        pytest.skip("the file system does not tell upper case from lower")
    assert light_positions.read(path).files == (tmp_path / "a.jpg", tmp_path / "b.jpg")
    path.write_text("1\nB.JPG 0 0 1\n")
    with pytest.raises(InputError, match=r"B\.JPG"):
        light_positions.read(path)


def test_a_file_in_the_named_folder_goes_before_one_beside(tmp_path: Path) -> None:
    path = written(tmp_path, "1\nsub/a.jpg 0 0 1\n", "a.jpg", "sub/a.jpg")
    assert light_positions.read(path).files == (tmp_path / "sub" / "a.jpg",)


def test_strange_lengths_and_repeats_are_told(tmp_path: Path) -> None:
    path = written(tmp_path, "2\na.jpg 0 0 90\na.jpg 0 0 0.9\n", "a.jpg")
    lights = light_positions.read(path)
    assert np.array_equal(lights.directions, [[0, 0, 1], [0, 0, 1]])
    assert len(lights.notes) == 2
    assert "0.9 to 90 long" in lights.notes[0]
    assert "more than once" in lights.notes[1]


@pytest.mark.parametrize(
    ("text", "where", "value"),
    [
        ("3\na.jpg 0 0 1\n", "count", "3 announced, 1 lines"),
        ("0\n", "line 1", "0"),
        ("a.jpg 0 0 1\n", "line 1", "a.jpg"),
        ("-1\na.jpg 0 0 1\n", "line 1", "-1"),
        ("1\na.jpg 0 0\n", "line 2", "a.jpg 0 0"),
        ("1\n\na.jpg 0 x 1\n", "line 3", "a.jpg 0 x 1"),
        ("1\na.jpg 0 0 0\n", "line 2", "a.jpg 0 0 0"),
        ("1\na.jpg nan 0 1\n", "line 2", "nan"),
        ("1\na.jpg 0 nan 1\n", "line 2", "nan"),
        ("1\na.jpg 0 0 inf\n", "line 2", "inf"),
        ("1\na.jpg 0 0.9 -0.5\n", "line 2", "z = -0.486"),
        ("1\nmissing.jpg 0 0 1\n", "line 2", "missing.jpg"),
        ("\n \n", "line 1", ""),
    ],
)
def test_faults_are_named(tmp_path: Path, text: str, where: str, value: str) -> None:
    with pytest.raises(InputError) as caught:
        light_positions.read(written(tmp_path, text, "a.jpg"))
    assert caught.value.field == where
    assert value in str(caught.value)
