"""The guide to a new effect, followed to the letter in a copy of the checkout."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("maths", "formats", "bake", "runtime", "pipelines")
STEP = re.compile(
    r"^\d\. (?P<new>New,|In) `(?P<file>[^`]+)`(?P<text>.*?)\n```\w+\n(?P<lines>.*?)^```$",
    re.M | re.S,
)
ANCHOR = re.compile(r"\b(after|before)\s+`([^`]+)`:", re.I)

# Bakes and plays a scene twice, in a process that imports the copy: counts, and the outline's truth
PLAY = """
import json, sys
from pathlib import Path
import numpy as np
import formats.plan, formats.effects
from pipelines.current import ensure
from formats import scene as scenes
path, build = map(Path, sys.argv[1:])
scene = scenes.load(path)
folder = ensure(path, scene, None, build)
before = {n for n in sys.modules if "outline" in n}
from runtime.player import Player
with Player(folder, size=(96, 54)) as player:
    linear = player.linear(0.0)
    nearness = 1.0 - np.frombuffer(
        player.targets.texture("depth").read(alignment=1), np.float32
    ).reshape(54, 96)[::-1].astype(np.float64)
    again = player.linear(0.0)
    profile = player.profile
np.save(build / f"{scene.name}.npy", linear)
np.save(build / f"{scene.name}-nearness.npy", nearness)
print(json.dumps({
    "from": formats.plan.__file__,
    "frame": formats.plan.FRAME,
    "rows": [row.name for row in formats.effects.EFFECTS],
    "modules": sorted(n for n in sys.modules if "outline" in n),
    "passes": profile["passes"], "programs": profile["programs"],
    "textures": profile["textures"], "bytes": profile["bytes"],
    "skipped": profile["skipped"], "same": bool((linear == again).all()),
}))
"""


def follow(guide: str, checkout: Path) -> tuple[set[str], set[str]]:
    """Do what the guide says; return the files that it edits and those that it adds."""
    edited, added = set(), set()
    for step in STEP.finditer(guide):
        file, lines = checkout / step["file"], step["lines"]
        if step["new"] == "New,":
            assert not file.exists()
            file.write_text(lines)
            added.add(step["file"])
            continue
        where, anchor = ANCHOR.findall(step["text"])[-1]
        text = file.read_text()
        line = anchor + "\n"
        assert text.count(line) == 1, f"{step['file']} has {anchor!r} {text.count(line)} times"
        file.write_text(
            text.replace(line, line + lines if where.lower() == "after" else lines + line)
        )
        edited.add(step["file"])
    return edited, added


def in_copy(checkout: Path, *command: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(checkout), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, *command],
        cwd=checkout,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def edges(nearness: Any, width: int) -> Any:
    """The pixels of the lines, in numpy."""
    import numpy as np

    padded = np.pad(nearness, width, mode="edge")
    h, w = nearness.shape
    right, left = padded[width : width + h, 2 * width :], padded[width : width + h, :w]
    up, down = padded[:h, width : width + w], padded[2 * width :, width : width + w]
    both = [np.abs(a + b - 2 * nearness) for a, b in ((left, right), (up, down))]
    nearest = np.max([left, right, up, down, np.maximum(nearness, 1e-6)], axis=0)
    return np.maximum(*both), 0.05 * nearest


@pytest.mark.gpu
def test_an_effect_is_added_in_one_column(assets: Path, tmp_path: Path) -> None:
    import numpy as np

    checkout = tmp_path / "checkout"
    for package in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / package, checkout / package, ignore=ignored)
    guide = (ROOT / "CONTRIBUTING.md").read_text().partition("## A new effect in five minutes")[2]
    edited, added = follow(guide.partition("\n## ")[0], checkout)
    assert edited == {"formats/plan.py", "formats/scene.py", "formats/effects.py"}
    assert added == {"runtime/passes/outline.py", "runtime/passes/outline.frag"}
    # The last table of the scene is [picture]
    plain = assets / "scenes/surface.toml"
    drawn = plain.with_name("drawn.toml")
    drawn.write_text(plain.read_text() + "outline = { width = 2.0, strength = 0.75 }\n")
    counts = {}
    for scene in (plain, drawn):
        done = in_copy(checkout, "-c", PLAY, str(scene), str(tmp_path))
        assert done.returncode == 0, done.stderr
        counts[scene.stem] = json.loads(done.stdout)
    less, more = counts["surface"], counts["drawn"]
    assert Path(more["from"]).is_relative_to(checkout)
    assert more["frame"] == more["rows"]
    # A scene without it imports, compiles and allocates nothing of it
    assert less["modules"] == []
    assert more["modules"] == ["runtime.passes.outline"]
    assert set(more["passes"]) - set(less["passes"]) == {"outline"}
    assert more["programs"] == less["programs"] + 1
    assert (more["textures"], more["bytes"]) == (less["textures"], less["bytes"])
    # Asked again it draws nothing
    assert more["same"]
    assert "outline" in more["skipped"]
    # The lines are where depth folds, and nowhere else; sprites, drawn later, hide some
    nearness = np.load(tmp_path / "drawn-nearness.npy")
    bend, most = edges(nearness, 2)
    without, lined = np.load(tmp_path / "surface.npy"), np.load(tmp_path / "drawn.npy")
    changed = (without != lined).any(axis=-1)
    assert 0.005 < changed.mean() < 0.2
    assert not changed[bend < 0.99 * most].any()
    # Measured 0.89: the rest lies behind sprites
    assert changed[bend > 1.01 * most].mean() > 0.8
    # Half floats round to 2^-11 of a value, once each in two blends
    open_sky = changed & (nearness == 0.0) & (lined[..., :3] < 0.3 * without[..., :3]).all(axis=-1)
    assert open_sky.any()
    darkened = 0.25 * without[open_sky][:, :3]
    np.testing.assert_allclose(lined[open_sky][:, :3], darkened, rtol=2.0**-10)


def test_the_copy_plans_it_and_tells_a_typo_in_one_line(assets: Path, tmp_path: Path) -> None:
    checkout = tmp_path / "checkout"
    for package in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / package, checkout / package, ignore=ignored)
    follow((ROOT / "CONTRIBUTING.md").read_text(), checkout)
    command = ["-c", "from pipelines.cli import main; main()", "plan"]
    plain = assets / "scenes/plain.toml"
    for name, line, called in (
        ("meant", "outline = {}", False),
        ("forced", "outline = {}\n[force]\noutline = true", True),
    ):
        scene = plain.with_name(f"{name}.toml")
        scene.write_text(plain.read_text() + line + "\n")
        done = in_copy(checkout, *command, str(scene), "--json")
        assert done.returncode == 0, done.stderr
        (found,) = [e for e in json.loads(done.stdout)["effects"] if e["name"] == "outline"]
        assert found["called"] == called
        assert "nothing opaque" in found["reason"]
    wrong = plain.with_name("wrong.toml")
    wrong.write_text(plain.read_text() + "outline = { widht = 2.0 }\n")
    done = in_copy(checkout, *command, str(wrong))
    assert done.returncode == 2
    assert "picture.outline" in done.stderr
    assert "widht" in done.stderr
    assert done.stderr.count("\n") == 1
