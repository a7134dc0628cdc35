"""What is wrong with photographs, maps of the environment, pictures and textures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from pipelines.diagnosis import Diagnosis, amount

Float = NDArray[np.float32]
LOOKED_AT = 32  # photographs of a set whose pixels are read
FEWEST, GOOD = 6, 30  # lights of a dome: least, and from where on more add little
LOW = np.sin(np.radians(5))
APART = np.cos(np.radians(1))
CLIPPED = 0.02
REFUSED = "refused, with the place of the first: clamp them to 0"
HALF = 65504.0
FEW = 1e-3  # of the texels


def photographs(path: Path) -> Diagnosis:
    """Read light positions and look at them and their photographs."""
    from bake import dome, dome_report
    from formats.files import light_positions

    lights = light_positions.read(path)
    told, d = Diagnosis(str(path), "photographs"), lights.directions
    z = np.degrees(np.arcsin(np.clip(d[:, 2], -1, 1)))
    told.facts.append(f"{amount(len(d), 'light')} at {z.min():.0f} to {z.max():.0f} degrees")
    told.noted(lights.notes)
    apart, (gap, notes) = dome.distinct(d), dome_report.largest_gap(d)
    told.facts.append(f"the farthest place of the dome is {gap:.0f} degrees from any light")
    if notes:
        told.find("warning", notes[0], gap, "degrees", "smoothed there; the report says so again")
    low = int(np.sum(d[:, 2] < LOW))
    if low:
        told.find("note", amount(low, "light", len(d)) + " under 5 degrees", low, "lights",
                  "they count as they are; sprites fade lights out below 6 degrees")  # fmt: skip
    if apart < len(d):
        told.find(
            "note",
            amount(len(d) - apart, "light") + " in the place of another",
            len(d) - apart,
            "lights",
            "their photographs are averaged by the fit",
        )
    if apart < FEWEST:
        told.find("fault", f"{apart} distinct lights", apart, "lights", f"a dome needs {FEWEST}")
    elif apart < GOOD:
        told.find(
            "note",
            f"{apart} distinct lights",
            apart,
            "lights",
            "fewer bands and more smoothing, chosen by leaving lights out in turn",
        )
    near = int(np.sum(np.abs(z - 30) <= 10))
    if near < 5:
        told.find("note", f"{near} lights within 10 degrees of 30", near, "lights",
                  "no ring of 5 terms there: use the dome, or another elevation")  # fmt: skip
    else:
        told.facts.append(f"{near} lights within 10 degrees of 30, where rings are by default")
    _photographs(told, list(lights.files))
    return told.finished()


def _photographs(told: Diagnosis, files: list[Path]) -> None:
    """Look at the pixels of some photographs, and at the sizes of all."""
    from PIL import Image

    from formats.files import image
    from formats.files.image import FORMATS
    from formats.files.reading import refusing

    sizes: dict[tuple[int, int], list[str]] = {}
    for file in dict.fromkeys(files):
        with refusing(str(file), "photograph"), Image.open(file, formats=FORMATS) as picture:
            sizes.setdefault(picture.size, []).append(file.name)
    told.facts.append(", ".join(f"{w} x {h}: {len(names)}" for (w, h), names in sizes.items()))
    if len(sizes) > 1:
        odd = min(sizes.values(), key=len)
        told.find(
            "fault",
            f"sizes differ: {odd[0]} is not like the others",
            len(odd),
            "photographs",
            "refused: crop them alike",
        )
    (w, h), some = next(iter(sizes)), list(dict.fromkeys(files))
    most = max(1, min(LOOKED_AT, int(6e7 // (w * h))))
    chosen = [some[int(i)] for i in np.unique(np.linspace(0, len(some) - 1, most).astype(int))]
    white, black = {}, []
    for file in chosen:
        pixels = image.read(file)[..., :3]
        share = float(np.mean(pixels.min(axis=2) >= 254.5 / 255))
        if share > CLIPPED:
            white[file.name] = share
        if float(pixels.max()) == 0:
            black.append(file.name)
    told.facts.append(f"pixels of {len(chosen)} photographs were looked at")
    if white:
        name = max(white, key=lambda n: white[n])
        told.find(
            "warning",
            f"{amount(len(white), 'photograph')} clipped, {name} by {white[name]:.0%}",
            white[name],
            "of its pixels",
            "taken as it is: highlights come out too dark",
        )
    if black:
        told.find("warning", f"{black[0]} is black", len(black), "photographs", "taken as it is")


def light_or_picture(path: Path) -> Diagnosis:
    """Tell a lat-long map from a picture by its shape, and look at it."""
    pixels = _pixels(path)
    h, w = pixels.shape[:2]
    if w == 2 * h and pixels.shape[2] != 4:
        return _environment(path, pixels)
    found = _picture(path, pixels)
    if path.suffix.lower() == ".hdr":
        found.find("fault", f"{w} x {h} is not twice as wide as high", w / h, "width over height",
                   "no map of the environment: crop or resample it")  # fmt: skip
    return found.finished()


def _pixels(path: Path) -> Float:
    suffix = path.suffix.lower()
    if suffix == ".exr":
        from formats.files import apart

        return next(iter(apart.read_exr(path).values()))
    if suffix == ".hdr":
        from formats.files import rgbe

        return rgbe.read(path)
    from formats.files import image

    return image.read(path)


def _environment(path: Path, pixels: Float) -> Diagnosis:
    from maths.transforms import latlong_solid_angles

    told, (h, w) = Diagnosis(str(path), "environment"), pixels.shape[:2]
    bad, below = int(np.sum(~np.isfinite(pixels))), int(np.sum(pixels < 0))
    if bad:
        told.find("fault", amount(bad, "value") + " not finite", bad, "values", REFUSED)
    if below:
        least = float(pixels.min())
        what = f"{amount(below, 'value', pixels.size)} below 0, the least {least:.2g}"
        told.find("note", what, -least, "W/(m2 sr)", "counts as 0, up to a tenth of the light")
    if bad:
        return told.finished()
    pixels = np.maximum(pixels, 0)
    grey = pixels.astype(np.float64).mean(axis=2)
    power = grey * latlong_solid_angles(h, w)[:, None]
    total = float(power.sum())
    told.facts.append(
        f"{w} x {h}, mean radiance {total / (4 * np.pi):.3g}, peak {pixels.max():.3g}"
    )
    if total == 0:
        told.find(
            "warning", "the map is black", 0, "", "an effect that changes nothing is left out"
        )
        return told.finished()
    order = np.sort(power.ravel())[::-1]
    count = max(1, int(FEW * order.size))
    share = float(order[:count].sum() / total)
    if share > 0.2:
        what = f"{share:.0%} of the light comes from {amount(count, 'texel')}: a sun"
        told.find(
            "note",
            what,
            share,
            "of the light",
            "kept by averages of solid angle, but blurred: add a sun for sharp shadows",
        )
    over = int(np.sum(pixels > HALF))
    if over:
        told.find("note", amount(over, "value") + f" over {HALF:g}", over, "values",
                  "averaged first, then clamped to half floats")  # fmt: skip
    return _resampled(told, pixels).finished()


def _resampled(told: Diagnosis, pixels: Float) -> Diagnosis:
    from bake import environment

    three = np.ascontiguousarray(
        np.repeat(pixels[..., :1], 3, 2) if pixels.shape[2] < 3 else pixels[..., :3]
    )
    made = environment.resample(three, params=environment.Params())
    error = float(made.quality["energy_error"])
    told.facts.append(
        f"baked as {made.radiance.shape[1]} x {made.radiance.shape[0]}; energy off by {error:.1g}"
    )
    return told


def _picture(path: Path, pixels: Float) -> Diagnosis:
    told, (h, w, channels) = Diagnosis(str(path), "picture"), pixels.shape
    names = {1: "grey", 2: "grey and alpha", 3: "rgb", 4: "rgb and alpha"}
    told.facts.append(f"{w} x {h}, {names.get(channels, f'{channels} channels')}")
    told.facts.append(f"values {float(pixels.min()):.3g} to {float(pixels.max()):.3g}")
    if channels in (2, 4):
        alpha = pixels[..., -1]
        told.facts.append(f"{np.mean(alpha > 0):.0%} covered, {np.mean(alpha == 1):.0%} opaque")
        hidden = float(np.mean(np.any(pixels[..., :-1] > 0, axis=2) & (alpha == 0)))
        if not alpha.any():
            told.find("fault", "all of it is transparent", 0, "", "refused")
        elif hidden > 0.01 and path.suffix.lower() != ".exr":
            told.find(
                "note",
                f"{hidden:.0%} of it is colour under no coverage",
                hidden,
                "of the texels",
                "premultiplied, so that none of it bleeds into smaller levels",
            )
    elif path.suffix.lower() != ".hdr":
        told.find("note", "no alpha", 1, "", "as a sprite it is a full rectangle")
    if max(w, h) > 4096:
        told.find("note", f"{max(w, h)} texels long", max(w, h), "texels",
                  "write resolution in its set, which shrinks it")  # fmt: skip
    return told.finished()


def texture(path: Path) -> Diagnosis:
    """Look into a texture file; all of it is checked as it is read."""
    from formats.files import dds, ktx2

    found: Any = (ktx2 if path.suffix.lower() == ".ktx2" else dds).read(path)
    layers, height, width = found.size
    told = Diagnosis(str(path), "texture")
    told.facts.append(
        f"{found.kind} of {width} x {height} x {layers}, {found.format.name}, "
        f"{amount(len(found.levels), 'level')}"
    )
    return told


def unknown(path: Path) -> Diagnosis:
    """Refuse a file of a kind that nothing reads."""
    remedy = "give a mesh, .lp, .vox, .xraw, .exr, .hdr, picture, .ktx2, .dds or a scene"
    raise InputError(path, "suffix", path.suffix or "none", remedy)
