"""The tree and the API keep the conventions: sizes, names, arrows, docstrings, annotations."""

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("maths", "formats", "bake", "runtime", "pipelines")
DOCUMENTED = ("maths", "formats", "bake")
SOURCE_FOLDERS = (*PACKAGES, "tests", "assets", "docs", "tools", ".ci")
TEXT_SUFFIXES = {".py", ".md", ".toml", ".sh", ".glsl", ".vert", ".frag", ".comp", ".yml", ".txt"}
GLSL = {".glsl", ".vert", ".frag", ".comp"}
# Numbers of four digits are those of libraries' own trackers, which comments may cite.
# One letter of each word stands in brackets, so that this file does not find itself.
FORBIDDEN_TEXT = re.compile(
    r"(?<![\w.])/(?:[w]ork|[r]oot|[o]pt|[U]sers)/"
    r"|/[h]ome/(?!user/)\w+/"
    r"|\.\./[s]hared"
    r"|\b[w]orkplace\b|\b[w]ork order\b|\b[i]ssue #?\d{1,3}\b"
    r"|\b(?:[T]ODO|[F]IXME|[X]XX|[H]ACK)\b"
)


def source_files(*suffixes: str) -> list[Path]:
    """Files of the project with one of the suffixes, generated folders left out."""
    top = [path for path in ROOT.iterdir() if path.is_file()]
    below = [path for folder in SOURCE_FOLDERS for path in (ROOT / folder).rglob("*")]
    return sorted(
        path
        for path in top + below
        if path.suffix in suffixes and path.is_file() and "__pycache__" not in path.parts
    )


def package_files(*packages: str) -> list[Path]:
    return [p for package in packages for p in sorted((ROOT / package).rglob("*.py"))]


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def public_definitions(
    tree: ast.Module,
) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef]]:
    """Yield (qualified name, node) of public functions, classes and their public methods."""
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            continue
        if node.name.startswith("_"):
            continue
        yield node.name, node
        members = node.body if isinstance(node, ast.ClassDef) else []
        for member in members:
            named = isinstance(member, ast.FunctionDef | ast.AsyncFunctionDef)
            if named and not member.name.startswith("_"):
                yield f"{node.name}.{member.name}", member


def missing_annotations(node: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    arguments += [a for a in (node.args.vararg, node.args.kwarg) if a is not None]
    missing = [a.arg for a in arguments if a.annotation is None and a.arg not in ("self", "cls")]
    return missing + ([] if node.returns is not None else ["return"])


def without_comments(source: str) -> str:
    return re.sub(r"/\*.*?\*/|//[^\n]*", "", source, flags=re.DOTALL)


def forbidden_lines(text: str) -> list[int]:
    return [i for i, line in enumerate(text.splitlines(), 1) if FORBIDDEN_TEXT.search(line)]


def modules_after(statement: str) -> set[str]:
    """Names in sys.modules after the statement ran in a fresh interpreter."""
    code = f"{statement}\nimport sys\nprint('\\n'.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


@pytest.mark.parametrize(
    ("suffixes", "limit"), [((".py",), 400), (tuple(GLSL), 250)], ids=["python", "glsl"]
)
def test_no_file_is_longer_than_its_limit(suffixes: tuple[str, ...], limit: int) -> None:
    lengths = {relative(p): len(p.read_text().splitlines()) for p in source_files(*suffixes)}
    assert lengths, "no files were found: this test looked in the wrong place"
    assert {name: n for name, n in lengths.items() if n > limit} == {}


def test_init_files_of_packages_are_empty() -> None:
    inits = [p for p in package_files(*PACKAGES) if p.name == "__init__.py"]
    assert len(inits) >= len(PACKAGES)
    assert [relative(p) for p in inits if p.read_text().strip()] == []


def test_every_package_folder_has_an_init_and_no_test_folder_has_one() -> None:
    folders = {p.parent for p in package_files(*PACKAGES)}
    assert [relative(f) for f in sorted(folders) if not (f / "__init__.py").exists()] == []
    assert [relative(p) for p in (ROOT / "tests").rglob("__init__.py")] == []


def test_no_module_has_a_name_that_says_nothing_or_repeats_a_top_folder() -> None:
    nothing = {"utils", "util", "common", "helpers", "misc"}
    inside = [p for package in PACKAGES for p in (ROOT / package).rglob("*")]
    inside = [p for p in inside if p.suffix == ".py" or p.is_dir()]
    assert [relative(p) for p in inside if p.stem in nothing | set(PACKAGES)] == []


def test_every_public_function_and_class_has_a_docstring() -> None:
    bare = [
        f"{relative(path)}: {name}"
        for path in package_files(*DOCUMENTED)
        for name, node in public_definitions(ast.parse(path.read_text()))
        if "." not in name and not ast.get_docstring(node)
    ]
    assert bare == []


def test_every_module_has_a_docstring() -> None:
    files = [p for p in package_files(*PACKAGES) if p.name != "__init__.py"]
    bare = [relative(p) for p in files if not ast.get_docstring(ast.parse(p.read_text()))]
    assert bare == []


def test_every_public_function_and_method_is_annotated() -> None:
    gaps = [
        f"{relative(path)}: {name}: {', '.join(missing)}"
        for path in package_files(*DOCUMENTED)
        for name, node in public_definitions(ast.parse(path.read_text()))
        if not isinstance(node, ast.ClassDef) and (missing := missing_annotations(node))
    ]
    assert gaps == []


def test_the_walk_over_definitions_finds_gaps() -> None:
    tree = ast.parse("def f(a, *b, c: int): ...\nclass C:\n  def m(self): ...\n  def _p(x): ...")
    nodes = dict(public_definitions(tree))
    assert list(nodes) == ["f", "C", "C.m"]
    function, method = nodes["f"], nodes["C.m"]
    assert isinstance(function, ast.FunctionDef)
    assert isinstance(method, ast.FunctionDef)
    assert missing_annotations(function) == ["a", "b", "return"]
    assert missing_annotations(method) == ["return"]


def test_glsl_libraries_have_no_entry_point_no_builtins_and_no_uniforms() -> None:
    libraries = sorted((ROOT / "runtime" / "glsl").glob("*.glsl"))
    assert libraries
    outside = re.compile(r"\bvoid\s+main\b|\bgl_\w+|\buniform\b")
    found = {p.name: outside.findall(without_comments(p.read_text())) for p in libraries}
    assert {name: hits for name, hits in found.items() if hits} == {}


def test_every_effect_has_a_pass_and_every_file_of_the_passes_an_effect() -> None:
    effects = importlib.import_module("formats.effects")
    names = [row.name for row in effects.EFFECTS]
    files = [p for p in (ROOT / "runtime" / "passes").iterdir() if p.suffix in {".py", *GLSL}]
    modules = {p.stem for p in files if p.suffix == ".py"} - {"__init__"}
    assert len(set(names)) == len(names)
    assert set(names) <= modules
    # A pass may have parts, named after it
    owners = [*names, "__init__"]
    assert [f.name for f in files if not any(is_part(f.stem, name) for name in owners)] == []


def is_part(stem: str, name: str) -> bool:
    return stem == name or stem.startswith(f"{name}_")


def test_imports_follow_the_arrows() -> None:
    lint = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [lint, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_player_imports_nothing_that_only_baking_needs() -> None:
    files = [p for p in package_files("runtime") if p.name != "__init__.py"]
    names = [".".join(p.relative_to(ROOT).with_suffix("").parts) for p in files]
    assert "runtime.player" in names
    loaded = modules_after(f"import {', '.join(names)}")
    assert "runtime.player" in loaded
    assert loaded & {"bake", "pipelines", "embreex", "trimesh", "sklearn", "OpenEXR"} == set()


def test_the_command_line_starts_without_slow_imports() -> None:
    loaded = modules_after("import pipelines.cli")
    slow = {"embreex", "trimesh", "sklearn", "skimage", "scipy", "OpenEXR", "moderngl", "glfw"}
    assert "pipelines.cli" in loaded
    assert loaded & (slow | {"matplotlib"}) == set()


def test_no_host_paths_and_nothing_left_open() -> None:
    found = [
        f"{relative(path)}:{line}"
        for path in source_files(*TEXT_SUFFIXES)
        for line in forbidden_lines(path.read_text(encoding="utf-8"))
    ]
    assert found == []


@pytest.mark.parametrize(
    "words",
    [("see /", "work/notes"), ("'..", "/shared/data'"), ("# TO", "DO later"), ("issue", " 2")],
)
def test_the_search_for_forbidden_text_finds(words: tuple[str, str]) -> None:
    assert forbidden_lines(f"fine\n{''.join(words)}\n") == [2]


@pytest.mark.parametrize("text", ["network/data", "it issues 3 draws", "out/working", "a/opt"])
def test_the_search_for_forbidden_text_lets_pass(text: str) -> None:
    assert forbidden_lines(text) == []
