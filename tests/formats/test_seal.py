"""The seal: every change of a sealed byte is found, and nothing else is complained about."""

import json
import os
from pathlib import Path

import pytest

from formats import seal
from formats.errors import DamagedError, InputError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A sealed asset with a nested one."""
    (tmp_path / "assets" / "bush").mkdir(parents=True)
    (tmp_path / "planes.ktx2").write_bytes(bytes(range(256)))
    (tmp_path / "empty").touch()
    (tmp_path / "timings.json").write_text("{}")
    (tmp_path / "assets" / "bush" / "report.json").write_text("{}")
    (tmp_path / "assets" / "bush" / "timings.json").write_text("{}")
    (tmp_path / ".tmp-1-a").write_text("unfinished")
    seal.seal(tmp_path / "assets" / "bush")
    seal.seal(tmp_path)
    return tmp_path


def test_seal_lists_bytes_and_hashes(folder: Path) -> None:
    data = json.loads((folder / "seal.json").read_text())
    assert data["format"] == 1
    assert list(data["files"]) == [
        "assets/bush/report.json",
        "assets/bush/seal.json",
        "empty",
        "planes.ktx2",
    ]
    # sha256sum of the empty file and of the bytes 0 to 255
    empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    ramp = "40aff2e9d2d8922e47afd4648e6967497158785fbd1da870e7110266bf944880"
    assert data["files"]["empty"] == {"bytes": 0, "sha256": empty}
    assert data["files"]["planes.ktx2"] == {"bytes": 256, "sha256": ramp}


def test_sound_folder_verifies_and_reads(folder: Path) -> None:
    seal.verify(folder)
    assert seal.is_sealed(folder)
    assert seal.read_bytes(folder, "planes.ktx2") == bytes(range(256))
    assert seal.read_bytes(folder, "empty") == b""
    assert seal.read_bytes(folder, "assets/bush/report.json") == b"{}"


def test_sealing_again_changes_nothing(folder: Path) -> None:
    before = (folder / "seal.json").read_bytes()
    seal.seal(folder)
    assert (folder / "seal.json").read_bytes() == before


def test_times_temporaries_and_new_files_are_outside(folder: Path) -> None:
    (folder / "timings.json").write_text('{"seconds": 3}')
    (folder / "assets" / "bush" / "timings.json").unlink()
    (folder / ".tmp-1-a").unlink()
    (folder / "notes.txt").write_text("mine")
    seal.verify(folder)
    with pytest.raises(DamagedError, match="not sealed"):
        seal.read_bytes(folder, "notes.txt")


@pytest.mark.parametrize("name", ["planes.ktx2", "assets/bush/report.json", "empty"])
@pytest.mark.parametrize("damage", ["flip", "longer", "shorter", "missing"])
def test_damage_is_found_and_named(name: str, damage: str, folder: Path) -> None:
    path = folder / name
    data = path.read_bytes()
    if not data and damage in ("flip", "shorter"):
        damage = "longer"
    changed = {"flip": data[:-1] + b"!", "longer": data + b"\0", "shorter": data[:-1]}
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(changed[damage])
    for check in (lambda: seal.verify(folder), lambda: seal.read_bytes(folder, name)):
        with pytest.raises(DamagedError) as caught:
            check()
        assert str(path) in str(caught.value)
        assert caught.value.exit_code == 4


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"format": 2, "files": {}}',
        '{"format": 1}',
        '{"format": 1, "files": {"../a": {"bytes": 1, "sha256": "x"}}}',
        '{"format": 1, "files": {"/etc/passwd": {"bytes": 1, "sha256": "x"}}}',
        '{"format": 1, "files": {"a": {"bytes": -1, "sha256": "x"}}}',
        '{"format": 1, "files": {"a": {"bytes": 1.0, "sha256": "x"}}}',
        '{"format": 1, "files": {"a": {"bytes": 1}}}',
        '{"format": 1, "files": {"a": 1}}',
        "[" * 100_000,
    ],
)
def test_broken_seals_are_damage(text: str, tmp_path: Path) -> None:
    (tmp_path / "seal.json").write_text(text)
    with pytest.raises(DamagedError, match=r"seal\.json"):
        seal.verify(tmp_path)
    with pytest.raises(DamagedError):
        seal.read_bytes(tmp_path, "a")


def test_no_seal_is_damage(tmp_path: Path) -> None:
    assert not seal.is_sealed(tmp_path)
    with pytest.raises(DamagedError):
        seal.verify(tmp_path)


def test_links_and_missing_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        seal.seal(tmp_path / "missing")
    os.symlink("/etc/hostname", tmp_path / "link")
    with pytest.raises(InputError, match="a link"):
        seal.seal(tmp_path)
    assert not (tmp_path / "seal.json").exists()
