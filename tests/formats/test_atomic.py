"""Files appear whole or not at all, in the order of calls that survives a power cut."""

import errno
import os
from pathlib import Path

import pytest

from formats.errors import InputError, MachineError
from formats.files import atomic


def test_write_replaces_whole_files(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    atomic.write_bytes(path, b"one")
    atomic.write_bytes(path, b"two")
    assert path.read_bytes() == b"two"
    assert [p.name for p in tmp_path.iterdir()] == ["a.bin"]


def test_file_then_rename_then_folder_are_flushed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """kill -9 cannot test fsync, since the page cache survives it: the order of calls can."""
    calls: list[str] = []
    fsync, replace = os.fsync, os.replace

    def seen_fsync(descriptor: int) -> None:
        target = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        calls.append("folder" if target == tmp_path else f"file of {target.stat().st_size}")
        fsync(descriptor)

    def seen_replace(source: Path, target: Path) -> None:
        calls.append(f"rename to {Path(target).name}")
        replace(source, target)

    monkeypatch.setattr(os, "fsync", seen_fsync)
    monkeypatch.setattr(os, "replace", seen_replace)
    atomic.write_bytes(tmp_path / "a.bin", b"12345")
    assert calls == ["file of 5", "rename to a.bin", "folder"]


def test_a_failing_block_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    atomic.write_bytes(path, b"old")

    def fail() -> None:
        with atomic.replacing(path) as temporary:
            temporary.write_bytes(b"half of the n")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.bin"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_full_disk_is_the_machine(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(code, os.strerror(code))

    path = tmp_path / "a.bin"
    atomic.write_bytes(path, b"old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(MachineError, match=r"a\.bin"):
        atomic.write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.bin"]


def test_a_folder_that_cannot_be_written_is_input(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path / "missing" / "a.bin", tmp_path / "file" / "a.bin"):
        with pytest.raises(InputError, match=r"a\.bin"):
            atomic.write_bytes(path, b"new")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError):
        atomic.write_bytes(tmp_path / "folder", b"new")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def test_old_temporaries_alone_are_swept(tmp_path: Path) -> None:
    """What a killed render left goes after hours; what is new, or another's, stays."""
    with atomic.replacing(tmp_path / "a.png") as temporary:
        temporary.write_bytes(b"x")
        left = tmp_path / f".tmp-1-{temporary.name[-12:]}"
        left.write_bytes(b"x")
    others = [tmp_path / ".tmp-mine", tmp_path / ".tmp-2-0123456789ab", tmp_path / "a.png"]
    for file in others[:2]:
        file.write_bytes(b"x")
    for file in (left, others[0], others[2]):
        os.utime(file, (0, 0))
    atomic.sweep(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted(others)
