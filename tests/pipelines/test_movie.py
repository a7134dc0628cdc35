"""Movies: colours, seconds and sizes as asked for; whole files or none; errors of one line."""

import re
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from formats.errors import InputError, MachineError
from pipelines import movie

RATE, COUNT = 24.0, 9
SIZE = (37, 21)  # odd on purpose


def frames(count: int = COUNT) -> Iterator[NDArray[np.uint8]]:
    """A warm square that moves over a blue ramp."""
    width, height = SIZE
    for n in range(count):
        frame = np.zeros((height, width, 3), np.uint8)
        frame[..., 2] = np.linspace(40, 200, width).astype(np.uint8)
        frame[4:12, 2 + 2 * n : 12 + 2 * n] = 230, 160, 60
        yield frame


def shown(path: Path) -> tuple[list[NDArray[np.uint8]], list[int]]:
    """Return the frames and their milliseconds."""
    found, times = [], []
    with Image.open(path) as opened:
        for n in range(opened.n_frames):  # type: ignore[attr-defined]
            opened.seek(n)
            found.append(np.asarray(opened.convert("RGB")))
            times.append(round(opened.info["duration"]))
    return found, times


def psnr(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    return float(10 * np.log10(255**2 / max(1e-9, np.mean((a.astype(float) - b) ** 2))))


@pytest.mark.parametrize(("kind", "least"), [("gif", 38.0), ("webp", 26.0)])
def test_frames_come_back_and_last_as_long_as_asked(
    kind: str, least: float, tmp_path: Path
) -> None:
    path = tmp_path / f"m.{kind}"
    movie.write(path, frames(), RATE, COUNT)
    found, times = shown(path)
    assert [f.shape for f in found] == [(SIZE[1], SIZE[0], 3)] * COUNT
    # 375 ms, in hundredths of a second for a GIF; no frame is off by more than one step
    step = 10 if kind == "gif" else 1
    assert abs(sum(times) - 1000 * COUNT / RATE) <= step / 2
    assert max(times) - min(times) <= step
    # Measured 44 dB (255 colours hold this) and 27.8 dB (4:2:0 at quality 80, small and colourful)
    assert min(psnr(a, b) for a, b in zip(found, frames(), strict=True)) > least
    assert list(tmp_path.iterdir()) == [path]


def test_frames_are_drawn_one_by_one(tmp_path: Path) -> None:
    alive = []

    def counted() -> Iterator[NDArray[np.uint8]]:
        for frame in frames():
            alive.append(sys.getrefcount(frame))
            yield frame

    reel = movie._reel(counted(), COUNT)
    assert len(alive) == 1
    reel.seek(1)
    assert len(alive) == 2


def test_more_quality_is_nearer_and_larger(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    for kind in ("webp", "mp4"):
        sizes = []
        for quality in (20, 95):
            path = tmp_path / f"{quality}.{kind}"
            movie.write(path, frames(), RATE, COUNT, quality)
            sizes.append(path.stat().st_size)
        assert sizes[0] < sizes[1]


def test_mp4_is_what_every_player_takes(tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    path = tmp_path / "m.mp4"
    green = np.full((SIZE[1], SIZE[0], 3), (40, 200, 60), np.uint8)
    movie.write(path, iter([green] * COUNT), RATE, COUNT, 95)
    said = subprocess.run([ffmpeg, "-i", path], capture_output=True, text=True).stderr
    stream = next(line for line in said.splitlines() if "Video:" in line)
    assert "h264" in stream
    assert re.search(r"yuv420p\(tv, bt709,", stream)
    assert "38x22" in stream
    assert "24 fps" in stream
    # What describes the file comes before what it holds: playing starts at once
    data = path.read_bytes()
    assert data.find(b"moov") < data.find(b"mdat")
    raw_rgb = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    command = [ffmpeg, "-loglevel", "error", "-i", path, *raw_rgb]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    back = np.frombuffer(raw, np.uint8).reshape(COUNT, 22, 38, 3)[:, :21, :37]
    # Codes of 8-bit YCbCr at this quality; with the older matrix of BT.601 green is 24 codes off
    assert np.abs(back.astype(int) - (40, 200, 60)).max() <= 4


def test_a_rate_that_gif_cannot_show_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="every second frame"):
        movie.write(tmp_path / "m.gif", frames(), 60.0, COUNT)
    with pytest.raises(InputError, match="shorter"):
        movie.check(tmp_path / "m.gif", 24.0, 10_000, (1920, 1080))


def test_without_ffmpeg_it_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match=r"bakelight\[video\]"):
        movie.check(tmp_path / "m.mp4", RATE, COUNT, SIZE)


@pytest.mark.parametrize("kind", ["gif", "webp", "mp4"])
def test_what_fails_half_way_leaves_nothing(kind: str, tmp_path: Path) -> None:
    if kind == "mp4":
        pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / f"m.{kind}"
    path.write_bytes(b"older")

    def interrupted() -> Iterator[NDArray[np.uint8]]:
        yield from frames(4)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        movie.write(path, interrupted(), RATE, COUNT)
    assert path.read_bytes() == b"older"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("kind", ["webp", "gif", "mp4"])
def test_a_full_disk_is_one_line(kind: str, tmp_path: Path) -> None:
    if kind == "mp4":
        pytest.importorskip("imageio_ffmpeg")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (256, limits[1]))
    try:
        with pytest.raises(MachineError) as caught:
            movie.write(tmp_path / f"m.{kind}", frames(), RATE, COUNT)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, ignored)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []
