"""A stored sprite under given lights, on the CPU: what the shader does, as arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats import dome, report
from formats.billboard import Billboard
from formats.errors import InputError
from maths import circular_harmonics, sprite_packing
from maths.colour import srgb_decode, srgb_encode

MOST = 1e6  # irradiance, as in a scene
MOST_EV = 32.0
Light = tuple[NDArray[np.float64], NDArray[np.float64]]


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


def relight(folder: Path, lights: list[Light], *, view: int = 0) -> NDArray[np.float32]:
    """Return the premultiplied linear picture (h, w, 4) of a baked sprite, its border cut off."""
    if (folder / "manifest.json").is_file():
        raise InputError(
            folder, "", "a whole scene", "name the folder of one sprite, in its assets/"
        )
    if report.read(folder).get("kind") == dome.KIND:
        return _relit_dome(folder, lights)
    board = Billboard.load(folder)
    if view >= board.views:
        raise InputError(folder, "--view", view, f"the sprite has {board.views}, counted from 0")
    ring = board.ring
    L = np.zeros((ring.terms, 3))
    for direction, irradiance in lights:
        L += circular_harmonics.project_sun(
            direction,
            irradiance,
            ring.terms,
            axis=ring.axis,
            elevation=ring.elevation,
            one_sided=ring.one_sided,
        )
    border = int(board.quality.get("border", 0))
    codes = board.levels[0].reshape(board.views, board.planes, *board.levels[0].shape[1:])[view]
    if 2 * border < min(codes.shape[1:3]):
        inside = slice(border, -border or None)
        codes = codes[:, inside, inside]
    planes = sprite_packing.decode(codes, board.scales)
    Y = sprite_packing.unpack(planes, ring.terms, board.packing, board.unpack)
    rgb = np.maximum(np.einsum("khwc,kc->hwc", Y, L), 0)
    return np.concatenate([rgb, planes[0, ..., 3:]], axis=-1).astype(np.float32)


def _relit_dome(folder: Path, lights: list[Light]) -> NDArray[np.float32]:
    """Return the linear picture (h, w, 4) of photographs under a dome: the sum over lights."""
    asset = dome.Dome.load(folder)
    if asset.space == "stored" and len(lights) > 1:
        remedy = "light adds up in linear space: bake the photographs with --space linear"
        raise InputError(folder, "--light", f"{len(lights)} lights", remedy)
    # Photographs count as lit by an irradiance of pi
    power = [irradiance / np.pi for _, irradiance in lights]
    constants = asset.constants(np.array([direction for direction, _ in lights]))
    channels = asset.decoded().astype(np.float64)
    if asset.space == "stored":
        shown = np.clip(channels @ constants[0], 0, 1)
        rgb = srgb_decode(shown) * power[0]
    else:
        rgb = np.maximum(channels @ np.einsum("lkc,lc->kc", constants, np.array(power)), 0)
    opaque = np.ones_like(rgb[..., :1])
    return np.concatenate([rgb, opaque], axis=-1).astype(np.float32)


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
