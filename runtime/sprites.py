"""The sprites of a scene on the card: textures of their sets, and where every sprite stands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats import report
from formats.errors import InputError
from runtime import upload

Array = NDArray[np.float64]
FAINTEST = 1e-4  # of the brightest texel of a picture
PACKINGS = {"full": 0, "chroma": 1, "talk": 2, "dome": 3, "picture": 4, "disc": 5}


@dataclass(eq=False)
class SpriteSet:
    """One set: asset, texture and instances.

    asset : formats.billboard.Billboard, formats.dome.Dome or formats.picture.Picture. series : how
    it counts light, see runtime.lighting; None for pictures. layer, share : its first layer of the
    texture, and how much of one it fills along x and y. pivot : texels from the top left. roll :
    (n,) radians. opacity : factor on alpha, one or (n,). upright : or facing the camera. middle :
    of the object over its place, in heights. moving : filled anew for each moment. scale : (n,)
    factor on the asset's metres per texel. boxes : (levels, 4) texture coordinates of what is not
    empty at this level or a finer one, edges of the bilinear filter included.
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
    roll: Array
    pivot: tuple[float, float]
    layer: int = 0
    share: tuple[float, float] = (1.0, 1.0)
    opacity: Any = 1.0
    softness: float = 0.0
    upright: bool = True
    middle: float = 0.5
    moving: bool = False
    foot: float = 0.0
    crown: float = 0.0
    cover: float = 0.0
    coarse: Any = None
    coarse_texel: float = 1.0

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def centres(self) -> Array:
        """(n, 3) middle of the objects, metres."""
        if not self.middle:
            return self.positions
        up = np.array([0.0, self.middle, 0.0])
        return self.positions + up * (self.asset.height * self.scale)[:, None]

    @property
    def defines(self) -> dict[str, int]:
        """How the shader unpacks this set."""
        asset = self.asset
        if self.series is None:
            packing = PACKINGS["disc" if self.texture is None else "picture"]
            return {"TERMS": 0, "PLANES": 1, "PACKING": packing}
        if is_dome(asset):
            packing = PACKINGS["dome"]
            return {"TERMS": asset.channels, "PLANES": asset.planes, "PACKING": packing}
        simple = asset.packing == "full" or asset.ring.terms < 5
        packing = PACKINGS["full" if simple else asset.unpack]
        return {"TERMS": asset.ring.terms, "PLANES": asset.planes, "PACKING": packing}

    def view_from(self, azimuth: Array, which: Any = slice(None)) -> NDArray[np.int64]:
        """Return the view (n,) nearest to azimuths (n,) about +y, radians, as seen from here.

        which : of the sprites, all where it is left out.
        """
        step = 2 * np.pi / self.asset.views
        return np.rint((azimuth - self.yaw[which]) / step).astype(np.int64) % self.asset.views

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
    """Whether an asset is a formats.dome.Dome: it has components."""
    return hasattr(asset, "components")


def is_picture(asset: Any) -> bool:
    """Whether an asset is a formats.picture.Picture: it has neither ring nor components."""
    return not is_dome(asset) and not hasattr(asset, "ring")


def read(folder: Path) -> Any:
    """Read the asset of a set, a sprite under a ring or under a dome, or a picture.

    Raises InputError for a dome without coverage or of stored codes, DamagedError as `load` of
    formats.billboard, formats.dome and formats.picture.
    """
    kind = report.read(folder).get("kind")
    if kind == "picture":
        return import_module("formats.picture").Picture.load(folder)
    if kind != "dome":
        return trimmed(import_module("formats.billboard").Billboard.load(folder))
    asset = import_module("formats.dome").Dome.load(folder)
    if not asset.coverage:
        raise InputError(folder, "coverage", "none", "bake it as a billboard of a scene")
    if asset.space != "linear":
        raise InputError(folder, "space", asset.space, "light adds up in linear space: use linear")
    return trimmed(asset)


def trimmed(asset: Any) -> Any:
    """Return an asset without the outer part of its border that no level shows anything in.

    Borders are made for the coarsest level, whose texels are many of level 0.
    """
    width, height = asset.size
    unit = 1 << (len(asset.levels) - 1)
    left, top, right, bottom = boxes(asset.levels, asset.planes)[-1]
    if width % unit or height % unit or right <= left:
        return asset
    # Whole texels of the coarsest level: all levels keep theirs
    x, y = int(left * width) // unit * unit, int(top * height) // unit * unit
    w = -(-round(right * width) // unit) * unit - x
    h = -(-round(bottom * height) // unit) * unit - y
    levels = tuple(
        np.ascontiguousarray(level[:, y >> n : (y + h) >> n, x >> n : (x + w) >> n])
        for n, level in enumerate(asset.levels)
    )
    return replace(asset, levels=levels, pivot=(asset.pivot[0] - x, asset.pivot[1] - y))


def load(ctx: Any, frame: Any, groups: list[tuple[Any, Any]]) -> list[SpriteSet]:
    """Upload the assets of sets of the scene, (billboards, asset) each, and place their instances.

    Pictures of several sets share textures.
    """
    found: list[SpriteSet | None] = [None] * len(groups)
    pictures = [i for i, (_, asset) in enumerate(groups) if is_picture(asset)]
    if pictures:
        from runtime.sprite_sheets import sheets

        for sheet in sheets([groups[i][1] for i in pictures]):
            texture = upload.texture_array(ctx, sheet.levels, "billboard/pictures")
            frame.adopt(texture, upload.byte_count(sheet.levels))
            h, w = sheet.levels[0].shape[1:3]
            for layer, member in enumerate(sheet.members):
                billboards, asset = groups[pictures[member]]
                made = _placed(billboards, asset, texture)
                made.layer, made.share = layer, (asset.size[0] / w, asset.size[1] / h)
                found[pictures[member]] = made
    for i, (billboards, asset) in enumerate(groups):
        if found[i] is None:
            texture = upload.texture_array(ctx, asset.levels, f"billboard/{billboards.name}")
            frame.adopt(texture, upload.byte_count(asset.levels))
            found[i] = _placed(billboards, asset, texture)
    return [each for each in found if each is not None]


def _placed(billboards: Any, asset: Any, texture: Any) -> SpriteSet:
    instances = billboards.instances()
    factor = billboards.height / asset.height
    pictured = is_picture(asset)
    pivot = asset.pivot
    if not billboards.stands:
        pivot = (pivot[0], pivot[1] - 0.5 * asset.height / asset.metres_per_texel)
    tint = np.asarray(instances.tint, np.float64)
    more: dict[str, Any] = {}
    around = boxes(asset.levels, asset.planes, *_shows(asset))
    if pictured:
        more["crown"] = (around[0, 2] - around[0, 0]) * asset.size[0] * asset.metres_per_texel / 2
    else:
        from runtime.sprite_shadows import coarse_coverage

        more["foot"], more["crown"], more["cover"] = outline(asset)
        more["coarse"], more["coarse_texel"] = coarse_coverage(asset)
    return SpriteSet(
        name=billboards.name,
        asset=asset,
        series=None if pictured else series_of(asset),
        texture=texture,
        positions=np.asarray(instances.positions, np.float64),
        scale=np.asarray(instances.scale, np.float64) * factor,
        yaw=np.asarray(instances.yaw, np.float64),
        flip=np.asarray(instances.flip, bool),
        tint=tint * billboards.radiance if pictured else tint,
        shadow=billboards.shadow,
        boxes=around,
        roll=np.asarray(instances.roll, np.float64),
        pivot=pivot,
        opacity=billboards.opacity,
        softness=billboards.softness,
        upright=billboards.stands,
        middle=0.5 * billboards.stands,
        **more,
    )


def _shows(asset: Any) -> tuple[slice, float]:
    """Return which channels say where an asset shows, and by more than how much."""
    if not is_picture(asset):
        return slice(3, 4), 0.0
    # A picture without alpha shows too; the filter's faint ends do not
    return slice(0, 4), FAINTEST * max(1.0, asset.brightest)


def series_of(asset: Any) -> Any:
    """Return how an asset counts light; only a dome imports what domes need."""
    if is_dome(asset):
        return import_module("runtime.dome_series").DomeSeries(asset)
    from runtime.lighting import RingSeries

    return RingSeries(asset.ring)


def boxes(levels: Any, planes: int, channels: slice = slice(3, 4), least: float = 0.0) -> Array:
    """Return (levels, 4) boxes (left, top, right, bottom), 0..1, that hold all coverage.

    channels : of the first plane, one of which is over `least` where something shows.
    Each box holds those of the finer levels too and one texel more for the bilinear filter; a set
    that is empty everywhere gets empty boxes.
    """
    found = np.empty((len(levels), 4))
    grown = np.array([1.0, 1.0, 0.0, 0.0])
    for n, level in enumerate(levels):
        filled = (level[::planes, ..., channels] > least).any(axis=(0, 3))
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
