"""OpenEXR files in a process of their own: the same pictures, errors in one line, no harm."""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from formats.errors import InputError
from formats.files import apart, exr

PICTURES = {
    "a": np.linspace(0, 3, 8 * 12 * 3, dtype=np.float32).reshape(8, 12, 3),
    "b": np.ones((4, 5, 1), np.float32),
}


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    path = tmp_path / "a.exr"
    exr.write(path, PICTURES)
    return path


def test_pictures_come_as_from_the_codec(sound: Path) -> None:
    found, wanted = apart.read_exr(sound), exr.read(sound)
    assert list(found) == list(wanted)
    for name, picture in wanted.items():
        np.testing.assert_array_equal(found[name], picture, strict=True)
        assert found[name].flags.writeable


def test_errors_come_as_from_the_codec(tmp_path: Path) -> None:
    (tmp_path / "noise.exr").write_bytes(b"noise" * 20)
    (tmp_path / "empty.exr").write_bytes(b"")
    for name in ("noise.exr", "empty.exr", "missing.exr", "."):
        with pytest.raises(InputError) as wanted:
            exr.read(tmp_path / name)
        with pytest.raises(InputError) as found:
            apart.read_exr(tmp_path / name)
        assert str(found.value) == str(wanted.value)
        assert (found.value.file, found.value.field) == (wanted.value.file, wanted.value.field)


def test_what_openexr_prints_is_not_seen(sound: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data = bytearray(sound.read_bytes())
    data[len(data) // 2 :] = bytes(len(data) - len(data) // 2)
    sound.write_bytes(data)
    with pytest.raises(InputError):
        exr.read(sound)
    assert "EXR_ERR" in "".join(capfd.readouterr())
    with pytest.raises(InputError, match="could be decoded"):
        apart.read_exr(sound)
    assert "".join(capfd.readouterr()) == ""


def test_a_crash_is_one_line(sound: Path) -> None:
    program = f"import os; os.kill(os.getpid(), {signal.SIGSEGV:d})"
    if sys.platform.startswith("linux"):
        program = f"import resource; resource.setrlimit(resource.RLIMIT_CORE, (0, 0)); {program}"
    with pytest.raises(InputError, match=r"a\.exr: .*crashed \(SIGSEGV\).* -- .*export it again"):
        apart.read_exr(sound, program=program)
    with pytest.raises(InputError, match="ended with 3"):
        apart.read_exr(sound, program="raise SystemExit(3)")
    # It breaks off amid the pixels
    program = """print('{"pictures": [["", [9, 9, 3]]]}'); print("some")"""
    with pytest.raises(InputError, match="ended with 0"):
        apart.read_exr(sound, program=program)


def test_a_hang_ends(sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "SECONDS", 0.2)
    with pytest.raises(InputError, match="took over 0 s"):
        apart.read_exr(sound, program="import time; time.sleep(60)")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of Linux")
def test_memory_and_time_are_limited() -> None:
    """Where nobody is left to watch, too: the system ends it."""
    assert limited("apart._limit(9.0); bytearray(1 << 40)") == 1
    assert limited("apart.MEMORY = 1 << 29; apart._limit(9.0); bytearray(1 << 30)") == 1
    assert limited("apart._limit(9.0); bytearray(1 << 27)") == 0
    assert limited("apart._limit(0.0)\nwhile True: pass") == -signal.SIGXCPU


def limited(program: str) -> int:
    """Run it, and return how it ended."""
    command = [sys.executable, "-c", "from formats.files import apart; " + program]
    root = Path(apart.__file__).parents[2]
    return subprocess.run(command, cwd=root, capture_output=True, check=False).returncode
