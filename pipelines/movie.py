"""Frames to a movie: animated WebP and GIF by Pillow, MP4 by ffmpeg (extra `video`)."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError, MachineError
from pipelines.render_scene import progress

Frame = NDArray[np.uint8]


def write(path: Path, frames: Iterable[Frame], rate: float, total: int) -> None:
    """Write frames (h, w, 3) at `rate` a second; the file appears whole or not at all."""
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        if path.suffix.lower() == ".mp4":
            _mp4(part, progress(frames, total), rate)
        else:
            _pillow(part, progress(frames, total), rate)
        os.replace(part, path)
    except OSError as error:
        raise MachineError(
            path, "", error.strerror or str(error), "choose a folder with room that can be written"
        ) from error
    finally:
        part.unlink(missing_ok=True)


def _pillow(path: Path, frames: Iterable[Frame], rate: float) -> None:
    from PIL import Image

    pictures = (Image.fromarray(frame) for frame in frames)
    first = next(pictures)
    options = {"quality": 80, "method": 4} if path.suffix.lower() == ".webp" else {"optimize": True}
    first.save(
        path, save_all=True, append_images=pictures, duration=round(1000 / rate), loop=0, **options
    )


def _mp4(path: Path, frames: Iterable[Frame], rate: float) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        remedy = "install it with: pip install 'bakelight[video]' -- or write .webp"
        raise InputError(path, "suffix", ".mp4 needs imageio-ffmpeg", remedy) from None
    writer = None
    for frame in frames:
        # H.264 in 4:2:0 wants even sides
        even = np.ascontiguousarray(frame[: frame.shape[0] // 2 * 2, : frame.shape[1] // 2 * 2])
        if writer is None:
            size = (even.shape[1], even.shape[0])
            writer = imageio_ffmpeg.write_frames(
                str(path), size, fps=rate, codec="libx264", quality=None, macro_block_size=2,
                output_params=["-crf", "18", "-preset", "slow", "-movflags", "+faststart"],
            )  # fmt: skip
            writer.send(None)
        writer.send(even)
    if writer is not None:
        writer.close()
