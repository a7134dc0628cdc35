"""The sprites of a scene on the card: one texture array a set, and where every sprite stands."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report
from formats.billboard import Billboard
from formats.errors import InputError
from runtime import lighting, upload
from runtime.sprite_shadows import coarse_coverage

Array = NDArray[np.float64]
PACKINGS = {"full": 0, "chroma": 1, "talk": 2, "dome": 3}


@dataclass(eq=False)
class SpriteSet:
    """One set: asset, texture and instances.

    asset : formats.billboard.Billboard or formats.dome.Dome. series : how it counts light, see
    runtime.lighting. scale : (n,) factor on the asset's metres per texel. boxes : (levels, 4)
    texture coordinates of what is not empty at this level or a finer one, edges of the bilinear
    filter included.
    foot, crown : half widths, metres at scale 1, near the ground point and of the whole object.
    cover : mean coverage inside the object's own box. coarse, coarse_texel : coverage (h, w) at a
    coarse level and metres of its texel, for shadows on other sprites.
    """

    name: str
    asset: Any
    series: Any
    texture: Any
    positions: Array
    scale: Array
    yaw: Array
    flip: NDArray[np.bool_]
    tint: Array
    shadow: bool
    boxes: Array
    foot: float
    crown: float
    cover: float
    coarse: Array
    coarse_texel: float

    @property
    def centres(self) -> Array:
        """(n, 3) middle of the objects, metres."""
        return (
            self.positions + np.array([0.0, 0.5, 0.0]) * (self.asset.height * self.scale)[:, None]
        )

    @property
    def defines(self) -> dict[str, int]:
        """How the shader unpacks this set."""
        asset = self.asset
        if is_dome(asset):
            packing = PACKINGS["dome"]
            return {"TERMS": asset.channels, "PLANES": asset.planes, "PACKING": packing}
        simple = asset.packing == "full" or asset.ring.terms < 5
        packing = PACKINGS["full" if simple else asset.unpack]
        return {"TERMS": asset.ring.terms, "PLANES": asset.planes, "PACKING": packing}

    def view_from(self, azimuth: Array) -> NDArray[np.int64]:
        """Return the view (n,) nearest to azimuths (n,) about +y, radians, as seen from here."""
        step = 2 * np.pi / self.asset.views
        return np.rint((azimuth - self.yaw) / step).astype(np.int64) % self.asset.views

    def decoding(self) -> tuple[bytes, bytes]:
        """Return (scale, offset) as float32 bytes, (P, 4) each: see `decoding`."""
        scale, offset = decoding(self.asset)
        return scale.astype("f4").tobytes(), offset.astype("f4").tobytes()


def decoding(asset: Any) -> tuple[Array, Array]:
    """Return (scale, offset), (P, 4) each: value = texel as the card reads it * scale + offset."""
    scale = np.array(asset.scales, np.float64)
    offset = np.zeros_like(scale)
    if asset.levels[0].dtype == np.uint8:
        signed = np.ones(scale.shape, bool)
        signed[0] = [True, True, True, False] if is_dome(asset) else False
        # (q - 128) / 127 where the card gives q / 255
        offset[signed] = scale[signed] * (-128 / 127)
        scale[signed] *= 255 / 127
    return scale, offset


def is_dome(asset: Any) -> bool:
    """Whether an asset is a formats.dome.Dome: it has no ring."""
    return not hasattr(asset, "ring")


def read(folder: Path) -> Any:
    """Read the asset of a set, a sprite under a ring or under a dome.

    Raises InputError for a dome without coverage or of stored codes, DamagedError as `load` of
    formats.billboard and formats.dome.
    """
    if report.read(folder).get("kind") != "dome":
        return Billboard.load(folder)
    asset = import_module("formats.dome").Dome.load(folder)
    if not asset.coverage:
        raise InputError(folder, "coverage", "none", "bake it as a billboard of a scene")
    if asset.space != "linear":
        raise InputError(folder, "space", asset.space, "light adds up in linear space: use linear")
    return asset


def load(ctx: Any, frame: Any, billboards: Any, asset: Any) -> SpriteSet:
    """Upload the asset of one set of the scene and place its instances."""
    instances = billboards.instances()
    texture = upload.texture_array(ctx, asset.levels, f"billboard/{billboards.name}")
    frame.adopt(texture, upload.byte_count(asset.levels))
    factor = billboards.height / asset.height
    foot, crown, cover = outline(asset)
    coarse, coarse_texel = coarse_coverage(asset)
    return SpriteSet(
        name=billboards.name,
        asset=asset,
        series=series_of(asset),
        texture=texture,
        positions=np.asarray(instances.positions, np.float64),
        scale=np.asarray(instances.scale, np.float64) * factor,
        yaw=np.asarray(instances.yaw, np.float64),
        flip=np.asarray(instances.flip, bool),
        tint=np.asarray(instances.tint, np.float64),
        shadow=billboards.shadow,
        boxes=boxes(asset.levels, asset.planes),
        foot=foot,
        crown=crown,
        cover=cover,
        coarse=coarse,
        coarse_texel=coarse_texel,
    )


def series_of(asset: Any) -> Any:
    """Return how an asset counts light; only a dome imports what domes need."""
    if is_dome(asset):
        return import_module("runtime.dome_series").DomeSeries(asset)
    return lighting.RingSeries(asset.ring)


def boxes(levels: Any, planes: int) -> Array:
    """Return (levels, 4) boxes (left, top, right, bottom), 0..1, that hold all coverage.

    Each box holds those of the finer levels too and one texel more for the bilinear filter; a set
    that is empty everywhere gets empty boxes.
    """
    found = np.empty((len(levels), 4))
    grown = np.array([1.0, 1.0, 0.0, 0.0])
    for n, level in enumerate(levels):
        filled = (level[::planes, ..., 3] > 0).any(axis=0)
        h, w = filled.shape
        rows, columns = np.flatnonzero(filled.any(axis=1)), np.flatnonzero(filled.any(axis=0))
        if len(rows):
            box = [columns[0] - 1, rows[0] - 1, columns[-1] + 2, rows[-1] + 2] / np.array(
                [w, h, w, h]
            )
            grown = np.append(np.minimum(grown[:2], box[:2]), np.maximum(grown[2:], box[2:]))
        found[n] = np.clip(grown, 0, 1)
    return np.where(found[:, :1] < found[:, 2:3], found, 0.0)


def outline(asset: Any) -> tuple[float, float, float]:
    """Return (foot, crown, cover): half widths (m) near the ground and overall, mean coverage."""
    cover = asset.levels[0][0, ..., 3].astype(np.float64) * asset.scales[0, 3]
    cover = cover / 255 if asset.levels[0].dtype == np.uint8 else cover
    rows = np.flatnonzero(cover.max(axis=1) > 0.1)
    if not len(rows):
        return 0.0, 0.0, 0.0
    columns = np.flatnonzero(cover.max(axis=0) > 0.1)
    inside = cover[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    low = inside[-max(1, len(inside) // 16) :]
    foot = np.quantile(low.sum(axis=1), 0.75) * asset.metres_per_texel / 2
    return float(foot), len(columns) * asset.metres_per_texel / 2, float(inside.mean())
