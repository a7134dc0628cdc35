"""The code that a baked result depends on, as one hash.

The code of a stage is the module it stands in and all that this imports, directly or not, inside
functions too, from the three packages that make assets. It is hashed as a syntax tree without
comments, docstrings and positions, so that an edit of prose bakes nothing again (the idea of
redun's task hashes, carried on to the helpers that redun's own documentation says it misses).
Libraries outside the project are only named (bake/machine.py adds versions). What this cannot see
is code or data reached by a computed name, which tests/bake/test_fingerprint.py forbids.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from bake import syntax

PACKAGES = ("bake", "formats", "maths")

Locate = Callable[[str], Path | None]
State = tuple[int, int]


@dataclass(frozen=True)
class Closure:
    """The code that a module runs: `files` of the project, sorted by the name of the module;
    `libraries`, the other packages imported, sorted; `code`, SHA-256 of the syntax trees."""

    files: tuple[Path, ...]
    libraries: tuple[str, ...]
    code: str


def name(function: Callable[..., object]) -> str:
    """Return module and name of a top-level function or of a class's method.

    Raises TypeError for lambdas, nested functions and partials: what they capture has no name.
    """
    qualified = getattr(function, "__qualname__", "<no name>")
    if "<" in qualified:
        raise TypeError(f"{function!r} must be a function at the top level of a module.")
    return f"{function.__module__}.{qualified}"


def closure_of(function: Callable[..., object]) -> Closure:
    """Return the closure of the module that `function` stands in; once a process."""
    return _closure_once(function.__module__)


@cache
def _closure_once(module: str) -> Closure:
    return closure(module, _locate_stage)


def closure(module: str, locate: Locate) -> Closure:
    """Follow the imports of `module`; `locate` maps a dotted name to its file, or to None.

    Raises LookupError if `module` itself has no file.
    """
    found: dict[str, tuple[Path, str]] = {}
    libraries: set[str] = set()
    waiting = [module]
    while waiting:
        dotted = waiting.pop()
        path = None if dotted in found else locate(dotted)
        if path is None:
            continue
        package = dotted if path.name == "__init__.py" else dotted.rpartition(".")[0]
        tree, imports = syntax.of(path)
        found[dotted] = (path, tree)
        for imported in syntax.absolute(imports, package):
            top = imported.partition(".")[0]
            if top in PACKAGES:
                waiting += _with_parents(imported)
            elif top not in sys.stdlib_module_names:
                libraries.add(top)
    if module not in found:
        raise LookupError(f"The source of module {module} cannot be found.")
    names = sorted(found)
    text = syntax.canonical([[dotted, found[dotted][1]] for dotted in names])
    return Closure(
        files=tuple(found[dotted][0] for dotted in names),
        libraries=tuple(sorted(libraries)),
        code=hashlib.sha256(text.encode()).hexdigest(),
    )


def _with_parents(dotted: str) -> list[str]:
    """Return a.b.c, a.b and a: importing a module runs the packages above it."""
    parts = dotted.split(".")
    return [".".join(parts[:n]) for n in range(len(parts), 0, -1)]


def _locate_stage(dotted: str) -> Path | None:
    """Find a module of the project, or one that is loaded already, such as a test's own stage."""
    if dotted.partition(".")[0] in PACKAGES:
        return _locate(dotted)
    file = getattr(sys.modules.get(dotted), "__file__", None)
    return Path(file) if file else None


@cache
def _locate(dotted: str) -> Path | None:
    top, *rest = dotted.split(".")
    base = _root(top)
    if base is None:
        return None
    base = base.joinpath(*rest)
    candidates = (base / "__init__.py", base.with_name(base.name + ".py"))
    return next((path for path in candidates if path.is_file()), None)


@cache
def _root(top: str) -> Path | None:
    spec = importlib.util.find_spec(top)
    places = spec.submodule_search_locations if spec else None
    return Path(next(iter(places))) if places else None


def _states() -> dict[Path, State]:
    """Return size and time of change of every module of the project."""
    roots = [root for root in map(_root, PACKAGES) if root]
    return {path: _state(path) for root in roots for path in root.rglob("*.py")}


def _state(path: Path) -> State:
    status = path.stat()
    return status.st_size, status.st_mtime_ns


_states_at_start = _states()


def edited(files: Iterable[Path]) -> list[Path]:
    """Return those project files that changed since this process started.

    The process may have run their older text: a result baked now belongs to neither.
    """
    known = [path for path in files if _root_of(path)]
    return [path for path in known if _states_at_start.get(path) != _state(path)]


def _root_of(path: Path) -> Path | None:
    return next((root for root in map(_root, PACKAGES) if root and root in path.parents), None)
