"""The table of planted mistakes fits the code: `make plant` runs it."""

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MISTAKES = runpy.run_path(str(ROOT / "tools" / "planted_bugs.py"))["MISTAKES"]


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda m: m.name)
def test_each_mistake_has_its_place_and_its_tests(mistake) -> None:
    text = (ROOT / mistake.file).read_text(encoding="utf-8")
    assert text.count(mistake.old) == 1
    assert mistake.old != mistake.new
    for tests in mistake.tests.split():
        assert (ROOT / tests).exists()


def test_there_are_many() -> None:
    assert len({m.name for m in MISTAKES}) == len(MISTAKES) >= 25
