"""After an edit exactly the right stages are baked anew."""

import json
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from bake import store as store_module

ROOT = Path(store_module.__file__).parents[1]

PROJECT = {
    "maths/__init__.py": "",
    "maths/left.py": "def value():\n    return 1\n",
    "maths/right.py": "'''Prose.'''\ndef value():\n    return 2  # remark\n",
    "bake/first.py": """
        from bake.small import Small
        from maths import left
        def first(text, *, params, progress):
            return Small(text + str(left.value()))
    """,
    "bake/second.py": """
        from bake.small import Small
        def second(small, *, params, progress):
            from maths.right import value
            return Small(small.text + str(value()))
    """,
    "bake/other.py": """
        from bake.small import Small
        def other(text, *, params, progress):
            return Small(text * params.times)
    """,
    "bake/small.py": """
        from dataclasses import dataclass
        @dataclass(frozen=True)
        class Params:
            times: int = 1
        @dataclass(frozen=True)
        class Small:
            text: str
            def save(self, folder):
                (folder / "report.json").write_text('"' + self.text + '"')
            @classmethod
            def load(cls, folder):
                return cls((folder / "report.json").read_text())
        def read(path):
            return path.read_text()
    """,
    "run.py": """
        import json, sys
        from functools import partial
        from pathlib import Path
        from bake.store import Baked, Source, Store
        from bake import first, second, other, small
        store, here = Store(Path("store")), Path("input.txt")
        source = Source((here,), partial(small.read, here))
        a = store.run(first.first, source)
        b = store.run(second.second, Baked(a, small.Small.load))
        c = store.run(other.other, source, params=small.Params(int(sys.argv[1])))
        assert store.verify() == []
        print(json.dumps([name for name, e in zip("abc", (a, b, c)) if not e.hit]))
    """,
}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project of three stages: b is made from a, c stands alone."""
    folder = tmp_path_factory.mktemp("project")
    unused = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "formats", folder / "formats", ignore=unused)
    (folder / "maths").mkdir()
    (folder / "bake").mkdir()
    (folder / "input.txt").write_text("text")
    for name in (
        "__init__",
        "store",
        "recipe",
        "publish",
        "fingerprint",
        "machine",
        "syntax",
        "workers",
        "tiles",
        "tile_files",
    ):
        shutil.copy(ROOT / "bake" / f"{name}.py", folder / "bake")
    for name, text in PROJECT.items():
        (folder / name).write_text(textwrap.dedent(text))
    baked_by(folder)
    return folder


def baked_by(folder: Path, times: int = 1) -> list[str]:
    """Run the three stages in a new process and return those that were baked."""
    command = [sys.executable, "-B", "run.py", str(times)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return list(json.loads(done.stdout))


REBUILDS = [
    ("maths/left.py", "return 1", "return 7", ["a", "b"]),
    ("maths/right.py", "return 2", "return 7", ["b"]),
    ("maths/right.py", "  # remark", "  # another\n\n", []),
    ("maths/right.py", "Prose", "Other prose", []),
    ("bake/other.py", "text * params.times", "params.times * text", ["c"]),
    ("bake/small.py", "times: int = 1", "times: int = 2", ["a", "b", "c"]),
    ("bake/store.py", "LEAST_FREE_BYTES = 16", "LEAST_FREE_BYTES = 15", []),
    ("input.txt", "text", "Text", ["a", "b", "c"]),
]


@pytest.mark.parametrize(("file", "old", "new", "baked"), REBUILDS)
def test_an_edit_bakes_exactly_the_right_stages(
    project: Path, file: str, old: str, new: str, baked: list[str]
) -> None:
    text = (project / file).read_text()
    assert old in text
    (project / file).write_text(text.replace(old, new))
    try:
        assert baked_by(project) == baked
    finally:
        (project / file).write_text(text)


def test_a_parameter_bakes_exactly_its_stage_and_undone_edits_nothing(project: Path) -> None:
    assert baked_by(project) == []
    assert baked_by(project, times=5) == ["c"]
