"""Photographs on disk: the study's glossy ball."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.files import image
from pipelines.studies.glossy_ball import ball

Array = NDArray[np.float64]


def written(folder: Path, directions: Array, size: int = 24) -> Path:
    """Write the pictures as PNG of sRGB, and their .lp file; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [str(len(directions))]
    for n, (light, picture) in enumerate(zip(directions, ball(directions, size), strict=True)):
        image.write(folder / f"light {n}.png", picture)
        lines.append(f"light {n}.png " + " ".join(f"{v:.9f}" for v in light))
    (folder / "ball.lp").write_text("\n".join(lines) + "\n")
    return folder / "ball.lp"
