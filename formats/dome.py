"""A picture under any light of a dome: sixteen channels in four RGBA8 planes (`dome.ktx2`).

A pixel's answer to a light is a weighted sum of `channels` colours that all pixels share, each a
series of hemispherical harmonics; the weights are what the planes hold, four a plane.
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
from maths import hemispherical_harmonics, sprite_packing

FORMAT = 1
KIND = "dome"
NAME = "dome.ktx2"
COMPONENTS = "components.json"
"""The series of the channels' colours, apart from the report, which people read."""


@dataclass(frozen=True, eq=False)
class Dome:
    """What a camera on +z sees under lights of the hemisphere around it.

    codes : (planes, h, w, 4) uint8, signed codes `(q - 128) / 127`; channel k lies in plane k // 4,
    those past `channels` hold 128. scales : (planes, 4). components : (channels, bands^2, 3), the
    colours as series. space : "linear" radiance, or codes as "stored" in the photographs, 0..1.
    Values are those of photographs under one sun of irradiance pi. quality : of the report.
    """

    codes: NDArray[np.uint8]
    scales: NDArray[np.float32]
    components: NDArray[np.float64]
    space: str
    quality: dict[str, Any] = field(default_factory=dict)

    @property
    def channels(self) -> int:
        """Number of channels in use."""
        return len(self.components)

    def decoded(self) -> NDArray[np.float32]:
        """Return the channels (h, w, channels) that the codes stand for."""
        planes = _decode(self.codes, self.scales)
        return np.moveaxis(planes, 0, 2).reshape(*planes.shape[1:3], -1)[..., : self.channels]

    def constants(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Return the colours (..., channels, 3) by which channels count under a light.

        directions : (..., 3) unit, towards a sun of irradiance pi. A light behind (z < 0) gives 0.
        """
        d = np.asarray(directions, np.float64)
        bands = round(self.components.shape[1] ** 0.5)
        basis = hemispherical_harmonics.evaluate(d, bands)
        front = basis * (d[..., 2:] >= 0)
        return np.asarray(np.einsum("...j,kjc->...kc", front, self.components))

    def save(self, folder: Path) -> None:
        """Write `dome.ktx2`, `components.json` and `report.json` into an existing folder."""
        ktx2.write(Path(folder) / NAME, ktx2.Texture((self.codes,), "array"))
        text = json.dumps(self.components.tolist(), allow_nan=False)
        atomic.write_bytes(Path(folder) / COMPONENTS, text.encode())
        layout = {"scales": self.scales, "channels": self.channels, "space": self.space}
        data = {"format": FORMAT, "kind": KIND, "layout": layout, "quality": self.quality}
        report.write(folder, data)

    @classmethod
    def load(cls, folder: Path) -> Dome:
        """Read a folder that `save` wrote, verified where it is sealed.

        Raises DamagedError where its bytes changed or are of another kind or format.
        """
        data, path = report.read(folder), Path(folder) / NAME
        if data.get("kind") != KIND or data.get("format") != FORMAT:
            found = f"{data.get('kind')} of format {data.get('format')}"
            raise DamagedError(folder, "kind", found, "bake the photographs again")
        texture = ktx2.decode(_bytes(folder, NAME, ktx2.MAX_BYTES), str(path))
        series = strict_json(_bytes(folder, COMPONENTS, MAX_JSON_BYTES), path.parent / COMPONENTS)
        layout, codes = data["layout"], texture.levels[0]
        scales = np.asarray(layout["scales"], np.float32)
        components = np.asarray(series, np.float64)
        if codes.dtype != np.uint8 or len(codes) != len(scales):
            found = f"{len(codes)} planes of {codes.dtype}"
            raise DamagedError(path, "texture", found, "bake the photographs again")
        return cls(codes, scales, components, str(layout["space"]), dict(data["quality"]))


def _bytes(folder: Path, name: str, limit: int) -> bytes:
    """Read a file of a folder, verified where it is sealed."""
    if seal.is_sealed(folder):
        return seal.read_bytes(folder, name)
    return read_bytes(Path(folder) / name, limit)


def coded(channels: NDArray[np.floating[Any]]) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return codes (planes, h, w, 4) and scales (planes, 4) of channels (h, w, n)."""
    height, width, count = channels.shape
    filled = np.zeros((height, width, -(-count // 4) * 4), np.float32)
    filled[..., :count] = channels
    planes = np.moveaxis(filled.reshape(height, width, -1, 4), 2, 0)
    scales = sprite_packing.scales_of(_behind(planes))[1:]
    codes, _ = sprite_packing.encode(_behind(planes), _behind(scales))
    return codes[1:], scales


def _decode(codes: NDArray[np.uint8], scales: NDArray[np.float32]) -> NDArray[np.float32]:
    return sprite_packing.decode(_behind(codes), _behind(scales))[1:]


def _behind(planes: NDArray[Any]) -> NDArray[Any]:
    """Put an empty plane in front: the first of a sprite is unsigned, and a dome has none."""
    return np.concatenate([np.zeros_like(planes[:1]), planes])
