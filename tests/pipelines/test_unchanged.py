"""A bake with nothing to do is told from bytes alone, and from all of them."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bake import machine
from pipelines import current, unchanged
from pipelines.bake_scene import bake_scene


@pytest.fixture
def baked(assets: Path, tmp_path: Path) -> tuple[Path, Path]:
    scene, build = assets / "scenes/plain.toml", tmp_path / "build"
    bake_scene(scene, build_folder=build)
    return scene, build


def test_it_finds_what_a_bake_would(baked: tuple[Path, Path]) -> None:
    scene, build = baked
    found, again = unchanged.look(scene, None, build), bake_scene(scene, build_folder=build)
    assert found is not None
    assert again.baked == 0
    assert (found.folder, set(found.entries)) == (again.folder, set(again.entries))
    for name, entry in again.entries.items():
        kept = found.entries[name]
        assert (kept.path, kept.key, kept.seconds) == (entry.path, entry.key, entry.seconds)
        assert kept.hit


def append(path: Path) -> None:
    path.chmod(0o644)
    path.write_bytes(path.read_bytes() + b"\n")


@pytest.mark.parametrize(
    "change",
    [
        lambda scene, build: append(scene),
        lambda scene, build: append(next((scene.parent.parent / "meshes").iterdir())),
        lambda scene, build: append(build / "scenes/plain/manifest.json"),
        lambda scene, build: append(next((build / "scenes/plain/assets").glob("*/*.ktx2"))),
        lambda scene, build: append(next((build / "store").glob("bake.mips.pack-*/*.ktx2"))),
        lambda scene, build: (build / "scenes/plain/seal.json").unlink(),
        lambda scene, build: scene.unlink(),
    ],
)
def test_any_byte_that_differs_asks_for_a_bake(
    baked: tuple[Path, Path], change: Callable[[Path, Path], None]
) -> None:
    scene, build = baked
    change(scene, build)
    assert unchanged.look(scene, None, build) is None


@pytest.mark.parametrize(
    ("module", "name"), [(current, "code"), (current, "plans"), (machine, "name")]
)
def test_other_code_or_another_machine_asks_for_a_bake(
    baked: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, module: object, name: str
) -> None:
    monkeypatch.setattr(module, name, lambda: "another")
    assert unchanged.look(baked[0], None, baked[1]) is None


def test_another_library_root_or_folder_asks_for_a_bake(
    baked: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, build = baked
    assert unchanged.look(scene, tmp_path, build) is None
    assert unchanged.look(scene, None, tmp_path / "none") is None
    monkeypatch.setattr(machine, "versions", lambda libraries: dict.fromkeys(libraries, "0"))
    assert unchanged.look(scene, None, build) is None


def test_it_imports_neither_numpy_nor_the_schema() -> None:
    code = "import sys, pipelines.unchanged; print('numpy' in sys.modules, 'formats.scene' in "
    found = subprocess.run(
        [sys.executable, "-c", code + "sys.modules)"], check=True, capture_output=True, text=True
    )
    assert found.stdout.split() == ["False", "False"]
