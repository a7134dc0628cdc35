"""Texts are told apart as their syntax trees are, and remembered without risk."""

import ast
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bake import syntax

ROOT = Path(syntax.__file__).parents[1]


def test_words_tell_apart_what_the_syntax_tree_tells_apart() -> None:
    """Against ast.dump, the slow obvious text, on every pair of near-equal programs."""
    programs = ["f(a, b)", "f(a)(b)", "f(a), b", "f(*a, b)", "f('a', b)", "f(a, b=b)", "x = 'a'"]
    programs += ["1", "1.0", "True", "'1'", "b'1'", "-1", "[[a], b]", "[[a, b]]", "[[], a, b]"]
    programs += ["if a:\n b\nelse:\n c", "if a:\n b\n c", "def f():\n 'doc'\n return 1"]
    texts = {}
    for program in programs:
        words: list[str] = []
        syntax._describe(ast.parse(program), words, [])
        texts[program] = "\0".join(words)
    dumps = {program: ast.dump(ast.parse(program)) for program in programs}
    # A bare string is prose by decision, so a program of only that is empty
    dumps["'1'"] = "empty"
    for one in programs:
        for other in programs:
            assert (texts[one] == texts[other]) == (dumps[one] == dumps[other]), (one, other)


@pytest.mark.parametrize(
    ("text", "package", "names"),
    [
        ("import a.b, c as d", "p", {"a.b", "c"}),
        ("from a.b import c as d, e", "p", {"a.b", "a.b.c", "a.b.e"}),
        ("from . import x", "p.q", {"p.q", "p.q.x"}),
        ("from .m import x", "p.q", {"p.q.m", "p.q.m.x"}),
        ("from ..m import x", "p.q", {"p.m", "p.m.x"}),
        ("def f():\n class C:\n  import a", "", {"a"}),
    ],
)
def test_imports_become_absolute(text: str, package: str, names: set[str]) -> None:
    assert syntax.absolute(syntax.read(text.encode())[1], package) == names


@pytest.fixture
def new_process(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Give a function that forgets what this process knows."""

    def forget() -> None:
        monkeypatch.setattr(syntax, "_known", {})
        monkeypatch.setattr(syntax, "_used", set())
        monkeypatch.setattr(syntax, "_saved", set())
        syntax.of.cache_clear()

    forget()
    yield forget
    syntax.of.cache_clear()


def test_the_next_process_need_not_parse(
    new_process: Callable[[], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, memory = tmp_path / "module.py", tmp_path / "memory.json"
    path.write_text("from .a import b\nimport c.d")
    first = syntax.of(path)
    syntax.save(memory)
    new_process()
    syntax.remember(memory)
    parsed: list[bytes] = []
    read = syntax.read
    monkeypatch.setattr(syntax, "read", lambda data, name: parsed.append(data) or read(data, name))
    assert (syntax.of(path), parsed) == (first, [])
    # Another text is parsed, whatever its time of change
    path.write_text("from .a import e")
    syntax.of.cache_clear()
    assert syntax.of(path) != first
    assert parsed == [b"from .a import e"]


def test_a_damaged_memory_is_as_good_as_none(
    new_process: Callable[[], None], tmp_path: Path
) -> None:
    path, memory = tmp_path / "module.py", tmp_path / "memory.json"
    path.write_text("import a")
    syntax.of(path)
    syntax.save(memory)
    good = memory.read_bytes()
    assert b'"a"' in good
    damaged = [good.replace(b'"a"', b'"b"'), good[:-9], b"", b"[]", b"{}", b'{"known": 1}', b"\xff"]
    damaged.append(good.replace(syntax._VERSION.encode(), b"1 2.7"))
    for data in damaged:
        new_process()
        memory.write_bytes(data)
        syntax.remember(memory)
        assert syntax._known == {}, data
    memory.write_bytes(good)
    syntax.remember(memory)
    assert len(syntax._known) == 1


def test_memory_is_written_only_for_news_and_does_not_grow_for_ever(
    new_process: Callable[[], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, memory = tmp_path / "module.py", tmp_path / "memory.json"
    path.write_text("import a")
    syntax.of(path)
    syntax.save(memory)
    memory.unlink()
    syntax.save(memory)
    assert not memory.exists()
    monkeypatch.setattr(syntax, "MOST", 2)
    for text in ("1", "2", "3"):
        new = tmp_path / f"m{text}.py"
        new.write_text(f"a = {text}")
        syntax.of(new)
    monkeypatch.setattr(syntax, "_used", set(list(syntax._known)[-1:]))
    syntax.save(memory)
    new_process()
    syntax.remember(memory)
    assert len(syntax._known) == 1
    # A folder that is not there does not matter
    syntax.of(path)
    syntax.save(tmp_path / "nowhere" / "memory.json")


def test_canonical_text_does_not_depend_on_order_and_refuses_nan() -> None:
    assert syntax.canonical({"b": 1, "a": (1.5,)}) == '{"a":[1.5],"b":1}'
    assert syntax.canonical(1) != syntax.canonical(1.0)
    for value in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="JSON"):
            syntax.canonical([value])
    with pytest.raises(TypeError):
        syntax.canonical(Path("a"))


def test_reading_is_quick() -> None:
    """20 modules take 50 ms on an idle core. The machine at hand is measured by parsing and dumping
    the same files: measured 0.70 to 0.76 of that, so 1 leaves room for noise alone."""
    files = sorted((ROOT / "bake").glob("*.py")) + sorted((ROOT / "maths").glob("*.py"))

    def seconds(work: Callable[[Path], object]) -> float:
        begin = time.process_time()
        for path in files:
            work(path)
        return time.process_time() - begin

    pairs = [
        (
            seconds(lambda path: syntax.read(path.read_bytes())),
            seconds(lambda path: ast.dump(ast.parse(path.read_bytes()))),
        )
        for _ in range(3)
    ]
    assert min(own for own, _ in pairs) < min(yardstick for _, yardstick in pairs)
