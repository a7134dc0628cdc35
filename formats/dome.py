"""A picture under any light of a dome: sixteen numbers a pixel in four RGBA8 planes (`dome.ktx2`).

A pixel's answer to a light is a weighted sum of `channels` colours that all pixels share, each a
series of hemispherical harmonics; the weights are what the planes hold, four a plane. Where the
picture has coverage, it takes the alpha of plane 0, and fifteen channels are left.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from formats import report, seal
from formats.errors import DamagedError
from formats.files import atomic, ktx2
from formats.files.reading import MAX_JSON_BYTES, read_bytes, strict_json
from maths import sprite_packing

FORMAT = 2
KIND = "dome"
NAME = "dome.ktx2"
COMPONENTS = "components.json"
"""The series of the channels' colours, apart from the report, which people read."""
AGAIN = "bake it again"
_DETAILS = ("metres_per_texel", "height", "max_lod", "lens_scale")

Float = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Dome:
    """What a camera on +z sees under lights of the hemisphere around it.

    levels : mip levels, each (views * P, h, w, 4) uint8, layer = view * P + plane. scales : (P, 4).
    Codes are signed, `(q - 128) / 127`, see `slots` for the channels' places; coverage is unsigned,
    `q / 255`, of scale 1, and the channels are premultiplied by it. components : (channels,
    bands^2, 3), the channels' colours as series. space : "linear" radiance, or codes as "stored" in
    the photographs, 0..1. Values are those under one sun of irradiance pi. pivot : (x, y) texels
    from the top left to the ground point; metres_per_texel : of level 0; height : metres of the
    object. max_lod : the coarsest level that the lens may ask for. lens_scale : the c of LOD =
    log2(c * circle of confusion in texels). quality : of the report.
    """

    levels: tuple[NDArray[np.uint8], ...]
    scales: Float
    components: NDArray[np.float64]
    space: str
    coverage: bool = False
    views: int = 1
    metres_per_texel: float = 1.0
    pivot: tuple[float, float] = (0.0, 0.0)
    height: float = 1.0
    max_lod: float = 0.0
    lens_scale: float = 0.45
    quality: dict[str, Any] = field(default_factory=dict)

    @property
    def channels(self) -> int:
        """Number of channels in use, coverage not among them."""
        return len(self.components)

    @property
    def planes(self) -> int:
        """Number of RGBA planes a view."""
        return len(self.scales)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of level 0 in texels, borders included."""
        return self.levels[0].shape[2], self.levels[0].shape[1]

    def decoded(self, level: int = 0, view: int = 0) -> Float:
        """Return the channels (h, w, channels) that the codes of one level and view stand for."""
        planes = decode(self._codes(level, view), self.scales, self.coverage)
        by_slot = np.moveaxis(planes, 0, 2).reshape(*planes.shape[1:3], -1)
        return np.ascontiguousarray(by_slot[..., slots(self.channels, self.coverage)])

    def alpha(self, level: int = 0, view: int = 0) -> Float:
        """Return the coverage (h, w), 0..1, of one level and view: 1 without coverage."""
        codes = self._codes(level, view)[0, ..., 3]
        if not self.coverage:
            return np.ones(codes.shape, np.float32)
        return codes.astype(np.float32) / np.float32(255)

    def constants(self, series: ArrayLike) -> NDArray[np.float64]:
        """Return the colours (..., channels, 3) by which channels count under a light.

        series : (..., bands^2, 3), the light as maths.hemispherical_lights projects it.
        """
        light = np.asarray(series, np.float64)
        return np.asarray(np.einsum("...jc,kjc->...kc", light, self.components))

    def save(self, folder: Path) -> None:
        """Write `dome.ktx2`, `components.json` and `report.json` into an existing folder."""
        ktx2.write(Path(folder) / NAME, ktx2.Texture(self.levels, "array"))
        text = json.dumps(self.components.tolist(), allow_nan=False)
        atomic.write_bytes(Path(folder) / COMPONENTS, text.encode())
        layout = {
            "scales": self.scales,
            "channels": self.channels,
            "space": self.space,
            "coverage": self.coverage,
            "views": self.views,
            "pivot": list(self.pivot),
            **{name: getattr(self, name) for name in _DETAILS},
        }
        data = {"format": FORMAT, "kind": KIND, "layout": layout, "quality": self.quality}
        report.write(folder, data)

    @classmethod
    @report.understood
    def load(cls, folder: Path) -> Dome:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data, path = report.read(folder), Path(folder) / NAME
        if data.get("kind") != KIND or data.get("format") != FORMAT:
            found = f"{data.get('kind')} of format {data.get('format')}"
            raise DamagedError(folder, "kind", found, f"expected format {FORMAT}: {AGAIN}")
        texture = ktx2.decode(_bytes(folder, NAME, ktx2.MAX_BYTES), str(path))
        series = strict_json(_bytes(folder, COMPONENTS, MAX_JSON_BYTES), path.parent / COMPONENTS)
        try:
            dome = cls(
                levels=texture.levels,
                components=np.asarray(series, np.float64),
                quality=dict(data["quality"]),
                **_read_layout(data["layout"]),
            )
            whole = dome.components.ndim == 3 and dome.scales.shape[1:] == (4,)
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise DamagedError(folder, "layout", str(error), AGAIN) from error
        if not whole or texture.levels[0].dtype != np.uint8:
            raise DamagedError(path, "texture", "components or codes of another shape", AGAIN)
        count, wanted = len(dome.levels[0]), planes_of(dome.channels, dome.coverage)
        if dome.planes != wanted or count != dome.views * wanted:
            found = f"{count} layers of {dome.views} views of {dome.planes} planes"
            raise DamagedError(path, "texture", found, AGAIN)
        return dome

    def _codes(self, level: int, view: int) -> NDArray[np.uint8]:
        return self.levels[level][view * self.planes : (view + 1) * self.planes]


def _read_layout(layout: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a dome that its report holds."""
    return {
        "scales": np.asarray(layout["scales"], np.float32),
        "space": str(layout["space"]),
        "coverage": bool(layout["coverage"]),
        "views": int(layout["views"]),
        "pivot": (float(layout["pivot"][0]), float(layout["pivot"][1])),
        **{name: float(layout[name]) for name in _DETAILS},
    }


def _bytes(folder: Path, name: str, limit: int) -> bytes:
    """Read a file of a folder, verified where it is sealed."""
    if seal.is_sealed(folder):
        return seal.read_bytes(folder, name)
    return read_bytes(Path(folder) / name, limit)


def slots(channels: int, coverage: bool) -> NDArray[np.int64]:
    """Return the place of each channel, 4 * plane + slot: in order, around coverage in slot 3.

    >>> slots(5, True).tolist(), slots(5, False).tolist()
    ([0, 1, 2, 4, 5], [0, 1, 2, 3, 4])
    """
    order = np.arange(channels)
    return order + (order >= 3) if coverage else order


def planes_of(channels: int, coverage: bool) -> int:
    """Return the number of RGBA planes that channels and coverage take.

    >>> planes_of(15, True), planes_of(16, False), planes_of(16, True)
    (4, 4, 5)
    """
    return -(-(channels + coverage) // 4)


def placed(channels: NDArray[np.floating[Any]], alpha: NDArray[Any] | None) -> Float:
    """Lay premultiplied channels (h, w, n) and coverage (h, w), if any, in planes (P, h, w, 4)."""
    height, width, count = channels.shape
    filled = np.zeros((height, width, 4 * planes_of(count, alpha is not None)), np.float32)
    filled[..., slots(count, alpha is not None)] = channels
    if alpha is not None:
        filled[..., 3] = alpha
    return np.ascontiguousarray(np.moveaxis(filled.reshape(height, width, -1, 4), 2, 0))


def encode(
    levels: tuple[Float, ...], planes: int, coverage: bool
) -> tuple[tuple[NDArray[np.uint8], ...], Float, int]:
    """Quantise levels (views * P, h, w, 4): codes, scales (P, 4), how many values were clipped.

    One scale a plane and slot, of level 0, serves all views and levels. Raises ValueError for
    values that are not finite.
    """
    fine = levels[0].reshape(-1, planes, *levels[0].shape[1:])
    scales = sprite_packing.scales_of(_behind(np.moveaxis(fine, 1, 0)))[1:]
    if coverage:
        scales[0, 3] = 1.0
    coded, clipped = [], 0
    for level in levels:
        by_plane = np.moveaxis(level.reshape(-1, planes, *level.shape[1:]), 1, 0)
        codes, over = sprite_packing.encode(_behind(by_plane), _behind(scales))
        stored = np.moveaxis(codes[1:], 0, 1).reshape(level.shape)
        if coverage:
            alpha = np.clip(level[::planes, ..., 3], 0, 1)
            stored[::planes, ..., 3] = np.floor(alpha * 255 + 0.5)
        coded.append(np.ascontiguousarray(stored))
        clipped += over
    return tuple(coded), scales, clipped


def decode(codes: NDArray[np.uint8], scales: Float, coverage: bool) -> Float:
    """Return the float planes (P, ..., 4) that codes stand for."""
    planes = sprite_packing.decode(_behind(codes), _behind(scales))[1:]
    if coverage:
        planes[0, ..., 3] = codes[0, ..., 3].astype(np.float32) / 255
    return planes


def _behind(planes: NDArray[Any]) -> NDArray[Any]:
    """Put an empty plane in front: the first of a sprite is unsigned, and a dome has none."""
    return np.concatenate([np.zeros_like(planes[:1]), planes])
