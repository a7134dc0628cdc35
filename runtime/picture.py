"""Pictures and movies of a player as objects: notebooks show them, numpy takes them."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.files import atomic, image


class Picture:
    """A finished picture. codes : (h, w, 3) uint8 as shown, row 0 on top."""

    def __init__(self, codes: NDArray[np.uint8]) -> None:
        self.codes = np.ascontiguousarray(codes)

    def save(self, path: str | Path) -> Path:
        """Write a .png, whole or not at all."""
        image.write(Path(path), self.codes)
        return Path(path)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """Give numpy the codes."""
        return np.array(self.codes, dtype) if dtype or copy else self.codes

    def __repr__(self) -> str:
        height, width = self.codes.shape[:2]
        return f"<Picture {width}x{height}>"

    def _repr_png_(self) -> bytes:
        from PIL import Image

        stream = io.BytesIO()
        Image.fromarray(self.codes).save(stream, "PNG", compress_level=image.PNG_LEVEL)
        return stream.getvalue()


class Movie:
    """A loop of pictures (h, w, 3) uint8, held as animated WebP. rate : of frames a second."""

    def __init__(self, frames: Sequence[NDArray[np.uint8]], rate: float, quality: int = 80) -> None:
        from PIL import Image

        first, *more = [Image.fromarray(np.ascontiguousarray(frame)) for frame in frames]
        self.size, self.count, self.rate = first.size, len(frames), rate
        ends = [round(1000 * n / rate) for n in range(len(frames) + 1)]
        stream = io.BytesIO()
        first.save(
            stream, "WEBP", save_all=True, append_images=more, loop=0, quality=quality,
            duration=[b - a for a, b in pairwise(ends)],
        )  # fmt: skip
        self.data = stream.getvalue()

    def save(self, path: str | Path) -> Path:
        """Write the .webp, whole or not at all."""
        atomic.write_bytes(Path(path), self.data)
        return Path(path)

    def __repr__(self) -> str:
        return f"<Movie {self.size[0]}x{self.size[1]}, {self.count} frames>"

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.data).decode()
        return f'<img src="data:image/webp;base64,{data}" width="{self.size[0]}">'
