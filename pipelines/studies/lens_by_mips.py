"""Which mip filter looks most like a lens, and which level stands for how much blur?

The truth is a thin lens: a sprite parallel to the sensor and off the plane of focus is the mean of
its own copies shifted over the aperture's disc, here 1,024 of them, at twice the resolution of
level 0 and averaged over each pixel's square. Against it stands the player's lookup, in numpy: the
coarser of the hardware's level and log2(c * circle of confusion in texels). Every filter gets the c
that suits it best, over all blurs and sizes at once; PSNR is of premultiplied RGBA, all values 0 to
1, over the sprite and the blur about it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bake import mips
from maths.colour import srgb_encode
from pipelines.studies.answer import Answer, Panel, Picture, Row, Shot, point
from pipelines.studies.interval import rms
from pipelines.studies.stages import processor_seconds
from pipelines.studies.subjects import Setting, relit, traced
from pipelines.studies.thin_lens import (
    CONTENT,
    FINE,
    MAX_LOD,
    Float,
    Screen,
    level_of,
    looked_up,
    through_lens,
)

TAKES = ("mesh",)
WIDTHS = {
    "box": (0.5, 0.75, 1.0),
    "disc": (0.5, 0.75, 0.9, 1.0, 1.25),
    "gaussian": (0.75, 1.0, 1.25, 1.5, 2.0),
    "kaiser": (1.5, 1.75, 2.0, 2.25, 2.5, 3.0),
}
PIXELS = (64, 128, 181, 256, 512, 1024)  # of the sprite on the screen
BLURS = (0, 1, 2, 4, 8, 16, 32, 64)  # circle of confusion, pixels
QUICK_PIXELS, QUICK_BLURS = (128, 512), (0, 4, 16)
SCALES = 2.0 ** np.arange(-3, 1.001, 1 / 32)  # candidates for c
BORDER = 512
LEVELS = int(MAX_LOD) + 1
DEFAULT = "kaiser"
SHOWN = {64: 4, 128: 4, 256: 8, 512: 16, 1024: 32}  # pixels: blur, of a picture to look at
AZIMUTH = 2.2  # of the light that the sprites stand in


@dataclass(frozen=True)
class Scene:
    """A sprite and what a lens makes of it: pixels -> blur -> picture."""

    level0: Float
    size: tuple[int, int]
    truth: dict[tuple[int, int], Float]


@dataclass(frozen=True)
class Pair:
    """Mean squares that give the error of any blend of levels n and n + 1: |truth - fine|^2,
    (truth - fine).(coarse - fine), |coarse - fine|^2."""

    error: float
    along: float
    step: float

    def blended(self, part: float) -> float:
        """Return the mean square error of fine + part * (coarse - fine)."""
        return max(self.error - 2 * part * self.along + part * part * self.step, 1e-12)


Key = tuple[str, int, int]  # subject, pixels, blur
Pairs = dict[Key, dict[int, Pair]]


def measure(setting: Setting) -> Answer:
    """Measure every filter and half-width; choose the best."""
    widths = (
        {name: (mips.FILTERS[name].half_width,) for name in WIDTHS} if setting.quick else WIDTHS
    )
    found: dict[tuple[str, float], Pairs] = {(f, w): {} for f in widths for w in widths[f]}
    steps: dict[str, float] = {}
    seconds: dict[tuple[str, str, float], float] = {}
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in setting.meshes("oak", "lantern", "knot").items():
        fine = relit(
            traced(
                mesh,
                resolution=FINE * CONTENT,
                samples=setting.pick(1, 4),
                lights=setting.pick(8, 16),
                held_out=2,
            ),
            AZIMUTH,
        )
        scene = scene_of(fine, setting)
        for filter, width in found:
            levels, seconds[name, filter, width] = processor_seconds(chain_of, scene, filter, width)
            shots[name, label(filter, width)] = shot(scene, levels, filter)
            found[filter, width] |= dict(pairs_of(name, scene, levels))
            if width == mips.FILTERS[filter].half_width:
                steps[filter] = max(steps.get(filter, 0.0), largest_step(scene, levels))
    fits = {key: best_scale(pairs) for key, pairs in found.items()}
    best = {f: max((k for k in fits if k[0] == f), key=lambda k: fits[k][1]) for f in widths}
    table = [
        point(
            name,
            label(f, w),
            rms([10 ** (-decibels(pairs[key], *key[1:], fits[f, w][0]) / 10) for key in own]),
            series=f,
            bake_seconds=spent,
            default=f == DEFAULT and w == mips.FILTERS[f].half_width,
            filter=f,
            half_width=w,
            c=fits[f, w][0],
        )
        for (name, f, w), spent in seconds.items()
        for pairs in [found[f, w]]
        for own in [[key for key in pairs if key[0] == name]]
    ]
    answer = _answer(found, fits, best, steps)
    return replace(answer, rows=[*table, *answer.rows], shots=shots)


def label(filter: str, width: float) -> str:
    """Return how a kernel is told."""
    return f"{filter}, {width:g} texels"


def shot(scene: Scene, levels: list[Float], filter: str) -> Shot:
    """Return a sprite out of focus, by mips with the filter's own c and through the lens."""
    pixels = max(p for p, b in scene.truth if (p, SHOWN.get(p)) in scene.truth and p <= 256)
    blur = SHOWN[pixels]
    screen = Screen(scene.size, pixels, blur)
    texels = screen.texels_per_pixel
    lod = level_of(blur * texels, texels, mips.FILTERS[filter].lens_scale)
    return Shot(seen(looked_up(screen, levels, BORDER, lod)), seen(scene.truth[pixels, blur]))


def seen(picture: Float) -> Picture:
    """Return premultiplied values (h, w, 4) before grey, as a screen shows them."""
    over = picture[..., :3] + 0.18 * (1 - picture[..., 3:])
    return np.asarray(np.rint(255 * srgb_encode(np.clip(over, 0, 1))), np.uint8)


def scene_of(fine: Float, setting: Setting) -> Scene:
    """Make level 0 of a sprite (h, w, 4) of FINE times its size, and its pictures by lens."""
    fine = np.pad(fine, ((0, fine.shape[0] % 2), (0, fine.shape[1] % 2), (0, 0))).astype(np.float32)
    quads = fine[::2, ::2] + fine[1::2, ::2] + fine[::2, 1::2] + fine[1::2, 1::2]
    level0 = np.asarray(quads / 4, np.float32)
    truth: dict[tuple[int, int], Float] = {}
    wanted = [
        (p, b)
        for p in (QUICK_PIXELS if setting.quick else PIXELS)
        for b in (QUICK_BLURS if setting.quick else BLURS)
    ]
    diameter = {(p, b): b * CONTENT * FINE / p for p, b in wanted}
    for one in sorted(set(diameter.values())):
        blurred, margin = (fine, 0) if one == 0 else through_lens(fine, one)
        for p, b in wanted:
            if diameter[p, b] == one:
                truth[p, b] = Screen((level0.shape[0], level0.shape[1]), p, b).truth(
                    blurred, margin
                )
    return Scene(level0, (level0.shape[0], level0.shape[1]), truth)


def chain_of(scene: Scene, filter: str, half_width: float) -> list[Float]:
    """Return the mip levels (h, w, 4) of a sprite, clipped to what codes can hold."""
    most = 1 << (LEVELS - 1)
    height, width = (-(-(n + 2 * BORDER) // most) * most for n in scene.size)
    placed = np.zeros((1, height, width, 4), np.float32)
    placed[:, BORDER : BORDER + scene.size[0], BORDER : BORDER + scene.size[1]] = scene.level0
    levels = mips.mip_chain(placed, LEVELS, filter, half_width=half_width)
    return [np.clip(level[0], 0, 1) for level in levels]


def pairs_of(name: str, scene: Scene, levels: list[Float]) -> Iterator[tuple[Key, dict[int, Pair]]]:
    """Give, for each picture, the pairs of neighbouring levels that some c may ask for."""
    for (pixels, blur), truth in scene.truth.items():
        screen = Screen(scene.size, pixels, blur)
        texels = screen.texels_per_pixel
        first = int(level_of(0, texels, 1.0))
        last = int(level_of(blur * texels, texels, SCALES[-1]))
        fine = screen.lookup(levels[first], first, BORDER)
        pairs: dict[int, Pair] = {}
        for number in range(first, min(last + 1, LEVELS - 1)):
            coarse = screen.lookup(levels[number + 1], number + 1, BORDER)
            off, step = (truth - fine).astype(np.float64), (coarse - fine).astype(np.float64)
            pairs[number] = Pair(
                float(np.mean(off * off)), float(np.mean(off * step)), float(np.mean(step * step))
            )
            fine = coarse
        yield (name, pixels, blur), pairs


def decibels(pairs: dict[int, Pair], pixels: int, blur: int, scale: float) -> float:
    """Return the PSNR of the player's lookup of one picture with c = scale."""
    lod = level_of(blur * CONTENT / pixels, CONTENT / pixels, scale)
    low = min(int(lod), max(pairs))
    return float(-10 * np.log10(pairs[low].blended(lod - low)))


def best_scale(found: Pairs) -> tuple[float, float]:
    """Return the c with the highest mean PSNR over all pictures, and that mean."""
    means = [
        np.mean([decibels(pairs, p, b, c) for (_, p, b), pairs in found.items()]) for c in SCALES
    ]
    at = int(np.argmax(means))
    return float(SCALES[at]), float(means[at])


def largest_step(scene: Scene, levels: list[Float], across: float = 1e-4) -> float:
    """Return how much a pixel changes at most where the level crosses an integer, in 1/255."""
    stored = [np.round(level * 255) / np.float32(255) for level in levels]
    screen = Screen(scene.size, 256, 8)
    steps = [
        np.abs(
            looked_up(screen, stored, BORDER, number + across / 2)
            - looked_up(screen, stored, BORDER, number - across / 2)
        ).max()
        for number in range(1, LEVELS - 1)
    ]
    return float(max(steps)) * 255


def _answer(
    found: dict[tuple[str, float], Pairs],
    fits: dict[tuple[str, float], tuple[float, float]],
    best: dict[str, tuple[str, float]],
    steps: dict[str, float],
) -> Answer:
    rows: list[Row] = [
        {
            "filter": f,
            "half_width": w,
            "c": fits[f, w][0],
            "subject": name,
            "pixels": p,
            "blur_pixels": b,
            "psnr_db": decibels(pairs, p, b, fits[f, w][0]),
        }
        for (f, w), all_pairs in found.items()
        for (name, p, b), pairs in all_pairs.items()
    ]
    first = max(best.values(), key=lambda k: fits[k][1])
    blurs = sorted({int(r["blur_pixels"]) for r in rows})
    table: list[Row] = [
        {
            **{"filter": f, "half_width": w, "c": c, "mean_db": mean},
            **{f"{b}_px": _mean(rows, f, w, "blur_pixels", b) for b in blurs},
        }
        for (f, w), (c, mean) in fits.items()
    ]
    sizes = sorted({int(r["pixels"]) for r in rows})
    by_blur = {
        f: [(i, _mean(rows, *k, "blur_pixels", b)) for i, b in enumerate(blurs)]
        for f, k in best.items()
    }
    by_size = {f: [(p, _mean(rows, *k, "pixels", p)) for p in sizes] for f, k in best.items()}
    by_width = {f: [(w, fits[g, w][1]) for g, w in fits if g == f] for f in best}
    return Answer(
        question="lens_by_mips",
        title=f"{first[0].capitalize()}, half-width {first[1]:g}, c = {fits[first][0]:.2f} is "
        f"most like a lens: {fits[first][1]:.1f} dB, box of one texel {fits['box', 0.5][1]:.1f} dB",
        truth="the mean of 1,024 copies of the sprite shifted over the aperture's disc",
        rows=rows,
        unit="RMS error of all blurs and sizes, share of white",
        axes={"bake_seconds": "processor seconds of a chain of mips"},
        decibels=True,
        table=table,
        panels=(
            Panel(
                "circle of confusion, pixels",
                "PSNR, dB",
                by_blur,
                scales=("linear", "linear"),
                ticks=[str(b) for b in blurs],
                title=f"{first[0].capitalize()} is best at {ahead(by_blur, first[0])} of "
                f"{len(blurs)} blurs",
            ),
            Panel(
                "size on the screen, pixels (512 texels)",
                "PSNR, dB",
                by_size,
                title=f"{first[0].capitalize()} is best at {ahead(by_size, first[0])} of "
                f"{len(sizes)} sizes",
            ),
            Panel(
                "half-width of the kernel, texels",
                "mean PSNR, dB",
                by_width,
                marked=first[1],
                title=f"A half-width of {first[1]:g} texels suits {first[0]} best of those tried",
                scales=("linear", "linear"),
            ),
        ),
        figures={
            "best": {"filter": first[0], "half_width": first[1], "c": fits[first][0]},
            "by_filter": {
                f: {"half_width": k[1], "c": fits[k][0], "mean_db": fits[k][1]}
                for f, k in best.items()
            },
            "largest_step_at_an_integer_level": {f: step for f, step in steps.items()},
            "unit_of_steps": "1/255, for a change of 1e-4 of the level",
        },
    )


def ahead(lines: Mapping[str, Sequence[tuple[float, float]]], name: str) -> int:
    """Count the places where one line is the highest."""
    best = [max(line[i][1] for line in lines.values()) for i in range(len(lines[name]))]
    return sum(y >= most for (_, y), most in zip(lines[name], best, strict=True))


def _mean(rows: list[Row], filter: str, width: float, column: str, value: int) -> float:
    chosen = [
        float(r["psnr_db"])
        for r in rows
        if (r["filter"], r["half_width"], r[column]) == (filter, width, value)
    ]
    return sum(chosen) / len(chosen)
