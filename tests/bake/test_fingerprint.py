"""The code of a stage is found whole, and only what runs counts."""

import ast
import functools
import subprocess
import sys
from pathlib import Path

import pytest

from bake import fingerprint, syntax

ROOT = Path(fingerprint.__file__).parents[1]

TREE = {
    "bake/__init__.py": "",
    "bake/stage.py": """
        '''Prose.'''
        from __future__ import annotations
        import numpy as np
        from bake import neighbour
        from . import sibling
        def stage():
            # a remark
            from maths.deep import value
            return np.zeros(value), neighbour, sibling
    """,
    "bake/neighbour.py": "import formats.files.codec",
    "bake/sibling.py": "from .cousin import thing",
    "bake/cousin.py": "thing = 1",
    "bake/unrelated.py": "import scipy",
    "formats/__init__.py": "version = 1",
    "formats/files/__init__.py": "",
    "formats/files/codec.py": "import json, zstandard",
    "maths/__init__.py": "",
    "maths/deep.py": "value: int = 3",
}


def write_tree(folder: Path, **edits: str) -> None:
    """Write the small project, with some of its files replaced, by stem."""
    for name, text in TREE.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        text = edits.get(path.stem, text)
        path.write_text("\n".join(line.removeprefix(" " * 8) for line in text.splitlines()))


def closure_in(folder: Path, module: str = "bake.stage") -> fingerprint.Closure:
    """Follow the imports inside a small project that is not the one under test."""

    def locate(dotted: str) -> Path | None:
        base = folder.joinpath(*dotted.split("."))
        places = (base / "__init__.py", base.with_suffix(".py"))
        return next((path for path in places if path.is_file()), None)

    syntax.of.cache_clear()
    return fingerprint.closure(module, locate)


@pytest.fixture
def before(tmp_path: Path) -> fingerprint.Closure:
    write_tree(tmp_path)
    return closure_in(tmp_path)


def test_imports_are_followed_in_functions_and_relative_ones_too(
    before: fingerprint.Closure, tmp_path: Path
) -> None:
    reached = {path.relative_to(tmp_path).as_posix() for path in before.files}
    assert reached == set(TREE) - {"bake/unrelated.py"}
    # numpy of the stage and zstandard two imports away; json is of the standard library
    assert before.libraries == ("numpy", "zstandard")


PROSE = [
    ("# another remark", "# a remark"),
    ("# remark, then a blank line\n\n", "# a remark"),
    ("'''Other prose,\nlonger.'''", "'''Prose.'''"),
    ("def stage():\n            '''New docstring.'''", "def stage():"),
    ("np.zeros(  value  )", "np.zeros(value)"),
]


@pytest.mark.parametrize(("new", "old"), PROSE)
def test_prose_and_layout_do_not_count(
    before: fingerprint.Closure, tmp_path: Path, new: str, old: str
) -> None:
    assert old in TREE["bake/stage.py"]
    write_tree(tmp_path, stage=TREE["bake/stage.py"].replace(old, new))
    assert closure_in(tmp_path).code == before.code


EDITS = {
    "stage": TREE["bake/stage.py"].replace("zeros", "ones"),
    "deep": "value: int = 4",
    "cousin": "thing = 1.0",
    "codec": "import json, zstandard\nlevel = 'a string that is a value'",
    "__init__": "version = 2",
}


@pytest.mark.parametrize("stem", EDITS)
def test_every_edit_of_code_counts(before: fingerprint.Closure, tmp_path: Path, stem: str) -> None:
    write_tree(tmp_path, **{stem: EDITS[stem]})
    assert closure_in(tmp_path).code != before.code


def test_code_that_is_not_reached_does_not_count(
    before: fingerprint.Closure, tmp_path: Path
) -> None:
    write_tree(tmp_path, unrelated="import scipy\nvalue = 5")
    assert closure_in(tmp_path) == before


def test_a_module_that_moves_counts_even_with_equal_text(
    before: fingerprint.Closure, tmp_path: Path
) -> None:
    """The same two texts under exchanged names are another program."""
    write_tree(tmp_path, cousin=TREE["maths/deep.py"], deep=TREE["bake/cousin.py"])
    assert closure_in(tmp_path).code != before.code


def test_missing_source_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(LookupError, match=r"bake\.nowhere"):
        closure_in(tmp_path, "bake.nowhere")


def test_names_are_for_functions_that_capture_nothing() -> None:
    assert fingerprint.name(fingerprint.closure) == "bake.fingerprint.closure"

    def nested() -> None: ...

    for captured in (nested, lambda: None, functools.partial(fingerprint.closure, "a")):
        with pytest.raises(TypeError, match="top level"):
            fingerprint.name(captured)


def test_edited_files_are_noticed_and_files_of_others_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = Path(fingerprint.__file__)
    foreign = tmp_path / "stage.py"
    foreign.write_text("")
    assert fingerprint.edited([own, foreign]) == []
    size, mtime = fingerprint._states_at_start[own]
    monkeypatch.setitem(fingerprint._states_at_start, own, (size, mtime - 1))
    assert fingerprint.edited([own, foreign]) == [own]


HIDDEN_NAMES = {"__import__", "import_module", "exec", "eval", "__file__", "__doc__"}
# It looks at code as data, and no stage imports it
EXEMPT = {"bake/fingerprint.py"}


def test_stages_reach_no_code_or_data_by_a_computed_name() -> None:
    """What the fingerprint cannot follow must not be there: imports by a computed name, files
    beside the code, docstrings used as values."""
    offences = []
    for package in fingerprint.PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            for node in ast.walk(ast.parse(path.read_bytes())):
                used = node.id if isinstance(node, ast.Name) else getattr(node, "attr", None)
                if used in HIDDEN_NAMES and name not in EXEMPT:
                    offences.append(f"{name}:{getattr(node, 'lineno', 0)} {used}")
    assert offences == []


def test_the_store_alone_imports_nothing_heavy() -> None:
    """A hit must not pay for numpy and its like."""
    program = "import sys, bake.store; print(*sys.modules)"
    command = [sys.executable, "-c", program]
    loaded = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    heavy = {"numpy", "scipy", "trimesh", "embreex", "filelock", "importlib.metadata", "OpenEXR"}
    assert heavy.isdisjoint(loaded.split())
