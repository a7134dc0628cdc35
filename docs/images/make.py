"""Render the README's picture again: one view of the grove at four hours, on one sheet.

Run by `make images`, which gives the four hours. Writes grove.webp beside this file, 1200 pixels
wide and under 400 kB.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SCENE = "assets/scenes/grove.toml"
WIDTH, GAP, LARGEST = 1200, 8, 400_000


def render(folder: Path, hours: list[str]) -> list[Path]:
    """Render the stills at twice the size of a panel; return them in order of time."""
    times = [word for hour in hours for word in ("--time", hour)]
    program = Path(sys.executable).with_name("bakelight")
    command = [program, "render", SCENE, "--size", "1192x672"]
    subprocess.run([*command, *times, "-o", f"{folder}/"], cwd=ROOT, check=True)
    return sorted(folder.glob("*.png"))


def arrange(pictures: list[Image.Image]) -> Image.Image:
    """Put four pictures on a white sheet, two rows of two, scaled to its width."""
    width = (WIDTH - GAP) // 2
    height = round(width * pictures[0].height / pictures[0].width)
    sheet = Image.new("RGB", (WIDTH, 2 * height + GAP), "white")
    for i, picture in enumerate(pictures):
        panel = picture.convert("RGB").resize((width, height), Image.Resampling.LANCZOS)
        sheet.paste(panel, ((i % 2) * (width + GAP), (i // 2) * (height + GAP)))
    return sheet


def save(sheet: Image.Image, path: Path) -> None:
    """Save at the highest quality whose file is small enough."""
    for quality in range(92, 40, -4):
        sheet.save(path, quality=quality, method=6)
        if path.stat().st_size <= LARGEST:
            return


def main() -> None:
    """Render, arrange, save, and say where."""
    with tempfile.TemporaryDirectory() as folder:
        pictures = [Image.open(path) for path in render(Path(folder), sys.argv[1:])]
        sheet = arrange(pictures)
    save(sheet, HERE / "grove.webp")
    print(f"{HERE / 'grove.webp'}: {(HERE / 'grove.webp').stat().st_size} bytes")


if __name__ == "__main__":
    main()
