"""The committed results: every question has an answer, and errors converge as they should."""

import json
from pathlib import Path
from typing import Any

import pytest

from pipelines.studies import kept, run

RESULTS = kept.ROOT / "results"
FOLDERS = sorted(p for p in RESULTS.iterdir() if p.is_dir())


def read(folder: Path, question: str) -> dict[str, Any]:
    found = json.loads((folder / f"{question}.json").read_text(encoding="utf-8"))
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda p: p.name)
def test_every_question_has_an_answer_with_a_date_and_a_truth(folder: Path) -> None:
    for question in run.QUESTIONS:
        found = read(folder, question)
        assert found["answer"]
        assert found["truth"]
        assert found["date"]
        assert found["machine"]
        points = [row for row in found["rows"] if "setting" in row]
        assert points, question
        for row in points:
            assert row["error_low"] <= row["error"] <= row["error_high"], question
        assert (folder / f"{question}.csv").is_file()
        assert (folder / f"{question}.svg").is_file()


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda p: p.name)
def test_slopes_are_those_of_theory(folder: Path) -> None:
    slopes = read(folder, "sampling_pattern")["figures"]["slopes"]
    # Independent rays: the variance of a mean. The tolerance is the aim
    assert slopes["independent"] == pytest.approx(-0.5, abs=0.05)
    assert max(slope for name, slope in slopes.items() if name != "independent") <= -0.70
    slopes = read(folder, "gather_rays")["figures"]["slopes"]
    # One ray a texel a pass: evenly spread directions are steeper than independent ones, which
    # fall as 1 / sqrt(passes)
    assert slopes["independent, no bounces"] == pytest.approx(-0.5, abs=0.05)
    assert slopes["evenly spread, no bounces"] <= -0.70
    assert all(slope <= -0.4 for slope in slopes.values())


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda p: p.name)
def test_lights_go_from_one_to_ten_thousand(folder: Path) -> None:
    counted = {"sprite_lights": "lights", "shadow_lights": "count", "gather_lights": "glowing"}
    counted["mesh_lights"] = "lamps"
    for question, column in counted.items():
        points = [r for r in read(folder, question)["rows"] if "setting" in r]
        assert {1, 10_000} <= {row[column] for row in points}, question
        assert all(float(row["error"]) > 0 for row in points), question
