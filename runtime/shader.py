"""Shader composition: nested includes, injected defines, errors that name the real file and line.

Shaders are written once in the common subset of GLSL 3.30 core and ES 3.00 (no implicit int to
float, no built-in half packing); the header is added here. Three rules keep switches honest:

- `#include "name.glsl"` is looked for beside the including file, then in `runtime/glsl`, and each
  file is included once; an unknown name is an error.
- every flag given must be mentioned by the composed text: an unused flag is a spelling mistake.
- every name tested by `#if` must be given or defined: a forgotten flag is an error, never a zero.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

GLSL = Path(__file__).parent / "glsl"
SCREEN = Path(__file__).parent / "screen.vert"

PRECISION = "".join(
    f"precision highp {kind};\n"
    for kind in (
        *("float", "int", "sampler2D", "sampler3D", "samplerCube", "sampler2DArray"),
        *("sampler2DShadow", "isampler2D", "isampler3D", "isampler2DArray"),
        *("usampler2D", "usampler3D", "usampler2DArray"),
    )
)
HEADERS = {"desktop": "#version 330 core\n", "es": "#version 300 es\n" + PRECISION}

_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"\s*$')
_CONDITION = re.compile(r"^\s*#\s*(?:if|elif)\b(.*)$", re.M)
_BRANCH = re.compile(r"^\s*#\s*(?:endif|else|elif)\b")
_DEFINE = re.compile(r"^\s*#\s*define\s+(\w+)", re.M)
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
_WORD = re.compile(r"\b[A-Za-z_]\w*")
# Files are told apart by their thousands of lines: Mesa gives some errors the wrong source number
SPREAD = 10_000
# Mesa and ES say "0:12(5)" or "0:12", NVIDIA "0(12)"
_PLACE = re.compile(r"\b0:(\d+)\b(?:\(\d+\))?|\b0\((\d+)\)")


class ShaderError(Exception):
    """A shader of ours that cannot be composed or compiled; names file and line."""


@dataclass(frozen=True)
class Source:
    """Composed text, and the files that its `#line` numbers stand for."""

    text: str
    files: tuple[Path, ...]

    def explain(self, log: str) -> str:
        """Replace places in a driver's log by `file:line`."""

        def place(match: re.Match[str]) -> str:
            number, line = divmod(int(match[1] or match[2]), SPREAD)
            return f"{self.files[number].name}:{line}" if number < len(self.files) else match[0]

        return _PLACE.sub(place, log)


def compose(
    path: Path, defines: Mapping[str, Any] | None = None, target: str = "desktop"
) -> Source:
    """Return the whole source of a shader file for `desktop` (3.30 core) or `es` (3.00).

    defines : name -> int, float or string, written as `#define`; True and False as 1 and 0.
    Raises ShaderError for a missing include, an unused flag and a flag tested but not given.
    """
    return _compose(Path(path), tuple(sorted((defines or {}).items())), target)


def forget() -> None:
    """Compose from the files again: they may have been edited."""
    _compose.cache_clear()
    _lines.cache_clear()


@cache
def _compose(path: Path, defines: tuple[tuple[str, Any], ...], target: str) -> Source:
    files: list[Path] = []
    body = "\n".join(_expand(path, files, (), path.parent))
    code = _COMMENT.sub("", body)
    _check_flags(path, code, {name for name, _ in defines})
    given = "".join(f"#define {name} {_literal(value)}\n" for name, value in defines)
    return Source(HEADERS[target] + given + body + "\n", tuple(files))


def _expand(path: Path, files: list[Path], chain: tuple[str, ...], folder: Path) -> list[str]:
    if not path.is_file():
        raise ShaderError(f"{' -> '.join(chain) or path.name}: no shader file {path}")
    files.append(path)
    number = len(files) - 1
    lines = [f"#line {SPREAD * number + 1}"]
    last = 0
    source, directives = _lines(path)
    for at, name in directives:
        lines += source[last : at - (name is not None)]
        last = at
        if name is not None:
            found = next(
                (f for f in (path.parent / name, folder / name, GLSL / name) if f.is_file()), None
            )
            if found is None:
                raise ShaderError(f'{path.name}:{at}: unknown include "{name}"')
            # A file is pasted once, however many ask for it
            if found not in files:
                lines += _expand(found, files, (*chain, f"{path.name}:{at}"), folder)
        # What is skipped by a branch takes its #line with it
        lines.append(f"#line {SPREAD * number + at + 1}")
    return lines + source[last:]


@cache
def _lines(path: Path) -> tuple[list[str], list[tuple[int, str | None]]]:
    """Return the lines of a file, and those, from 1, that include a file of a name or branch."""
    source, found = path.read_text(encoding="utf-8").splitlines(), list[tuple[int, str | None]]()
    for at, line in enumerate(source, start=1):
        if "#" not in line:
            continue
        if match := _INCLUDE.match(line):
            found.append((at, match[1]))
        elif _BRANCH.match(line):
            found.append((at, None))
    return source, found


def _check_flags(path: Path, code: str, given: set[str]) -> None:
    unused = [name for name in sorted(given) if not _mentions(code, name)]
    if unused:
        raise ShaderError(f"{path.name}: flag {unused[0]} is given but never used")
    # Few lines begin with #: look at those alone
    code = "\n".join(line for line in code.splitlines() if "#" in line)
    known = given | set(_DEFINE.findall(code)) | {"defined", "GL_ES", "__VERSION__"}
    for condition in _CONDITION.findall(code):
        if missing := sorted(set(_WORD.findall(condition)) - known):
            raise ShaderError(f"{path.name}: flag {missing[0]} is tested but not given")


def _mentions(code: str, name: str) -> bool:
    """Tell whether a word stands in a text by itself."""
    at = code.find(name)
    while at >= 0:
        around = code[max(at - 1, 0) : at] + code[at + len(name) : at + len(name) + 1]
        if not any(letter.isalnum() or letter == "_" for letter in around):
            return True
        at = code.find(name, at + 1)
    return False


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return str(int(value))
    return repr(float(value)) if isinstance(value, float) else str(value)


class Programs:
    """Linked programs of one context, each made once; `count` says how many."""

    def __init__(self, ctx: Any) -> None:
        self._ctx = ctx
        self._made: dict[tuple[str, ...], Any] = {}

    @property
    def count(self) -> int:
        """Number of programs linked so far."""
        return len(self._made)

    def get(
        self,
        vertex: Path,
        fragment: Path,
        defines: Mapping[str, Any] | None = None,
        vertex_defines: Mapping[str, Any] | None = None,
    ) -> Any:
        """Return the program of two shader files; `defines` go to both unless told apart.

        Raises ShaderError with the driver's log in terms of files and lines.
        """
        sources = (
            compose(vertex, defines if vertex_defines is None else vertex_defines),
            compose(fragment, defines),
        )
        key = tuple(s.text for s in sources)
        if key not in self._made:
            self._made[key] = self._link(*sources)
        return self._made[key]

    def _link(self, vertex: Source, fragment: Source) -> Any:
        try:
            return self._ctx.program(vertex_shader=vertex.text, fragment_shader=fragment.text)
        except Exception as error:
            guilty = vertex if "vertex_shader" in str(error) else fragment
            raise ShaderError(guilty.explain(str(error))) from None

    def release(self) -> None:
        """Free every program."""
        for program in self._made.values():
            program.release()
        self._made.clear()


def set_uniforms(program: Any, values: Mapping[str, Any]) -> None:
    """Set uniforms by name, but for those the compiler dropped; a list is an array of vectors."""
    for name, value in values.items():
        if name not in program:
            continue
        if isinstance(value, list):
            program[name].write(np.asarray(value, np.float32).tobytes())
        else:
            program[name] = value
