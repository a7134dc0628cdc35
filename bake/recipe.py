"""What a result is made from: a stage, its parameters, and inputs, which are files of the user or
entries that earlier stages left in the store. All of it together, as JSON, determines the key."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from bake import fingerprint, machine, syntax
from formats.errors import InputError

FORMAT = 1
RECIPE = "recipe.json"

T = TypeVar("T")


class Kind(Protocol):
    """A baked thing: `save` writes its files and report.json into an empty folder."""

    def save(self, folder: Path) -> None: ...


Stage = Callable[..., Kind]


@dataclass(frozen=True)
class NoParams:
    """The parameters of a stage that has none."""


NO_PARAMS = NoParams()


@dataclass(frozen=True)
class Entry:
    """A baked asset: `path`, its sealed folder; `key`, 64 hex digits; `hit`, whether it was there
    already; `seconds`, what it took to bake, then or now (0 if that is no longer known)."""

    path: Path
    key: str
    hit: bool
    seconds: float


@dataclass(frozen=True)
class Baked(Generic[T]):
    """An entry as the input of a later stage, read by `load`, the kind's own, only on a miss."""

    entry: Entry
    load: Callable[[Path], T]

    def identity(self) -> dict[str, Any]:
        """Return what of this input goes into a key: the entry's own, and the code of `load`."""
        return {"entry": self.entry.key, **_code(self.load)}

    def functions(self) -> tuple[Callable[..., object], ...]:
        """Return the functions that touch the input, beside the stage."""
        return (self.load,)


@dataclass(frozen=True)
class Source(Generic[T]):
    """Files of the user as the input of a stage, read by `load`, only on a miss.

    paths : all files that it consists of, the one that names the others first. load : a top-level
    function of no arguments or, as it needs the path, a `functools.partial` of one, such as
    `partial(sources.load_mesh, path)`. Its arguments count in the key, files by their content.
    """

    paths: tuple[Path, ...]
    load: Callable[[], T]

    def identity(self) -> dict[str, Any]:
        """Return what of this input goes into a key: content and relative name of each file, the
        code of `load` and its arguments.

        Contents are hashed every time, at over 1 GB/s: times of change have fooled DVC (#9641).
        Raises InputError for a file that cannot be read.
        """
        files = [[self._relative(path), _digest(path)] for path in self.paths]
        named: dict[str, Any] = {}
        if isinstance(self.load, partial):
            named = {key: self._plain(value) for key, value in self.load.keywords.items()}
            named["*"] = [self._plain(value) for value in self.load.args]
        return {"files": files, "arguments": named, **_code(*self.functions())}

    def functions(self) -> tuple[Callable[..., object], ...]:
        """Return the functions that touch the input, beside the stage."""
        return (self.load.func if isinstance(self.load, partial) else self.load,)

    def _relative(self, path: Path) -> str:
        return Path(os.path.relpath(path, self.paths[0].parent)).as_posix()

    def _plain(self, value: object) -> object:
        if isinstance(value, list | tuple):
            return [self._plain(part) for part in value]
        return {"path": self._relative(value)} if isinstance(value, Path) else value


Input = Source[Any] | Baked[Any]


@contextmanager
def naming(inputs: tuple[Input, ...]) -> Iterator[None]:
    """Let what a stage refuses name the user's file, which the stage never sees."""
    try:
        yield
    except InputError as error:
        files = [each.paths[0] for each in inputs if isinstance(each, Source)]
        if not files or str(files[0]) in error.file:
            raise
        named = f"{files[0]}: {error.file}"
        raise InputError(named, error.field, error.value, error.remedy) from error


def of(stage: Stage, inputs: tuple[Input, ...], params: Any) -> dict[str, Any]:
    """Return all that the result of `stage(*inputs, params=params)` depends on, as plain values.

    Raises TypeError for misuse, InputError for unreadable files and parameters not finite.
    """
    for each in inputs:
        if not isinstance(each, Source | Baked):
            raise TypeError(f"{each!r} is neither a Source nor a Baked entry.")
    name = fingerprint.name(stage)
    closures = [fingerprint.closure_of(function) for function in _functions(stage, inputs)]
    return {
        "format": FORMAT,
        "stage": name,
        "code": closures[0].code,
        "params": plain_params(name, params),
        "inputs": [each.identity() for each in inputs],
        "libraries": machine.versions({lib for each in closures for lib in each.libraries}),
        "machine": machine.name(),
    }


def text(contents: dict[str, Any]) -> bytes:
    """Return the bytes of recipe.json."""
    return (syntax.canonical(contents) + "\n").encode()


def key(contents: dict[str, Any]) -> str:
    """Return SHA-256 of recipe.json, in hex."""
    return hashlib.sha256(text(contents)).hexdigest()


def plain_params(name: str, params: Any) -> dict[str, Any]:
    """Return the parameters of the stage of that name, defaults included, as JSON has them."""
    frozen = is_dataclass(type(params)) and type(params).__dataclass_params__.frozen
    if not frozen:
        raise TypeError(f"{params!r} must be an instance of a frozen dataclass.")
    plain = {}
    for field, value in asdict(params).items():
        try:
            plain[field] = json.loads(syntax.canonical(value))
        except ValueError as error:
            raise InputError(name, field, value, "give finite numbers") from error
    return plain


def require_unedited(stage: Stage, inputs: tuple[Input, ...]) -> None:
    """Raise InputError if code behind the result is not what this process may have loaded."""
    for function in _functions(stage, inputs):
        for path in fingerprint.edited(fingerprint.closure_of(function).files):
            raise InputError(path, "", "edited since this process started", "run the command again")


def _functions(stage: Stage, inputs: tuple[Input, ...]) -> list[Callable[..., object]]:
    return [stage, *(function for each in inputs for function in each.functions())]


def _code(function: Callable[..., object]) -> dict[str, str]:
    code = fingerprint.closure_of(function).code
    return {"load": fingerprint.name(function), "code": code}


def _digest(path: Path) -> str:
    try:
        # A pipe or a device would never end
        if path.is_fifo() or path.is_char_device():
            raise InputError(path, "", "not a regular file", "give the path of a file")
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        remedy = "give a file that exists and can be read"
        raise InputError(path, "", error.strerror or str(error), remedy) from error
