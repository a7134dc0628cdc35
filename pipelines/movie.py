"""Frames to a movie: animated WebP and GIF by Pillow, MP4 by ffmpeg (extra `video`)."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from fractions import Fraction
from itertools import chain, pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError, MachineError
from formats.files import atomic

Frame = NDArray[np.uint8]
QUALITY = 80
FASTEST_GIF = 50
"""Frames a second: browsers show shorter delays than 20 ms as 100 ms."""
GIF_PIXELS = 1 << 31
"""Of all frames of a GIF, which Pillow holds until it writes them."""
SAMPLES = 1 << 18
"""Pixels of all frames from which the colours of a GIF are chosen."""
COLOURS = 255
"""Of a GIF; one index more is for what stays as it was."""


def write(
    path: Path, frames: Iterable[Frame], rate: float, total: int, quality: int = QUALITY
) -> None:
    """Write `total` frames (h, w, 3) at `rate` a second; the file appears whole or not at all.

    quality : 1 to 100, of WebP (Pillow's) and MP4 (H.264's rate factor 50 - 0.4 quality); a GIF has
    255 colours for all of its frames. Raises InputError for what the format cannot hold and where
    ffmpeg is missing, MachineError where the disk is full.
    """
    kind = path.suffix.lower()
    shown = iter(frames)
    first = next(shown)
    check(path, rate, total, (first.shape[1], first.shape[0]))
    shown = chain([first], shown)
    with atomic.replacing(path) as part:
        if kind == ".mp4":
            _mp4(path, part, shown, rate, quality)
        elif kind == ".gif":
            _gif(part, shown, _delays(rate, total, 10), total)
        else:
            _webp(part, shown, _delays(rate, total, 1), total, quality)


def check(path: Path, rate: float, total: int, size: tuple[int, int]) -> None:
    """Raise InputError where a movie cannot be written, before a frame is drawn."""
    kind = path.suffix.lower()
    if kind == ".mp4":
        _ffmpeg(path)
    if kind == ".gif" and rate > FASTEST_GIF:
        remedy = "take every second frame (--frames A:B:2), or write .webp or .mp4"
        raise InputError(path, "frames a second", f"{rate:g}, at most {FASTEST_GIF}", remedy)
    if kind == ".gif" and total * size[0] * size[1] > GIF_PIXELS:
        remedy = "make it smaller or shorter, or write .webp or .mp4"
        raise InputError(path, "pixels", f"{total} frames of {size[0]}x{size[1]}", remedy)


def _delays(rate: float, total: int, step: int) -> list[int]:
    """Milliseconds of each frame, multiples of `step`, that never drift from the rate."""
    ends = [step * round(1000 * n / (rate * step)) for n in range(total + 1)]
    return [b - a for a, b in pairwise(ends)]


def _webp(part: Path, frames: Iterator[Frame], delays: list[int], total: int, quality: int) -> None:
    with open(part, "xb") as file:
        _reel(frames, total).save(
            file, "WEBP", save_all=True, duration=delays, loop=0, quality=quality, method=4
        )


def _reel(frames: Iterator[Frame], total: int) -> Any:
    """Return an image of Pillow's whose frames are made when they are asked for, in their order."""
    from PIL import Image

    class Reel(Image.Image):
        n_frames = total

        def tell(self) -> int:
            return 0

        def seek(self, frame: int) -> None:
            # The first is there already, and the end seeks back
            if frame:
                self.im = Image.fromarray(next(frames)).im

    reel, first = Reel(), Image.fromarray(next(frames))
    reel.im, reel._mode, reel._size = first.im, first.mode, first.size
    return reel


def _gif(part: Path, frames: Iterator[Frame], delays: list[int], total: int) -> None:
    from PIL import Image

    from maths import palette

    with tempfile.TemporaryFile() as spool:
        samples, shape = _spooled(spool, frames, total)
        colours = palette.choose(samples, COLOURS)
        table = palette.pairs(colours)
        stored = np.zeros((256, 3), np.uint8)
        stored[: len(colours)] = colours

        def pictures() -> Iterator[Any]:
            spool.seek(0)
            while data := spool.read(shape[0] * shape[1] * 3):
                frame = np.frombuffer(data, np.uint8).reshape(*shape, 3)
                picture = Image.fromarray(palette.dither(frame, colours, table), "P")
                picture.putpalette(stored.tobytes())
                yield picture

        made = pictures()
        with open(part, "xb") as file:
            next(made).save(
                file, "GIF", save_all=True, append_images=made, duration=delays, loop=0,
                palette=stored.tobytes(), optimize=False, disposal=1,
            )  # fmt: skip


def _spooled(
    spool: IO[bytes], frames: Iterator[Frame], total: int
) -> tuple[Frame, tuple[int, int]]:
    """Write frames to a file, and return some of the pixels of each (n, 3), and (h, w)."""
    samples = []
    for number, frame in enumerate(frames):
        spool.write(np.ascontiguousarray(frame).data)
        pixels = frame.reshape(-1, 3)
        # Strides that no width divides evenly would show its columns alone
        step = max(1, len(pixels) * total // SAMPLES) | 1
        samples.append(pixels[number % step :: step])
        shape = frame.shape[:2]
    return np.concatenate(samples), shape


def _ffmpeg(path: Path) -> str:
    """Return the program to run: that of imageio-ffmpeg, or the one that is installed."""
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        if found := shutil.which("ffmpeg"):
            return found
    remedy = "install it with: pip install 'bakelight[video]' -- or write .webp"
    raise InputError(path, "suffix", ".mp4 needs ffmpeg", remedy)


def _mp4(path: Path, part: Path, frames: Iterator[Frame], rate: float, quality: int) -> None:
    first = _even(next(frames))
    height, width = first.shape[:2]
    speed = str(Fraction(rate).limit_denominator(1001))
    tags = ":".join(f"{name}=bt709" for name in ("color_primaries", "color_trc", "colorspace"))
    command = [
        _ffmpeg(path), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", f"{width}x{height}", "-r", speed, "-i", "-", "-an",
        "-vf", "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int,"
        f"format=yuv420p,setparams=range=tv:{tags}",
        "-c:v", "libx264", "-preset", "medium", "-crf", f"{50 - 0.4 * quality:g}",
        "-movflags", "+faststart", "-f", "mp4", str(part),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as said:
        # In a session of its own Ctrl-C does not end it before we do
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stderr=said, start_new_session=True
        )
        assert process.stdin is not None
        try:
            with suppress(BrokenPipeError), process.stdin as pipe:
                for frame in chain([first], map(_even, frames)):
                    pipe.write(frame.data)
            code = process.wait()
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        if code:
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines() or ["no reason given"]
            if any("No space left" in line for line in lines):
                lines = ["No space left on device"]
            remedy = "free some disk space, or write .webp"
            raise MachineError(path, "ffmpeg", lines[-1], remedy)


def _even(frame: Frame) -> Frame:
    """Return a frame with even sides, which 4:2:0 wants, its edge repeated where one is odd."""
    height, width = frame.shape[:2]
    return np.ascontiguousarray(
        np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    )
