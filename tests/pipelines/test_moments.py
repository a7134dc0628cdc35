"""Names of files: numbers where asked for, one file a moment."""

from pathlib import Path

import pytest

from formats import scene as scenes
from formats.errors import InputError
from pipelines import moments


@pytest.fixture
def scene(assets: Path) -> scenes.Scene:
    return scenes.load(assets / "scenes/plain.toml")


@pytest.mark.parametrize(
    ("out", "names"),
    [
        ("####.png", ["0000.png", "0002.png"]),
        ("moth.##.exr", ["moth.00.exr", "moth.02.exr"]),
        ("moth.%03d.exr", ["moth.000.exr", "moth.002.exr"]),
        ("moth-%d.PNG", ["moth-0.PNG", "moth-2.PNG"]),
        ("deep/", ["deep/plain-00000.png", "deep/plain-00002.png"]),
        ("deep.exr", ["deep/plain-00000.exr", "deep/plain-00002.exr"]),
    ],
)
def test_names_of_a_sequence(
    scene: scenes.Scene, tmp_path: Path, out: str, names: list[str]
) -> None:
    found = moments.chosen(scene, (), "0:4:2", tmp_path / out)
    files = [moments.target(tmp_path / out, moment) for moment in found]
    assert files == [tmp_path / name for name in names]
    assert [moment.time for moment in found] == [0.0, 0.5]
    assert all(file.parent.is_dir() for file in files)


def test_numbers_wider_than_their_place_stay_whole() -> None:
    assert moments.numbered_name("a.##.png", 12345) == "a.12345.png"


@pytest.mark.parametrize(("out", "frames"), [("####.png", None), ("a.####.gif", "0:4")])
def test_a_numbered_name_that_makes_no_sense(
    scene: scenes.Scene, out: str, frames: str | None
) -> None:
    with pytest.raises(InputError, match="numbered name"):
        moments.chosen(scene, (), frames, Path(out))


def test_one_frame_by_number_is_one_file(scene: scenes.Scene, tmp_path: Path) -> None:
    (moment,) = moments.chosen(scene, (), "3:4", tmp_path / "one.png")
    assert moments.target(tmp_path / "one.png", moment) == tmp_path / "one.png"
