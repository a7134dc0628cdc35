"""Photograph a fossil that is not there: ammonite/NN.jpg under 48 lights, and lights.lp.

    python assets/photographs/make_photographs.py [--to FOLDER] [--size PIXELS]

Two pyrite ammonites in slate (`fossil.py`), rendered by Bakelight's own baker as a dome with one
lamp at a time would show them: self-shadowing, gloss, a little light from the room. Stored as JPEG,
without noise.
"""

import argparse
from pathlib import Path

import numpy as np
from fossil import GRID, fossil
from numpy.typing import NDArray
from PIL import Image

from bake import dome_renders
from maths.colour import srgb_encode
from maths.sampling import GOLDEN_ANGLE

LIGHTS, LOWEST = 48, 12.0  # of the dome; degrees over the slab of the lowest lamp
SIZE, SAMPLES, QUALITY = 240, 25, 89
EXPOSURE = 1.25  # brings slate facing the lamp to a middle grey


def lights() -> NDArray[np.float64]:
    """Return directions (48, 3), an even spiral from the zenith to the lowest lamp."""
    lowest = np.sin(np.radians(LOWEST))
    z = 1 - (1 - lowest) * (np.arange(LIGHTS) + 0.5) / LIGHTS
    turn, r = GOLDEN_ANGLE * np.arange(LIGHTS), np.sqrt(1 - z * z)
    return np.asarray(np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1))


def make(folder: Path, size: int = SIZE, samples: int = SAMPLES, grid: int = GRID) -> Path:
    """Render a fossil of grid x grid points, store it as JPEG, and write FOLDER/lights.lp."""
    folder.mkdir(parents=True, exist_ok=True)
    directions = lights()
    taken = dome_renders.render(
        fossil(grid),
        params=dome_renders.Params(
            resolution=size,
            samples=samples,
            directions=tuple((float(x), float(y), float(z)) for x, y, z in directions),
            gloss=0.6,
            sky_fill=0.04,
        ),
    )
    lines = [str(LIGHTS)]
    for n, (picture, d) in enumerate(zip(taken.pictures, directions, strict=True)):
        name = f"{n:02d}.jpg"
        codes = np.rint(255 * srgb_encode(np.clip(EXPOSURE * picture, 0, 1))).astype(np.uint8)
        Image.fromarray(codes).save(folder / name, quality=QUALITY, optimize=True)
        lines.append(f"{name} {d[0]:.6f} {d[1]:.6f} {d[2]:.6f}")
    path = folder / "lights.lp"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--to", type=Path, default=Path(__file__).parent / "ammonite")
    parser.add_argument("--size", type=int, default=SIZE)
    options = parser.parse_args()
    path = make(options.to, options.size)
    total = sum(file.stat().st_size for file in options.to.iterdir())
    print(f"{path}  {LIGHTS} photographs, {total / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
