"""The command line in surroundings that mean it no good: closed streams, odd names, rights."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from formats.errors import InputError
from pipelines import bake_scene, deliver, single, start
from pipelines.cli import cli, run

single.add_to(cli)
ROOT = Path(__file__).parents[2]


def shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    program = f"{sys.executable} -m pipelines.cli"
    surroundings = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        ["/bin/sh", "-c", line.replace("bakelight", program)],
        cwd=folder, env=surroundings, capture_output=True, text=True, timeout=60,
    )  # fmt: skip


@pytest.mark.skipif(os.name == "nt", reason="of a Unix shell")
@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("bakelight --help >&-", 0),
        ("bakelight inspect none.glb >&-", 2),
        ("bakelight inspect none.glb 2>&-", 2),
        ("bakelight inspect none.glb <&- >&- 2>&-", 2),
        ("bakelight inspect none.glb 2>/dev/full", 2),
        ("bakelight inspect odd.json", 0),
        ("PYTHONIOENCODING=ascii bakelight inspect odd.json", 0),
    ],
)
def test_streams_that_are_closed_full_or_narrow(tmp_path: Path, line: str, code: int) -> None:
    (tmp_path / "odd.json").write_text('{"\\ud800 \\u00fc": "\\ud801"}')
    done = shell(line, tmp_path)
    assert (done.returncode, "Traceback" in done.stderr) == (code, False)


@pytest.mark.parametrize("name", ["a\rb.glb", "a\nb.glb", "\x1b[31mred.glb", "a\u202eb.glb"])
def test_names_give_the_terminal_no_orders(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", name]) == 2
    said = capfd.readouterr().err.rstrip("\n")
    assert said.isprintable()
    assert "no such file or folder" in said
    assert start.plain("\x1b]0;x\x07") == "\\x1b]0;x\\x07"


def test_a_name_that_is_too_long_is_the_names_fault(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", "a" * 300]) == 2
    assert "File name too long -- name another file" in capfd.readouterr().err


def test_gc_refuses_what_it_cannot_see(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes that cannot be listed are no reason to think that there are none."""
    (tmp_path / "scenes").mkdir()
    assert bake_scene.keys_in_use(tmp_path) == set()

    def closed(_: object) -> list[str]:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "listdir", closed)
    with pytest.raises(PermissionError):
        bake_scene.keys_in_use(tmp_path)


def test_scenes_and_entries_of_the_store_are_no_outputs(tmp_path: Path) -> None:
    scene, entry = tmp_path / "scenes/s", tmp_path / "store/bake.x-00"
    for folder in (scene, entry, tmp_path / "store/.locks"):
        folder.mkdir(parents=True)
    (scene / "manifest.json").write_text("{}")
    for target in (scene, entry):
        with pytest.raises(InputError, match="a baked scene, or lies in a store"):
            deliver.deliver(tmp_path, target)


@pytest.mark.parametrize(
    ("arguments", "flag"),
    [
        (["render", "s.toml", "-o", "a.png", "--samples", "9"], "--samples"),
        (["render", "s.toml", "-o", "a.png", "--quality", "9"], "--quality"),
        (["voxels", "a.glb", "-o", "o", "--emission-scale", "2"], "--emission-scale"),
        (["voxels", "a.vox", "-o", "o", "--surface"], "--surface"),
        (["lightmap", "a.vox", "-o", "o", "--sky", "2"], "--sky"),
        (["occlusion", "a.glb", "-o", "o", "--size", "64"], "--size"),
        (["occlusion", "a.glb", "-o", "o", "--encoding", "bands", "--components", "4"],
         "--components"),
    ],
)  # fmt: skip
def test_an_option_that_would_do_nothing_is_refused(
    arguments: list[str], flag: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == 2
    assert f"command line: {flag}: " in capfd.readouterr().err
