"""What a photographed source consists of, and how large it is without decoding it."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from formats import photograph_files
from formats.errors import InputError
from formats.files import image


def written(folder: Path, name: str) -> Path:
    path = folder / "set.lp"
    path.write_text(f"1\n{name} 0 0 1\n")
    return path


def test_files_are_listed_once_with_the_list_first(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        (tmp_path / name).touch()
    path = tmp_path / "set.LP"
    path.write_text("3\nb.png 0 0 1\na.png 0 1 1\nb.png 1 0 1\n")
    assert photograph_files.is_photographed(path)
    assert photograph_files.files(path) == (path, tmp_path / "b.png", tmp_path / "a.png")
    (tmp_path / "other").mkdir()
    assert photograph_files.require_inside(path, tmp_path) == photograph_files.files(path)
    with pytest.raises(InputError, match=r"b\.png"):
        photograph_files.require_inside(path, tmp_path / "other")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_the_size_is_that_of_the_picture_as_it_is_read(tmp_path: Path, orientation: int) -> None:
    exif = Image.Exif()
    exif[274] = orientation
    Image.new("RGB", (20, 8)).save(tmp_path / "a.jpg", exif=exif)
    path = written(tmp_path, "a.jpg")
    height, width, _ = image.read(tmp_path / "a.jpg").shape
    assert photograph_files.size(path) == (width, height)


def test_the_size_of_png(tmp_path: Path) -> None:
    image.write(tmp_path / "a.png", np.zeros((3, 5, 3)))
    assert photograph_files.size(written(tmp_path, "a.png")) == (5, 3)


def test_what_is_no_picture_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("no picture")
    with pytest.raises(InputError, match=r"a\.png"):
        photograph_files.size(written(tmp_path, "a.png"))
