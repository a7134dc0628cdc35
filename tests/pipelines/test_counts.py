"""What a scene does not call for is not imported, compiled, allocated or baked: counted."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

COUNT = """
import json, sys
from pathlib import Path
from pipelines.render_scene import render_scene
scene, out, build = map(Path, sys.argv[1:])
job = render_scene(scene, out, size="64x36", build_folder=build)
entries = (build / "store").iterdir()
baked = [path.name.split("-")[0] for path in entries if "-" in path.name]
print(json.dumps({
    "modules": sorted(name for name in sys.modules if name.split(".")[0] in ("runtime", "bake")),
    "stages": sorted(baked), "profile": job.profile}))
"""
ALWAYS = {"sky", "billboard", "film"}


def counted(assets: Path, scene: str, build: Path) -> dict[str, Any]:
    """Bake and render a scene in a process of its own; then again, so that only playing counts."""
    command = [sys.executable, "-c", COUNT, str(assets / "scenes" / f"{scene}.toml")]
    command += [str(build / f"{scene}.png"), str(build)]
    for _ in range(2):
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def passes(counts: dict[str, Any]) -> set[str]:
    prefix = "runtime.passes."
    return {m.removeprefix(prefix) for m in counts["modules"] if m.startswith(prefix)}


@pytest.fixture
def plain(assets: Path, tmp_path: Path) -> dict[str, Any]:
    return counted(assets, "plain", tmp_path / "plain")


@pytest.mark.gpu
@pytest.mark.parametrize(
    ("part", "effect", "programs", "stages"),
    [
        # A lens changes the program of the sprites; fog has one of its own besides
        ("lens", "depth_of_field", 0, []),
        ("fog", "fog", 1, []),
        ("environment", "environment", 0, ["bake.environment.resample"]),
    ],
)
def test_a_part_adds_exactly_its_own(
    assets: Path,
    tmp_path: Path,
    plain: dict[str, Any],
    part: str,
    effect: str,
    programs: int,
    stages: list[str],
) -> None:
    more = counted(assets, part, tmp_path / part)
    assert passes(plain) == ALWAYS
    assert passes(more) == ALWAYS | {effect}
    assert sorted(more["stages"]) == sorted(plain["stages"] + stages)
    assert more["profile"]["programs"] == plain["profile"]["programs"] + programs
    assert more["profile"]["textures"] == plain["profile"]["textures"]
    assert set(more["profile"]["passes"]) - set(plain["profile"]["passes"]) == {effect}


@pytest.mark.gpu
def test_playing_what_is_baked_imports_nothing_of_bake(plain: dict[str, Any]) -> None:
    assert not [name for name in plain["modules"] if name.startswith("bake")]
