"""Scene text: every malformed file is one typed refusal."""

from pathlib import Path

import pytest

from formats import scene
from formats.errors import InputError


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": NaN}', "NaN"),
        ('{"a": -Infinity}', "Infinity"),
        ('{"a": 1e999}', "1e999"),
        ('{"a": 1, "a": 2}', "twice"),
        ('{"a": ' + "9" * 5000 + "}", "digits"),
        ("[" * 100_000, ""),
        ("[1]", "start a JSON scene with {"),
        ("{", ""),
        ("", "empty"),
        ("[" * 40 + "]" * 40, ""),
        ('{"a": ' + "[" * 40 + "]" * 40 + "}", "at most 32 levels"),
    ],
)
def test_bad_json_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "a.json"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        scene.load(file, root=tmp_path)
    assert message in str(caught.value)
    assert caught.value.file == str(file)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = \nb = 1", "line 1"),
        ("a = 1\na = 2\nb = 3", "line 2"),
        ("a = " + "[" * 100_000, ""),
        ("a = " + "[" * 40 + "]" * 40, "at most 32 levels"),
        ("a = " + "9" * 5000, "digits"),
        ("a = '\ud800'", "utf-8"),
    ],
)
def test_bad_toml_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "a.toml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(InputError) as caught:
        scene.load(file, root=tmp_path)
    assert message in str(caught.value)


def test_files_have_a_largest_size(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_bytes(b"#" + b" " * 4_000_000)
    with pytest.raises(InputError, match="4000000 bytes"):
        scene.load(file, root=tmp_path)
