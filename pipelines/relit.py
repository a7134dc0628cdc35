"""A stored sprite under given lights, on the CPU: what the shader does, as arrays."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report
from formats.billboard import Billboard
from formats.dome import KIND, Dome
from formats.errors import InputError
from maths import circular_harmonics, hemispherical_lights, sprite_packing
from maths.colour import srgb_decode, srgb_encode

MOST = 1e6  # irradiance, as in a scene
MOST_EV = 32.0
FINEST = 256  # texels round the horizon of a map: 1.4 degrees, beyond what 8 bands can tell
Light = tuple[NDArray[np.float64], NDArray[np.float64]]
Map = NDArray[np.float64]


def parse_light(text: str) -> Light:
    """Read "X,Y,Z" or "X,Y,Z,R,G,B": direction towards the light and its irradiance, pi by default.

    >>> parse_light("0,0,2")[0].tolist()
    [0.0, 0.0, 1.0]
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    direction = np.array(numbers[:3])
    if (
        len(numbers) not in (3, 6)
        or not np.isfinite(numbers).all()
        or not 1e-18 < np.abs(direction).max() < 1e18
        or not all(0 <= power <= MOST for power in numbers[3:])
    ):
        remedy = f"write X,Y,Z (not all zero), or X,Y,Z,R,G,B with colours from 0 to {MOST:.0f}"
        raise InputError("command line", "--light", text, remedy)
    irradiance = np.array(numbers[3:]) if len(numbers) == 6 else np.full(3, np.pi)
    direction = direction / np.abs(direction).max()
    return direction / np.linalg.norm(direction), irradiance


def parse_environment(text: str) -> Map:
    """Read "FILE[,SCALE[,ROTATE]]", ROTATE in degrees about +y: a lat-long map (h, w, 3), turned
    and scaled, of `FINEST` texels a row at most."""
    from bake import environment

    found = re.fullmatch(r"(.*?\.\w+)(?:,([^,]*))?(?:,([^,]*))?", text)
    file, *numbers = found.groups() if found else (text, None, None)
    try:
        scale, rotate = (d if n is None else float(n) for n, d in zip(numbers, (1, 0), strict=True))
    except ValueError:
        scale = rotate = np.nan
    if not (0 <= scale <= MOST and abs(rotate) <= 360):
        remedy = f"write FILE,SCALE,ROTATE: a scale from 0 to {MOST:.0f}, -360 to 360 degrees"
        raise InputError("command line", "--environment", text, remedy)
    image = environment.load(Path(file))
    params = environment.Params(width=min(image.shape[1], FINEST), rotate=float(np.radians(rotate)))
    return environment.resample(image, params=params).radiance.astype(np.float64) * scale


def relight(
    folder: Path,
    lights: list[Light],
    environments: Sequence[Map] = (),
    *,
    view: int = 0,
    clamped: bool = True,
) -> NDArray[np.float32]:
    """Return the premultiplied linear picture (h, w, 4) of a baked sprite, without its border.

    lights : in the frame of the side that is shown, +z towards the viewer. environments : maps (h,
    w, 3), their centre columns behind the sprite. Light adds up before radiance is clamped at 0;
    with `clamped` False it is not, and a sum of lights is the sum of their pictures.
    """
    if (folder / "manifest.json").is_file():
        raise InputError(
            folder, "", "a whole scene", "name the folder of one sprite, in its assets/"
        )
    is_dome = report.read(folder).get("kind") == KIND
    board = Dome.load(folder) if is_dome else Billboard.load(folder)
    if view >= board.views:
        raise InputError(folder, "--view", view, f"the sprite has {board.views}, counted from 0")
    if isinstance(board, Billboard):
        rgb, alpha = _of_ring(board, lights, environments, view)
    elif board.space == "stored":
        rgb, alpha = _of_stored(board, _only(folder, lights, environments), view)
    else:
        L = _seen(board, lights, environments)
        rgb, alpha = board.decoded(view=view) @ board.constants(L), board.alpha(view=view)
    picture = np.concatenate([np.maximum(rgb, 0) if clamped else rgb, alpha[..., None]], axis=-1)
    return _inside(picture, board.quality).astype(np.float32)


def _inside(picture: NDArray[Any], quality: dict[str, Any]) -> NDArray[Any]:
    """Cut off the border, and what mip levels pad at the right and below where a size is told."""
    rows, columns = picture.shape[:2]
    border = int(quality.get("border", 0))
    width, height = quality.get("size", (columns - 2 * border, rows - 2 * border))
    if not (0 < width <= columns - border and 0 < height <= rows - border):
        return picture
    return picture[border : border + int(height), border : border + int(width)]


def _of_ring(
    board: Billboard, lights: list[Light], environments: Sequence[Map], view: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Radiance (h, w, 3), not clamped, and coverage (h, w) of a sprite under circular harmonics."""
    ring = board.ring
    shape: dict[str, Any] = {
        "axis": ring.axis,
        "elevation": ring.elevation,
        "one_sided": ring.one_sided,
    }
    L = np.zeros((ring.terms, 3))
    for direction, irradiance in lights:
        L += circular_harmonics.project_sun(direction, irradiance, ring.terms, **shape)
    for radiance in environments:
        L += circular_harmonics.project_environment(radiance, ring.terms, **shape)
    codes = board.levels[0].reshape(board.views, board.planes, *board.levels[0].shape[1:])[view]
    planes = sprite_packing.decode(codes, board.scales)
    Y = sprite_packing.unpack(planes, ring.terms, board.packing, board.unpack)
    return np.einsum("khwc,kc->hwc", Y, L), planes[0, ..., 3]


def _seen(board: Dome, lights: list[Light], environments: Sequence[Map]) -> NDArray[np.float64]:
    """What a dome sees of all lights, (bands^2, 3)."""
    bands = math.isqrt(board.components.shape[1])
    L = np.zeros((bands * bands, 3))
    for direction, irradiance in lights:
        L += hemispherical_lights.project_sun(direction, irradiance, bands)
    for radiance in environments:
        L += hemispherical_lights.project_environment(radiance, bands)
    return L


def _only(folder: Path, lights: list[Light], environments: Sequence[Map]) -> Light:
    """Return the one light that codes of photographs may be shown under; else InputError."""
    if len(lights) == 1 and not environments:
        return lights[0]
    flag, given = "--light", f"{len(lights)} lights"
    if environments:
        flag, given = "--environment", f"{len(environments)} maps"
    remedy = "light adds up in linear space: bake the photographs with --space linear"
    raise InputError(folder, flag, given, remedy)


def _of_stored(board: Dome, light: Light, view: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Radiance (h, w, 3) and coverage (h, w): codes as photographed, scaled by the light."""
    direction, irradiance = light
    # Photographs count as lit by an irradiance of pi
    L = _seen(board, [(direction, np.full(3, np.pi))], ())
    shown = np.clip(board.decoded(view=view) @ board.constants(L), 0, 1)
    return srgb_decode(shown) * (irradiance / np.pi), board.alpha(view=view)


def write(path: Path, picture: NDArray[np.float32], exposure: float) -> None:
    """Write a premultiplied linear picture: EXR as it is, PNG exposed, sRGB, straight alpha."""
    from formats.files import exr, image

    if not abs(exposure) <= MOST_EV:
        remedy = f"write EV from -{MOST_EV:.0f} to {MOST_EV:.0f}"
        raise InputError("command line", "--exposure", exposure, remedy)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() == ".exr":
        exr.write(path, {"beauty": np.ascontiguousarray(picture)})
        return
    if path.suffix.lower() != ".png":
        raise InputError(path, "suffix", path.suffix, "write .png or .exr")
    alpha = picture[..., 3:]
    straight = np.divide(
        picture[..., :3], alpha, where=alpha > 1e-4, out=np.zeros_like(picture[..., :3])
    )
    shown = np.clip(srgb_encode(np.clip(straight * 2.0**exposure, 0, 1)), 0, 1)
    image.write(
        path, np.floor(np.concatenate([shown, alpha], axis=-1) * 255 + 0.5).astype(np.uint8)
    )
