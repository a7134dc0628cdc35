"""The checked reader: walks frozen dataclasses whose fields say kind, unit, range and meaning.

Every refusal is one `InputError` that names the file, the dotted field, the value and the remedy.
"""

import dataclasses
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.keyed import INTERPOLATIONS, Interpolation, Keyed
from maths.keyframes import CLOSEST

MAX_ITEMS = 100_000  # positions or keys of one list
MAX_TABLES = 256  # lights, sets of sprites
MAX_SECONDS = 1e6  # of a key
REQUIRED: Any = object()
COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")  # becomes the name of a folder

T = TypeVar("T")


@dataclass(frozen=True)
class Spec:
    """What a field accepts.

    kind : key of READERS.
    low, high : inclusive limits of every number in the field.
    sizes : allowed components of a vector or keyed value; 1 is a plain number.
    choices : allowed texts, keys of a table of flags, or file name endings of a source.
    table : dataclass of a nested table. tables : name of the type -> dataclass, "" for the only one
    by_quality : what stands in for an absent value, draft to reference.
    """

    kind: str
    doc: str
    default: Any = REQUIRED
    unit: str = ""
    low: float = -1e9
    high: float = 1e9
    sizes: tuple[int, ...] = (1,)
    choices: tuple[str, ...] = ()
    table: Any = None
    tables: Mapping[str, Any] = field(default_factory=dict)
    by_quality: tuple[float, ...] = ()


@dataclass(frozen=True)
class Where:
    """A place in a file; `sources` gathers the files that the scene names: as written -> absolute.

    root : sources are looked up here; None only checks how they are written.
    """

    file: str
    path: str = ""
    root: Path | None = None
    sources: dict[str, Path] = field(default_factory=dict)

    def at(self, key: str) -> "Where":
        """The place of a key of this table."""
        return dataclasses.replace(self, path=f"{self.path}.{key}" if self.path else key)

    def item(self, index: int) -> "Where":
        """The place of an item of this list."""
        return dataclasses.replace(self, path=f"{self.path}[{index}]")

    def refuse(self, value: object, remedy: str) -> NoReturn:
        """Raise the InputError of this place."""
        try:
            repr(value)
        except ValueError:
            # Python refuses to print whole numbers of more than 4300 digits
            value = "a very large number"
        value = '""' if value == "" else value
        raise InputError(self.file, self.path, value, remedy)


def item(kind: str, doc: str, default: Any = REQUIRED, **options: Any) -> Any:
    """A dataclass field that this module reads; the default is written as in the file."""
    spec = Spec(kind, doc, default, **options)
    if default is REQUIRED:
        return field(metadata={"spec": spec})
    value = default if default is None else READERS[kind](default, spec, Where("a default"))
    if isinstance(value, dict):
        return field(default_factory=lambda: dict(value), metadata={"spec": spec})
    return field(default=value, metadata={"spec": spec})


def specs(table: Any) -> dict[str, Spec]:
    """The fields of a dataclass that stand in the file."""
    return {f.name: f.metadata["spec"] for f in dataclasses.fields(table) if "spec" in f.metadata}


def completed(table: T, quality: int) -> T:
    """A dataclass whose fields that the file left open have the numbers of a quality."""
    left = {
        name: spec.by_quality[quality]
        for name, spec in specs(table).items()
        if spec.by_quality and getattr(table, name) is None
    }
    return dataclasses.replace(cast(Any, table), **left) if left else table


def read(table: type[T], raw: object, where: Where, *, tag: str | None = None) -> T:
    """A dataclass from a raw table; absent fields take their defaults.

    tag : a key that the caller has read already.
    Raises InputError for unknown or missing keys, wrong types and values out of range.
    """
    return table(**read_fields(table, raw, where, tag=tag))


def read_fields(table: Any, raw: object, where: Where, *, tag: str | None = None) -> dict[str, Any]:
    """The checked fields of a dataclass that stand in the raw table, by name."""
    known = specs(table)
    content = _table(raw, where, [*known, *([tag] if tag else [])])
    found: dict[str, Any] = {}
    for name, spec in known.items():
        if name in content:
            found[name] = READERS[spec.kind](content[name], spec, where.at(name))
        elif spec.default is REQUIRED:
            where.at(name).refuse("missing", f"add it: {spec.doc}{_in(spec.unit)}")
    return found


def _table(raw: object, where: Where, known: list[str]) -> dict[str, Any]:
    if not isinstance(raw, dict):
        where.refuse(raw, f"write a table with the keys {', '.join(known)}")
    for key in raw:
        if key not in known:
            where.at(str(key)).refuse("unknown key", suggestion(str(key), known))
    return raw


def suggestion(word: str, known: list[str]) -> str:
    """A remedy for a word that is none of the known ones."""
    from difflib import get_close_matches

    close = get_close_matches(word, known, n=1)
    return f"did you mean {close[0]!r}?" if close else f"use one of {', '.join(known)}"


def number(raw: object, spec: Spec, where: Where) -> float:
    """A finite number within the limits."""
    if isinstance(raw, bool) or not isinstance(raw, int | float):
        where.refuse(raw, f"write a number{_in(spec.unit)}{_between(spec)}")
    if isinstance(raw, float) and not math.isfinite(raw):
        where.refuse(raw, f"write a finite number{_in(spec.unit)}{_between(spec)}")
    if not spec.low <= raw <= spec.high:
        where.refuse(raw, f"write a number{_in(spec.unit)}{_between(spec)}")
    return float(raw)


def integer(raw: object, spec: Spec, where: Where) -> int:
    """A whole number within the limits."""
    if isinstance(raw, bool) or not isinstance(raw, int) or not spec.low <= raw <= spec.high:
        where.refuse(raw, f"write a whole number{_in(spec.unit)}{_between(spec)}")
    return raw


def flag(raw: object, spec: Spec, where: Where) -> bool:
    """true or false."""
    if not isinstance(raw, bool):
        where.refuse(raw, "write true or false")
    return raw


def text(raw: object, spec: Spec, where: Where) -> str:
    """One of the choices, or a name that can be a folder's where there are none."""
    if spec.choices:
        if not isinstance(raw, str) or raw not in spec.choices:
            word = raw if isinstance(raw, str) else ""
            where.refuse(raw, suggestion(word, list(spec.choices)))
    elif not isinstance(raw, str) or not NAME.fullmatch(raw):
        where.refuse(raw, "write a name of at most 64 letters, digits, - and _")
    return raw


def vector(raw: object, spec: Spec, where: Where) -> tuple[float, ...]:
    """A list of numbers."""
    items = _list(raw, where, f"write {spec.sizes[0]} numbers{_in(spec.unit)}")
    if len(items) not in spec.sizes or len(items) == 1:
        where.refuse(raw, f"write {_sizes(spec)}{_in(spec.unit)}, not {len(items)}")
    return tuple(number(value, spec, where.item(i)) for i, value in enumerate(items))


def value(raw: object, spec: Spec, where: Where) -> float | tuple[float, ...]:
    """A number or a list of numbers, as the allowed sizes have it."""
    if isinstance(raw, list) and spec.sizes != (1,):
        return vector(raw, spec, where)
    if 1 not in spec.sizes:
        where.refuse(raw, f"write {_sizes(spec)}{_in(spec.unit)}")
    return number(raw, spec, where)


def numbers(raw: object, spec: Spec, where: Where) -> NDArray[np.float64]:
    """A list of numbers or vectors of one shape: (n,) or (n, size)."""
    items = _list(raw, where, f"write a list, each item {_sizes(spec)}{_in(spec.unit)}")
    plain = _plain(items, spec)
    if plain is not None:
        return plain
    # Find what is wrong, or mixed, one item at a time
    found = [value(entry, spec, where.item(i)) for i, entry in enumerate(items)]
    for i, entry in enumerate(found):
        if np.size(entry) != np.size(found[0]):
            where.item(i).refuse(items[i], "write the same number of components as in the first")
    shape = (0,) if spec.sizes[0] == 1 else (0, spec.sizes[0])
    return np.array(found, dtype=np.float64) if found else np.empty(shape)


def _plain(items: list[Any], spec: Spec) -> NDArray[np.float64] | None:
    """The array of a list whose every item is as it should be, in one step."""
    size = spec.sizes[0]
    rows = [[entry] for entry in items] if size == 1 else items
    if not rows or not all(type(row) is list and len(row) == size for row in rows):
        return None
    if not all(type(entry) in (int, float) for row in rows for entry in row):
        return None
    if not all(spec.low <= entry <= spec.high for row in rows for entry in row):
        return None
    found = np.array(rows, dtype=np.float64)
    return found[:, 0] if size == 1 else found


def flags(raw: object, spec: Spec, where: Where) -> NDArray[np.bool_]:
    """A list of true and false."""
    items = _list(raw, where, "write a list of true and false")
    return np.array([flag(entry, spec, where.item(i)) for i, entry in enumerate(items)], dtype=bool)


def keyed(raw: object, spec: Spec, where: Where) -> Keyed:
    """A value, or { times, values, interpolation, loop }."""
    if not isinstance(raw, dict):
        return Keyed.hold(value(raw, spec, where))
    content = _table(raw, where, ["times", "values", "interpolation", "loop"])
    for name in ("times", "values"):
        if name not in content:
            where.at(name).refuse("missing", "add it: as many times (s) as values")
    second = Spec("number", "", unit="s", low=-MAX_SECONDS, high=MAX_SECONDS)
    times = numbers(content["times"], second, where.at("times"))
    values = numbers(content["values"], spec, where.at("values"))
    if times.size == 0:
        where.at("times").refuse([], "write at least one key")
    if len(times) != len(values):
        where.at("values").refuse(
            f"{len(values)} values", f"write as many as times, which are {len(times)}"
        )
    late = np.flatnonzero(np.diff(times) < CLOSEST)
    if late.size:
        where.at("times").item(int(late[0]) + 1).refuse(
            content["times"][late[0] + 1], f"write times that increase, by {CLOSEST:g} s or more"
        )
    interpolation = text(
        content.get("interpolation", "linear"),
        Spec("text", "", choices=INTERPOLATIONS),
        where.at("interpolation"),
    )
    loop = flag(content.get("loop", False), spec, where.at("loop"))
    return Keyed(times, values, cast(Interpolation, interpolation), loop)


def source(raw: object, spec: Spec, where: Where) -> Path:
    """A file inside the root, written with forward slashes; absolute where there is a root."""
    if not isinstance(raw, str) or not raw or "\0" in raw:
        where.refuse(raw, "write the path of a file, from the folder that holds scenes/")
    path = PurePosixPath(raw)
    if path.is_absolute() or "\\" in raw or ":" in raw or ".." in path.parts:
        where.refuse(raw, "write a path with / inside the folder that holds scenes/, without ..")
    if path.suffix.lower() not in spec.choices:
        where.refuse(raw, f"name a file that ends in {', '.join(spec.choices)}")
    if where.root is None:
        where.sources[raw] = Path(raw)
        return Path(raw)
    root = where.root.resolve()
    try:
        found = (root / path).resolve()
        is_file = found.is_file()
    except (OSError, RuntimeError) as error:
        where.refuse(raw, f"name a file that can be opened ({error})")
    if not found.is_relative_to(root):
        where.refuse(raw, f"put the file inside {root}; links may not leave it")
    if not is_file:
        where.refuse(raw, f"there is no such file: put one at {root / path}")
    where.sources[raw] = found
    return found


def nested(raw: object, spec: Spec, where: Where) -> Any:
    """A table of its own."""
    return read(spec.table, raw, where)


def several(raw: object, spec: Spec, where: Where) -> tuple[Any, ...]:
    """A list of tables; where there are several types, the key `type` of each names its own."""
    items = _list(raw, where, f"write [[{where.path}]]", MAX_TABLES)
    return tuple(_one_of(entry, spec, where.item(i)) for i, entry in enumerate(items))


def _one_of(raw: object, spec: Spec, where: Where) -> Any:
    if "" in spec.tables:
        return read(spec.tables[""], raw, where)
    if not isinstance(raw, dict) or "type" not in raw:
        where.at("type").refuse("missing", f"write one of {', '.join(spec.tables)}")
    kind = text(raw["type"], Spec("text", "", choices=tuple(spec.tables)), where.at("type"))
    return read(spec.tables[kind], raw, where, tag="type")


def switches(raw: object, spec: Spec, where: Where) -> dict[str, bool]:
    """A table from the choices to true or false."""
    content = _table(raw, where, list(spec.choices))
    return {key: flag(entry, spec, where.at(key)) for key, entry in content.items()}


def radiances(raw: object, spec: Spec, where: Where) -> dict[str, tuple[float, ...]]:
    """A table from palette indices, colours or materials to three numbers."""
    if not isinstance(raw, dict):
        where.refuse(raw, "write a table such as { 42 = [9.0, 4.1, 1.2] }")
    three = dataclasses.replace(spec, sizes=(3,))
    for key in raw:
        if not (1 <= len(key) <= 64 and key.isprintable()):
            where.at(key[:64]).refuse("unknown key", "name it by 1 to 64 letters on one line")
    return {key: vector(value, three, where.at(key)) for key, value in raw.items()}


def is_colour(text: str) -> bool:
    """Whether a text is a palette index, 1 to 255, or a colour, #rrggbb."""
    index = text.isascii() and text.isdigit() and len(text) <= 3 and 1 <= int(text) <= 255
    return index or COLOUR.fullmatch(text) is not None


def _list(raw: object, where: Where, remedy: str, most: int = MAX_ITEMS) -> list[Any]:
    if not isinstance(raw, list | tuple):
        where.refuse(raw, remedy)
    if len(raw) > most:
        where.refuse(f"{len(raw)} items", f"write at most {most:,}")
    return list(raw)


def _sizes(spec: Spec) -> str:
    return " or ".join("a number" if n == 1 else f"{n} numbers" for n in spec.sizes)


def _in(unit: str) -> str:
    return f" ({unit})" if unit else ""


def _between(spec: Spec) -> str:
    return f" from {spec.low:.10g} to {spec.high:.10g}"


READERS: dict[str, Callable[[Any, Spec, Where], Any]] = {
    "number": number,
    "integer": integer,
    "flag": flag,
    "text": text,
    "vector": vector,
    "value": value,
    "numbers": numbers,
    "flags": flags,
    "keyed": keyed,
    "source": source,
    "table": nested,
    "tables": several,
    "switches": switches,
    "radiances": radiances,
}
