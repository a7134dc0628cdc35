"""Milliseconds of the last render, kept and asked for."""

from pathlib import Path
from typing import Any

import pytest

from formats import scene
from pipelines import pass_times, plan

RAW: dict[str, Any] = {
    "format": 1,
    "camera": {"position": [0, 1, 5], "target": [0, 1, 0]},
    "picture": {"sky": {"zenith": [0, 0, 1], "horizon": [1, 1, 1]}},
}
PROFILE = {
    "size": [1920, 540],
    "renderer": "soft",
    "timing": "wall clock",
    "milliseconds": {"sky": 4.0, "film": 6.0},
    "bytes": 7,
}


def made(**changes: Any) -> scene.Scene:
    return scene.from_dict({**RAW, **changes}, where="dusk.toml", root=None)


def test_times_scale_with_the_pixels_and_belong_to_one_scene(tmp_path: Path) -> None:
    assert pass_times.known(made(), tmp_path, 1080) == {}
    pass_times.keep(made(), tmp_path, PROFILE)
    # 1920 x 1080 has twice the pixels
    assert pass_times.known(made(), tmp_path, 1080) == {"sky": 8.0, "film": 12.0}
    changed = made(ground={})
    assert pass_times.known(changed, tmp_path, 1080) == {}


def test_what_cannot_be_kept_or_read_is_not_known(tmp_path: Path) -> None:
    (tmp_path / "timings").write_text("a file")
    pass_times.keep(made(), tmp_path, PROFILE)
    assert pass_times.known(made(), tmp_path, 1080) == {}
    other = tmp_path / "other"
    (other / "timings").mkdir(parents=True)
    (other / "timings/dusk.json").write_text('{"scene": 1}')
    assert pass_times.known(made(), other, 1080) == {}
    pass_times.keep(made(), tmp_path / "empty", {**PROFILE, "milliseconds": {}})
    assert not (tmp_path / "empty").exists()


def test_measured_times_replace_estimates() -> None:
    found = plan.build(made(), milliseconds={"sky": 8.0})
    effects = {effect.name: effect for effect in found.effects}
    assert (effects["sky"].milliseconds, effects["sky"].timed) == (8.0, "measured")
    assert effects["film"].timed == "estimate"
    assert effects["film"].milliseconds == pass_times.estimate("film", 1080) > 0
    # What is left out costs nothing
    assert effects["fog"].milliseconds == effects["ground"].bytes == 0
    assert found.milliseconds == pytest.approx(8.0 + effects["film"].milliseconds)
    assert "(estimate)" in plan.summary(found)
    both = plan.build(made(), milliseconds={"sky": 8.0, "film": 2.0})
    assert "10 ms (measured)" in plan.summary(both)
    assert "Nothing moves: one frame is enough." in plan.summary(both)
