"""A folder is replaced whole, whoever else replaces it at the same time."""

import errno
import os
import sys
from pathlib import Path
from threading import Thread

import pytest

from formats.errors import MachineError
from pipelines import deliver
from pipelines.deliver import publish


def test_many_at_once_all_succeed_and_leave_one(tmp_path: Path) -> None:
    target, failed = tmp_path / "scene", []

    def often(number: int) -> None:
        try:
            for _ in range(40):
                publish(target, lambda folder: (folder / "who").write_text(str(number)))
        except Exception as error:
            failed.append(error)

    threads = [Thread(target=often, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    assert (target / "who").read_text() in "0123"
    assert [entry.name for entry in tmp_path.iterdir()] == ["scene"]


def placed(target: Path, text: str) -> None:
    publish(target, lambda folder: (folder / "what").write_text(text))


@pytest.mark.parametrize("exchanges", [True, False])
def test_a_folder_that_cannot_be_put_there_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exchanges: bool
) -> None:
    target, rename = tmp_path / "scene", os.rename
    placed(target, "old")

    def full(source: Path, place: Path) -> None:
        if source.name == "new":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        rename(source, place)

    monkeypatch.setattr(os, "rename", full)
    if not exchanges:
        monkeypatch.setattr(deliver, "_exchanged", lambda new, target: False)
    if exchanges and sys.platform == "linux":
        placed(target, "new")
        assert (target / "what").read_text() == "new"
    else:
        with pytest.raises(MachineError, match="No space left"):
            placed(target, "new")
        assert (target / "what").read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["scene"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc and renameat2")
def test_bytes_are_flushed_before_the_name_and_the_name_before_the_return(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[str] = []
    exchanged, fsync = deliver._exchanged, os.fsync

    def seen(descriptor: int) -> None:
        events.append(Path(os.readlink(f"/proc/self/fd/{descriptor}")).name)
        fsync(descriptor)

    def named(new: Path, target: Path) -> bool:
        events.append("named")
        return exchanged(new, target)

    placed(tmp_path / "scene", "old")
    monkeypatch.setattr(os, "fsync", seen)
    monkeypatch.setattr(deliver, "_exchanged", named)
    placed(tmp_path / "scene", "new")
    assert events == ["what", "new", "named", tmp_path.name]


def test_only_what_a_killed_delivery_left_is_swept(tmp_path: Path) -> None:
    swept, kept = tmp_path / ".tmp-scene-abcd_123", []
    (swept / "new").mkdir(parents=True)
    (swept / "old-0").mkdir()
    for name in (".tmp-scene-ABCD0123", ".tmp-other-abcd0123", "scene-abcd0123"):
        kept.append(tmp_path / name)
        (kept[-1] / "new").mkdir(parents=True)
    kept.append(tmp_path / ".tmp-scene-abcd0124")
    (kept[-1] / "letters").mkdir(parents=True)
    recent = tmp_path / ".tmp-scene-abcd0125"
    recent.mkdir()
    for path in (swept, *kept):
        os.utime(path, (0, 0))
    deliver.sweep(tmp_path / "scene")
    assert sorted(tmp_path.iterdir()) == sorted([*kept, recent])
