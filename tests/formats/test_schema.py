# ruff: noqa: RUF009 -- item() is dataclasses.field() with the schema as its metadata
"""The checked reader: every refusal names file, field, value and remedy."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from formats import schema
from formats.errors import InputError
from formats.keyed import Keyed
from formats.schema import Where, item

INF = float("inf")


@dataclass(frozen=True, kw_only=True)
class Tail:
    length: float = item("number", "length", unit="m", low=0, high=2)


@dataclass(frozen=True, kw_only=True, eq=False)
class Cat:
    size: float = item("number", "size", 1.0, unit="m", low=0.1, high=10)
    lives: int = item("integer", "lives", 9, low=0, high=9)
    awake: bool = item("flag", "awake", True)
    coat: str = item("text", "coat", "plain", choices=("plain", "tabby"))
    name: str = item("text", "name", "felix")
    place: tuple[float, ...] = item("vector", "place", [0, 0, 0], unit="m", sizes=(3,))
    pace: float | tuple[float, ...] = item("value", "pace", 1.0, sizes=(1, 2), low=0)
    speed: Keyed = item("keyed", "speed", 0.5, unit="m/s", low=0, high=20)
    way: Keyed = item("keyed", "way", [0, 0, 1], sizes=(3,))
    glow: Keyed = item("keyed", "glow", 1.0, sizes=(1, 3), low=0)
    spots: np.ndarray | None = item("numbers", "spots", None, sizes=(3,), low=-5, high=5)
    naps: np.ndarray | None = item("numbers", "naps", None)
    moods: np.ndarray | None = item("flags", "moods", None)
    tail: Tail | None = item("table", "tail", None, table=Tail)
    tails: tuple[Tail, ...] = item("tables", "tails", [], tables={"": Tail})
    toys: tuple[Tail, ...] = item("tables", "toys", [], tables={"mouse": Tail})
    switches: dict[str, bool] = item("switches", "switches", {}, choices=("purr", "hiss"))


def read(**raw: object) -> Cat:
    return schema.read(Cat, raw, Where("cat.toml"))


def refusal(**raw: object) -> InputError:
    with pytest.raises(InputError) as caught:
        read(**raw)
    assert caught.value.file == "cat.toml"
    assert str(caught.value).startswith(f"cat.toml: {caught.value.field}: ")
    assert "\n" not in str(caught.value)
    return caught.value


def test_defaults_are_read_like_the_file() -> None:
    cat = read()
    assert (cat.size, cat.lives, cat.awake, cat.coat) == (1.0, 9, True, "plain")
    assert cat.place == (0.0, 0.0, 0.0)
    assert cat.speed.at(3.0) == 0.5
    assert cat.way.at(3.0).tolist() == [0.0, 0.0, 1.0]
    assert cat.tail is None
    assert cat.tails == ()
    assert cat.switches == {}


def test_whole_tables_are_read() -> None:
    cat = read(
        size=2,
        tail={"length": 1},
        tails=[{"length": 0.5}],
        toys=[{"type": "mouse", "length": 2}],
        switches={"purr": True},
        spots=[[1, 2, 3], [4, 5.0, -1]],
        naps=[1, 2.5],
        moods=[True, False],
        pace=[1, 2],
    )
    assert cat.size == 2.0
    assert type(cat.size) is float
    assert cat.tail == Tail(length=1.0)
    assert cat.tails == (Tail(length=0.5),)
    assert cat.toys == (Tail(length=2.0),)
    assert cat.switches == {"purr": True}
    assert np.array_equal(cat.spots, [[1, 2, 3], [4, 5, -1]])
    assert np.array_equal(cat.naps, [1, 2.5])
    assert np.array_equal(cat.moods, [True, False])
    assert cat.pace == (1.0, 2.0)


def test_an_empty_list_of_vectors_keeps_its_shape() -> None:
    assert read(spots=[]).spots.shape == (0, 3)
    assert read(naps=[]).naps.shape == (0,)


@pytest.mark.parametrize(
    ("field", "raw", "remedy"),
    [
        ("size", "big", "write a number (m) from 0.1 to 10"),
        ("size", True, "write a number"),
        ("size", None, "write a number"),
        ("size", float("nan"), "finite"),
        ("size", INF, "finite"),
        ("size", 0.0999, "from 0.1 to 10"),
        pytest.param("size", 10**5000, "from 0.1 to 10", id="size-huge"),
        ("lives", 3.0, "whole number from 0 to 9"),
        ("lives", True, "whole number"),
        ("lives", 10, "whole number from 0 to 9"),
        pytest.param("lives", 10**5000, "whole number", id="lives-huge"),
        pytest.param("coat", 10**5000, "use one of", id="coat-huge"),
        pytest.param("awake", [10**5000], "true or false", id="awake-huge"),
        ("awake", 1, "true or false"),
        ("coat", "tabbi", "did you mean 'tabby'?"),
        ("coat", "zzz", "use one of plain, tabby"),
        ("coat", 3, "use one of plain, tabby"),
        ("name", "../felix", "letters, digits"),
        ("name", "", "letters, digits"),
        ("name", "a" * 65, "at most 64"),
        ("name", ".hidden", "letters, digits"),
        ("place", [1, 2], "write 3 numbers (m), not 2"),
        ("place", 7, "write 3 numbers"),
        ("pace", [1], "write a number or 2 numbers"),
        ("way", 1, "write 3 numbers"),
        ("speed", [1], "write a number"),
        ("naps", 3, "write a list"),
        ("moods", "yes", "write a list"),
        ("spots", {}, "write a list"),
        ("tail", 3, "write a table with the keys length"),
        ("tails", {"length": 1}, "write [[tails]]"),
        ("switches", [], "write a table with the keys purr, hiss"),
    ],
)
def test_a_wrong_value_is_refused(field: str, raw: object, remedy: str) -> None:
    error = refusal(**{field: raw})
    assert error.field == field
    assert remedy in error.remedy


@pytest.mark.parametrize(
    ("raw", "field", "remedy"),
    [
        ({"sise": 2}, "sise", "did you mean 'size'?"),
        ({"qqq": 2}, "qqq", "use one of size, lives"),
        ({"tail": {}}, "tail.length", "add it: length (m)"),
        ({"tail": {"length": 1, "lenght": 1}}, "tail.lenght", "did you mean 'length'?"),
        ({"tails": [{"length": 1}, {"length": 3}]}, "tails[1].length", "from 0 to 2"),
        ({"toys": [{"length": 1}]}, "toys[0].type", "write one of mouse"),
        ({"toys": [{"type": "mose", "length": 1}]}, "toys[0].type", "did you mean 'mouse'?"),
        ({"toys": [{"type": ["mouse"], "length": 1}]}, "toys[0].type", "use one of mouse"),
        ({"switches": {"pur": True}}, "switches.pur", "did you mean 'purr'?"),
        ({"switches": {"purr": 1}}, "switches.purr", "true or false"),
        ({"place": [0, "x", 0]}, "place[1]", "write a number"),
        ({"spots": [[0, 0, 0], [0, 9, 0]]}, "spots[1][1]", "from -5 to 5"),
        ({"spots": [[0, 0, 0], [0, INF, 0]]}, "spots[1][1]", "finite"),
        ({"spots": [[0, 0, 0], [0, 0]]}, "spots[1]", "write 3 numbers"),
        ({"naps": [1, "2"]}, "naps[1]", "write a number"),
        ({"naps": [1, True]}, "naps[1]", "write a number"),
        ({"moods": [True, 0]}, "moods[1]", "true or false"),
    ],
)
def test_the_dotted_field_leads_to_the_fault(raw: dict, field: str, remedy: str) -> None:
    error = refusal(**raw)
    assert error.field == field
    assert remedy in error.remedy


@pytest.mark.parametrize(
    ("keys", "field", "remedy"),
    [
        ({"times": [0]}, "speed.values", "add it"),
        ({"values": [0]}, "speed.times", "add it"),
        ({"times": [], "values": []}, "speed.times", "at least one key"),
        ({"times": [0, 1], "values": [1]}, "speed.values", "as many as times, which are 2"),
        ({"times": [0, 1, 1], "values": [1, 2, 3]}, "speed.times[2]", "increase, by 1e-06 s"),
        ({"times": [0, -1], "values": [1, 2]}, "speed.times[1]", "increase, by 1e-06 s"),
        # Such a slope is no number
        ({"times": [0, 1e-320], "values": [1, 2]}, "speed.times[1]", "increase, by 1e-06 s"),
        ({"times": [0, INF], "values": [1, 2]}, "speed.times[1]", "finite"),
        ({"times": [0, 1], "values": [1, 21]}, "speed.values[1]", "from 0 to 20"),
        ({"times": [0, 1], "values": [1, [2, 3]]}, "speed.values[1]", "write a number"),
        (
            {"times": [0], "values": [1], "interpolation": "smoth"},
            "speed.interpolation",
            "did you mean 'smooth'?",
        ),
        ({"times": [0], "values": [1], "loop": 1}, "speed.loop", "true or false"),
        ({"times": [0], "values": [1], "lop": True}, "speed.lop", "did you mean 'loop'?"),
    ],
)
def test_keys_are_checked(keys: dict, field: str, remedy: str) -> None:
    error = refusal(speed=keys)
    assert error.field == field
    assert remedy in error.remedy


def test_keyed_values_of_mixed_shape_are_refused() -> None:
    keys = {"times": [0, 1], "values": [1, [1, 2, 3]]}
    assert refusal(glow=keys).field == "glow.values[1]"


def test_keyed_values_move() -> None:
    keys = {"times": [0, 2], "values": [[0, 0, 0], [2, 4, 6]]}
    way = read(way=keys).way
    # Half the way on a straight line is exact in binary
    assert way.at(1.0).tolist() == [1.0, 2.0, 3.0]
    assert way.at(9.0).tolist() == [2.0, 4.0, 6.0]
    assert not way.constant
    low, high = way.extremes
    assert (low.tolist(), high.tolist()) == ([0.0, 0.0, 0.0], [2.0, 4.0, 6.0])
    looped = read(speed={"times": [0, 2], "values": [0, 4], "loop": True}).speed
    assert looped.at(5.0) == 2.0
    assert isinstance(looped.at(5.0), float)
    assert read(speed={"times": [0, 2], "values": [3, 3], "loop": True}).speed.constant


def test_a_value_from_keys_cannot_be_changed_through_its_copy() -> None:
    way = read().way
    way.at(0.0)[:] = 9.0
    assert way.at(0.0).tolist() == [0.0, 0.0, 1.0]


def test_lists_and_tables_have_limits() -> None:
    assert len(read(naps=[0.0] * 100_000).naps) == 100_000
    assert refusal(naps=[0.0] * 100_001).field == "naps"
    assert "at most 256" in refusal(tails=[{"length": 1}] * 257).remedy


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "root" / "meshes").mkdir(parents=True)
    (tmp_path / "root" / "meshes" / "oak.glb").touch()
    (tmp_path / "outside.glb").touch()
    return tmp_path / "root"


@dataclass(frozen=True, kw_only=True)
class Named:
    source: Path = item("source", "mesh", choices=(".glb", ".obj"))


def test_a_source_is_found_and_noted(root: Path) -> None:
    where = Where("a.toml", root=root)
    named = schema.read(Named, {"source": "meshes/oak.glb"}, where)
    assert named.source == (root / "meshes" / "oak.glb").resolve()
    assert where.sources == {"meshes/oak.glb": named.source}


def test_without_a_root_no_file_is_looked_for() -> None:
    where = Where("a.toml")
    assert schema.read(Named, {"source": "no/where.obj"}, where).source == Path("no/where.obj")
    with pytest.raises(InputError, match=r"without \.\."):
        schema.read(Named, {"source": "../where.obj"}, where)


@pytest.mark.parametrize(
    ("path", "remedy"),
    [
        ("", "write the path"),
        (3, "write the path"),
        ("a\0.glb", "write the path"),
        ("../outside.glb", "without .."),
        ("meshes/../meshes/oak.glb", "without .."),
        ("/etc/oak.glb", "inside the folder"),
        ("C:/oak.glb", "inside the folder"),
        ("meshes\\oak.glb", "with /"),
        ("meshes/oak.txt", "ends in .glb, .obj"),
        ("meshes/elm.glb", "there is no such file"),
        ("meshes", "ends in .glb, .obj"),
        ("meshes/" + "x" * 5000 + ".glb", ""),
    ],
)
def test_a_bad_source_is_refused(root: Path, path: object, remedy: str) -> None:
    with pytest.raises(InputError) as caught:
        schema.read(Named, {"source": path}, Where("a.toml", root=root))
    assert caught.value.field == "source"
    assert remedy in caught.value.remedy


def test_a_folder_is_no_source(root: Path) -> None:
    (root / "folder.glb").mkdir()
    with pytest.raises(InputError, match="no such file"):
        schema.read(Named, {"source": "folder.glb"}, Where("a.toml", root=root))


def test_links_stay_inside_the_root(root: Path) -> None:
    (root / "out.glb").symlink_to(root.parent / "outside.glb")
    (root / "in.glb").symlink_to(root / "meshes" / "oak.glb")
    (root / "loop.glb").symlink_to(root / "loop.glb")
    (root / "away").symlink_to(root.parent)
    inside = schema.read(Named, {"source": "in.glb"}, Where("a.toml", root=root))
    assert inside.source.name == "oak.glb"
    for path in ("out.glb", "away/outside.glb", "loop.glb"):
        with pytest.raises(InputError) as caught:
            schema.read(Named, {"source": path}, Where("a.toml", root=root))
        assert caught.value.field == "source"
