"""Hard cases of scene files, as text and as tables, and of the plan that is made of them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from formats import scene as scenes
from pipelines.hard.cells import Family, Result, equal, refused

scenes_family = Family("scene files")
BASE = """format = 1
[camera]
position = [0, 1, 6]
target = [0, 1, 0]
lens = { f_number = 2.8, focus_distance = 6.0 }
[[lights]]
type = "sun"
to_light = [1, 1, 1]
irradiance = [3, 3, 3]
[ground]
albedo = [0.2, 0.2, 0.2]
[picture]
fog = { extinction = 0.02, radiance = [0.4, 0.4, 0.5] }
"""
MESH = '[[meshes]]\nname = "bust"\nsource = "{}"\nposition = [0, 0, 0]\n'


def loaded(
    text: str | bytes, name: str = "a.toml", prepare: Callable[[Path], object] | None = None
) -> Any:
    """Load a scene of this text from a root of its own."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "root"
        (root / "scenes").mkdir(parents=True)
        if prepare is not None:
            prepare(root)
        path = root / "scenes" / name
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return scenes.load(path, root)


def changed(old: str, new: str) -> str:
    if old not in BASE:
        raise ValueError(f"The scene does not say {old}.")
    return BASE.replace(old, new)


def _outside(root: Path) -> None:
    (root.parent / "secret.glb").write_bytes(b"x")
    (root / "meshes").mkdir()
    (root / "meshes" / "link.glb").symlink_to(root.parent / "secret.glb")


REFUSED: tuple[tuple[str, str, str, str], ...] = (
    ("M1", "a word that is none", "a typo in a table", changed("albedo", "albdo")),
    ("M1", "a word that is none", "an unknown effect", BASE + "glitter = { strength = 1 }\n"),
    ("M1", "a word that is none", "an unknown light", changed('"sun"', '"lazer"')),
    ("M2", "numbers that are not finite", "nan", changed("[0, 1, 6]", "[0, nan, 6]")),
    ("M2", "numbers that are not finite", "inf", changed("[3, 3, 3]", "[3, inf, 3]")),
    ("M2", "numbers that are not finite", "1e999", changed("0.02", "1e999")),
    ("M3", "numbers out of range", "albedo 2", changed("[0.2, 0.2, 0.2]", "[2, 0.2, 0.2]")),
    ("M3", "numbers out of range", "negative light", changed("[3, 3, 3]", "[-3, 3, 3]")),
    ("M3", "numbers out of range", "f-number 0", changed("2.8", "0")),
    (
        "M3",
        "numbers out of range",
        "focus before the lens",
        changed("focus_distance = 6.0", "focus_distance = 0.001"),
    ),
    ("M3", "numbers out of range", "a position of 1e30", changed("[0, 1, 6]", "[0, 1e30, 6]")),
    ("M4", "wrong types", "text for a number", changed("2.8", '"wide"')),
    ("M4", "wrong types", "a number for a vector", changed("[0, 1, 6]", "6")),
    ("M4", "wrong types", "two numbers for three", changed("[0, 1, 6]", "[0, 1]")),
    ("M4", "wrong types", "true for a number", changed("0.02", "true")),
    (
        "M4",
        "wrong types",
        "a list for a table",
        changed("{ extinction = 0.02, radiance = [0.4, 0.4, 0.5] }", "[1]"),
    ),
    (
        "M5",
        "geometry that is none",
        "a camera that looks at itself",
        changed("[0, 1, 0]", "[0, 1, 6]"),
    ),
    ("M5", "geometry that is none", "a sun without direction", changed("[1, 1, 1]", "[0, 0, 0]")),
    (
        "M6",
        "keys over time that are none",
        "times that fall",
        changed("[0, 1, 6]", "{ times = [2, 1], values = [[0, 1, 6], [1, 1, 6]] }"),
    ),
    (
        "M6",
        "keys over time that are none",
        "more times than values",
        changed("[0, 1, 6]", "{ times = [0, 1], values = [[0, 1, 6]] }"),
    ),
    (
        "M6",
        "keys over time that are none",
        "no keys",
        changed("[0, 1, 6]", "{ times = [], values = [] }"),
    ),
    (
        "M6",
        "keys over time that are none",
        "times of nan",
        changed("[0, 1, 6]", "{ times = [0, nan], values = [[0, 1, 6], [1, 1, 6]] }"),
    ),
    ("M7", "no scene at all", "nothing", ""),
    ("M7", "no scene at all", "no camera", "format = 1\n"),
    ("M7", "no scene at all", "a format of tomorrow", changed("format = 1", "format = 99")),
    ("M7", "no scene at all", "not TOML", "][ this is not toml"),
    ("M7", "no scene at all", "a key twice", BASE + "[camera]\nposition = [0, 0, 0]\n"),
    ("M9", "paths out of the root", "up and over", BASE + MESH.format("../secret.glb")),
    (
        "M9",
        "paths out of the root",
        "up in the middle",
        BASE + MESH.format("meshes/../../secret.glb"),
    ),
    ("M9", "paths out of the root", "absolute", BASE + MESH.format("/etc/secret.glb")),
    ("M9", "paths out of the root", "a link that leads out", BASE + MESH.format("meshes/link.glb")),
    (
        "M9",
        "paths out of the root",
        "backslashes",
        BASE + MESH.format("meshes\\\\..\\\\..\\\\secret.glb"),
    ),
    ("M9", "paths out of the root", "a drive", BASE + MESH.format("C:/secret.glb")),
    (
        "M10",
        "files that are not there, or of a kind that nobody reads",
        "missing",
        BASE + MESH.format("meshes/no.glb"),
    ),
    (
        "M10",
        "files that are not there, or of a kind that nobody reads",
        "another kind",
        BASE + MESH.format("meshes/a.exe"),
    ),
)
for _row, _case, _name, _text in REFUSED:
    if _row not in scenes_family.rows:
        scenes_family.row(_row, _case, "refused, by table and key", "file, field, value and remedy")
    scenes_family.add(_row, _name, lambda t=_text: refused(lambda: loaded(t, prepare=_outside)))

scenes_family.row("M8", "texts made to harm: deep, huge, NaN in JSON, keys twice, bad letters",
                  "refused in little time and memory", "limits before any work")  # fmt: skip
_TEXTS: tuple[tuple[str, str, str | bytes], ...] = (
    ("deep lists", "a.toml", "format = 1\na = " + "[" * 2000 + "]" * 2000 + "\n"),
    ("deep JSON", "a.json", "[" * 100_000 + "]" * 100_000),
    ("NaN in JSON", "a.json", '{"format": NaN}'),
    ("1e999 in JSON", "a.json", '{"format": 1e999}'),
    ("a key twice in JSON", "a.json", '{"format": 1, "format": 1}'),
    ("a number of 5000 digits", "a.json", '{"format": ' + "9" * 5000 + "}"),
    ("letters that are none", "a.toml", b"format = 1\nname = '\xff\xfe'\n"),
    ("a byte 0", "a.toml", b"format = 1\x00\n"),
    ("5 MB", "a.toml", "# " + "x" * 5_000_000 + "\n" + BASE),
    ("100000 lights", "a.toml", BASE + '[[lights]]\ntype = "sun"\n' * 100_000),
)
for _name, _file, _content in _TEXTS:
    scenes_family.add("M8", _name, lambda f=_file, c=_content: refused(lambda: loaded(c, f)),
                      slow="100000" in _name)  # fmt: skip

scenes_family.row(
    "M11",
    "a scene without effects, and one with every number at its limit",
    "every effect of the frame is decided, with a reason",
    "yes or no, and why",
)


def _planned(text: str) -> Result:
    from formats import effects

    plans = effects.decide(loaded(text))
    told = [p for p in plans if not p.reason]
    return equal(len(told), 0, f"{len(plans)} effects, each with its reason")


for _name, _text in (
    ("the base scene", BASE),
    ("only a camera", BASE.split("[[lights]]")[0]),
    ("fog of 1000", changed("0.02", "1000")),
    ("f-number tiny", changed("2.8", "0.5")),
    ("a sun of 1e6", changed("[3, 3, 3]", "[1e6, 1e6, 1e6]")),
):
    scenes_family.add("M11", _name, lambda t=_text: _planned(t))
