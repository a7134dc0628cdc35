"""Render the pictures of billboards.md and harmonics.md again: a sprite through the lens, by mip
level and in truth, and what is stored of a sprite for its light.

Writes lens.webp and terms.webp beside this file, each under 120 kB.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from maths.circular_basis import evaluate
from maths.colour import srgb_encode
from pipelines.studies import lens_by_mips, subjects
from pipelines.studies.thin_lens import (
    CONTENT,
    FINE,
    Screen,
    level_of,
    looked_up,
    through_lens,
)

HERE = Path(__file__).resolve().parent
SUBJECT = "oak"
BACKDROP = np.array([0.010, 0.014, 0.022])
BLURS, PIXELS, SCALE = (0, 4, 12, 32), 256, 0.45
AZIMUTHS = (150.0, 60.0, 0.0)  # of the light, degrees from the right
LARGEST = 120_000

Float = NDArray[Any]


def lens() -> Image.Image:
    """Show a sprite at growing blur: one lookup above, the mean of 1,024 shifted copies below."""
    mesh = subjects.named(SUBJECT)
    fine = subjects.relit(
        subjects.traced(mesh, resolution=FINE * CONTENT, samples=4, lights=16, held_out=0),
        lens_by_mips.AZIMUTH,
    )
    found = lens_by_mips.scene_of(fine, subjects.Setting(quick=True))
    levels = lens_by_mips.chain_of(found, "kaiser", 2.0)
    screen = Screen(found.size, PIXELS, max(BLURS))
    rows: list[list[Float]] = [[], []]
    for blur in BLURS:
        texels = screen.texels_per_pixel
        lod = level_of(blur * texels, texels, SCALE)
        rows[0].append(looked_up(screen, levels, lens_by_mips.BORDER, lod))
        blurred = through_lens(fine, blur * texels * FINE) if blur else (fine, 0)
        rows[1].append(screen.truth(*blurred))
    titles = [f"{blur} px" for blur in BLURS]
    return sheet(rows, titles, ["one lookup", "1,024 copies"])


def terms() -> Image.Image:
    """Show the five terms of a sprite, orange above zero and blue below, and three lights."""
    master = subjects.traced(
        subjects.named(SUBJECT), resolution=300, samples=16, lights=48, held_out=0
    )
    Y = np.asarray(master.terms[0], np.float64)
    coverage = np.asarray(master.alpha[0], np.float64)[..., None]
    largest = float(np.abs(Y[1:3]).max())
    shown = [signed(Y[k].mean(axis=-1), 0.4 * largest, coverage) for k in range(1, 5)]
    relit = [np.einsum("khwc,k->hwc", Y, evaluate(np.radians(a), 5)).clip(0) * 8 for a in AZIMUTHS]
    first = np.concatenate([Y[0] * 2, coverage], axis=-1)
    every = [first, *shown, *(np.concatenate([r, coverage], axis=-1) for r in relit)]
    names = ["Y0", "Y1, of sin t", "Y2, of cos t", "Y3, of sin 2t", "Y4, of cos 2t"]
    titles = [*names, *(f"light at {a:g}\N{DEGREE SIGN}" for a in AZIMUTHS)]
    rows = [sheet([every[i : i + 4]], titles[i : i + 4], []) for i in (0, 4)]
    out = Image.new("RGB", (rows[0].width, 2 * rows[0].height))
    for i, row in enumerate(rows):
        out.paste(row, (0, i * row.height))
    return out


def signed(values: Float, largest: float, coverage: Float) -> Float:
    """Return a picture (h, w, 4): orange above zero, blue below, black at zero."""
    share = np.clip(values / largest, -1, 1)[..., None]
    colour = np.maximum(share, 0) * [1.0, 0.45, 0.1] + np.maximum(-share, 0) * [0.12, 0.4, 1.0]
    return np.concatenate([colour, coverage], axis=-1)


def sheet(rows: list[list[Float]], titles: list[str], names: list[str]) -> Image.Image:
    """Put premultiplied pictures (h, w, 4) on a dark sheet, a title under each column."""
    height, width = rows[0][0].shape[:2]
    line = 26
    codes = np.rint(255 * srgb_encode(BACKDROP)).astype(int)
    size = (width * len(titles), (height + (line if names else 0)) * len(rows) + line)
    out = Image.new("RGB", size, tuple(codes.tolist()))
    draw, font = ImageDraw.Draw(out), ImageFont.load_default(15)
    for j, row in enumerate(rows):
        top = j * (height + (line if names else 0)) + (line if names else 0)
        for i, picture in enumerate(row):
            over = picture[..., :3] + (1 - picture[..., 3:]) * BACKDROP
            shown = np.rint(255 * srgb_encode(np.clip(over, 0, 1))).astype(np.uint8)
            out.paste(Image.fromarray(shown), (i * width, top))
        if names:
            draw.text((12, top - line // 2), names[j], "white", font, anchor="lm")
    for i, title in enumerate(titles):
        draw.text((i * width + width // 2, size[1] - line // 2), title, "white", font, anchor="mm")
    return out


def main() -> None:
    """Render and save both."""
    for name, made in (("lens", lens), ("terms", terms)):
        picture = made()
        if picture.width > 1200:
            picture = picture.resize(
                (1200, round(1200 * picture.height / picture.width)), Image.Resampling.LANCZOS
            )
        for quality in range(90, 30, -5):
            picture.save(HERE / f"{name}.webp", quality=quality, method=6)
            if (HERE / f"{name}.webp").stat().st_size < LARGEST:
                break


if __name__ == "__main__":
    main()
