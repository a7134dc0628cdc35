"""What a module's text says without its prose: a hash of its syntax tree, and its imports.

Comments, layout, docstrings and other bare strings do not count. Parsing 20 modules takes 50 ms, so
what a text says is remembered on disk under the hash of its bytes: never under its time of change,
which can lie.
"""

from __future__ import annotations

import ast
import gc
import hashlib
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from formats.errors import BakelightError
from formats.files import atomic

Imports = tuple[tuple[str, ...], ...]
"""Each import as (dots and module, names taken from it)."""

MOST = 2000
"""Texts to remember, about 400 bytes each."""

# The first number rises with every change of what `read` returns
_VERSION = f"1 {sys.version_info.major}.{sys.version_info.minor}"
_known: dict[str, tuple[str, Imports]] = {}
_used: set[str] = set()
_saved: set[str] = set()


def canonical(value: object) -> str:
    """Write `value` (numbers, strings, lists, dicts) as the one JSON text that stands for it.

    Raises ValueError for NaN and infinity, TypeError for anything JSON has no word for.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


@cache
def of(path: Path) -> tuple[str, Imports]:
    """Return the hash of a file's syntax tree and its imports. Raises SyntaxError, OSError."""
    data = path.read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    if digest not in _known:
        _known[digest] = read(data, str(path))
    _used.add(digest)
    return _known[digest]


def read(data: bytes, name: str = "") -> tuple[str, Imports]:
    """Parse a module's bytes; what `of` gives, afresh."""
    words: list[str] = []
    imports: list[ast.Import | ast.ImportFrom] = []
    with _no_collection():
        _describe(ast.parse(data, name), words, imports)
    text = "\0".join(words).encode("utf-8", "surrogatepass")
    return hashlib.sha256(text).hexdigest(), tuple(
        one for node in imports for one in _imports(node)
    )


def absolute(imports: Imports, package: str) -> set[str]:
    """Return the dotted names that a module of `package` may load; some may be no modules."""
    names: set[str] = set()
    for dotted, *taken in imports:
        base = dotted.lstrip(".")
        level = len(dotted) - len(base)
        if level:
            parents = package.split(".")
            base = ".".join([*parents[: len(parents) - level + 1], base]).rstrip(".")
        names.add(base)
        names.update(f"{base}.{name}" for name in taken)
    return names


def remember(file: Path) -> None:
    """Take over what earlier processes left in `file`; a damaged one is as good as none."""
    try:
        kept = json.loads(file.read_bytes())
        known, seal = kept["known"], kept["sha256"]
        if kept["version"] == _VERSION and seal == _seal(known):
            for digest, (tree, imports) in known.items():
                _known.setdefault(digest, (tree, tuple(map(tuple, imports))))
            _saved.update(known)
    except (OSError, ValueError, KeyError, TypeError):
        return


def save(file: Path) -> None:
    """Leave what this process used in `file`, for the next; a disk that refuses does not matter."""
    if _used <= _saved:
        return
    keep = _known if len(_known) <= MOST else _used
    known = {digest: _known[digest] for digest in keep}
    kept = {"version": _VERSION, "known": known, "sha256": _seal(known)}
    try:
        atomic.write_bytes(file, canonical(kept).encode())
    except BakelightError:
        return
    _saved.update(known)


def _seal(known: dict[str, Any]) -> str:
    return hashlib.sha256(canonical(known).encode()).hexdigest()


def _imports(node: ast.Import | ast.ImportFrom) -> Iterator[tuple[str, ...]]:
    if isinstance(node, ast.Import):
        yield from ((alias.name,) for alias in node.names)
    else:
        yield ("." * node.level + (node.module or ""), *(alias.name for alias in node.names))


def _describe(node: ast.AST, words: list[str], imports: list[Any]) -> None:
    """Append the words that determine a tree, bare strings left out, and collect its imports.

    A third of the time of stripping the tree and ast.dump.
    """
    words.append(type(node).__name__)
    if isinstance(node, ast.Import | ast.ImportFrom):
        imports.append(node)
    for field in node._fields:
        value = getattr(node, field, None)
        if isinstance(value, ast.AST):
            _describe(value, words, imports)
        elif isinstance(value, list):
            words.append("[")
            for item in value:
                if not isinstance(item, ast.AST):
                    words.append(repr(item))
                elif not _is_prose(item):
                    _describe(item, words, imports)
            words.append("]")
        else:
            words.append(repr(value))


def _is_prose(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


@contextmanager
def _no_collection() -> Iterator[None]:
    """Pause the garbage collector: a parser makes no garbage, and looking for it takes 40 %."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
