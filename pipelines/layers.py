"""Layered EXR of a frame: the names that compositing programs know, and what the header says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError

ALL = "all"
WIDE = ("depth", "position", "id")
"""Layers of 32 bits; the player's colours and normals have 16."""
REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


def parse(text: str | None, out: Path) -> tuple[str, ...]:
    """Read --layers: `all`, or names with commas between. Raises InputError for other names."""
    if text is None:
        return ()
    from runtime.layers import CHANNELS

    if out.suffix.lower() != ".exr":
        raise InputError("command line", "--layers", text, "layers need an .exr output")
    names = tuple(word.strip() for word in text.split(","))
    if names == (ALL,):
        return tuple(CHANNELS)
    for name in names:
        if name not in CHANNELS:
            remedy = f"choose from {', '.join(CHANNELS)}, or all"
            raise InputError("command line", "--layers", name, remedy)
    return tuple(dict.fromkeys(names))


def attributes(player: Any, time: float) -> dict[str, Any]:
    """Header of a frame just drawn at `time` seconds.

    OpenEXR's own names, where there is one: worldToCamera and worldToNDC (-1..1 over the picture)
    multiply row vectors; focus in metres, aperture as f-number, nominalFocalLength in millimetres.
    """
    camera, (width, height) = player.view, player.targets.size
    found = {
        "software": "Bakelight",
        "scene": player.scene.name,
        "time": float(time),
        "exposure": float(player.scene.picture.film.exposure.at(time)),
        "chromaticities": REC_709,
        "worldToCamera": _matrix(camera.view_from_world),
        "worldToNDC": _matrix(camera.clip_from_world(width / height)),
        "nominalFocalLength": 1e3 * camera.focal_length,
        "sensorHeight": 1e3 * camera.sensor_height,
    }
    if camera.f_number is not None:
        found |= {"aperture": float(camera.f_number), "focus": float(camera.focus_distance)}
    return found


def save(path: Path, found: dict[str, NDArray[np.float32]], header: dict[str, Any]) -> None:
    """Write layers, of which `beauty` is plain RGB."""
    from formats.files import exr
    from runtime.layers import CHANNELS

    written = {}
    for name, pixels in found.items():
        letters = CHANNELS.get(name, "RGB")
        kind = np.float32 if name in WIDE else np.float16
        written["" if name == "beauty" else name] = letters, pixels.astype(kind)
    exr.write_layers(path, written, attributes=header)


def _matrix(target_from_source: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.ascontiguousarray(target_from_source.T, np.float32)
