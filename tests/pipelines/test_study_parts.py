"""Parts of a study: kept until its answer is there, each under its key, damaged ones made again."""

from pathlib import Path

import pytest

from pipelines.studies import parts


def test_parts_outlast_an_interruption_and_no_more(tmp_path: Path) -> None:
    made: list[str] = []

    def make() -> list[float]:
        made.append("a")
        return [0.1, 3]

    def interrupted(key: str) -> None:
        with parts.into(tmp_path / "p", key):
            assert parts.part("a, of b", make) == [0.1, 3]
            raise KeyboardInterrupt

    for key in ("one", "two"):
        with pytest.raises(KeyboardInterrupt):
            interrupted(key)
    assert len(made) == 2
    with parts.into(tmp_path / "p", "one"):
        assert parts.part("a, of b", make) == [0.1, 3]
        assert parts.part("a, of c", make) == [0.1, 3]
    assert len(made) == 3
    assert not (tmp_path / "p").exists()
    # Outside of a study, and without a key, nothing is kept
    with parts.into(tmp_path / "p", ""):
        parts.part("a, of b", make)
    parts.part("a, of b", make)
    assert len(made) == 5


def test_a_damaged_part_is_made_again(tmp_path: Path) -> None:
    with parts.into(tmp_path / "p", "key"):
        parts.part("a", lambda: [1])
        (tmp_path / "p" / "key" / "a.json").write_bytes(b"[1")
        assert parts.part("a", lambda: [2]) == [2]
