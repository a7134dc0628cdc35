"""A folder is replaced whole, whoever else replaces it at the same time."""

from pathlib import Path
from threading import Thread

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
