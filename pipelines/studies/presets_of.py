"""What the study `presets` bakes: each kind as each preset has it, and with knobs beside."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import billboard, compress, dome, lightmap, mips, occlusion, reference_film, transfer
from bake.rays import RayScene
from bake.shading import Surface
from bake.store import Store
from formats import scene as scenes
from formats.sprites import QUALITIES
from maths import circular_harmonics, sprite_packing
from maths.price import Estimate, relative_rms
from pipelines import bake_scene, bake_sprites, price_sprites
from pipelines import lightmap as lightmap_bakes
from pipelines.bake_cubes import RAYS
from pipelines.price import Subject
from pipelines.price_dome import PhotographsAsset
from pipelines.price_lightmap import of_inputs
from pipelines.price_occlusion import OcclusionAsset
from pipelines.price_sprites import AZIMUTHS
from pipelines.price_transfer import TransferAsset
from pipelines.studies.interval import blocks
from pipelines.studies.subjects import MESHES, Setting
from runtime.player import Player

Array = NDArray[np.float64]
ASSETS = MESHES.parent
SCREEN = 512  # pixels that a sprite is high on the screen
SPANS = 160  # of pixels that are rendered
GROVE = ASSETS / "scenes" / "grove.toml"
PICTURE, NOON, SHARE = (480, 270), 12.0, 0.25
OPEN = {"samples"}  # of a set in the scene, beside its lights and terms
RTI = "rti/neural_rti/exampledataset/dirs.lp"


@dataclass(frozen=True)
class Tried:
    """A bake. preset : whose knobs they are, "" for none's."""

    subject: str
    knobs: str
    preset: str
    error: Estimate
    seconds: float
    bytes: int


def mesh_file(name: str) -> Path:
    """Return a mesh of ours."""
    return MESHES / f"{name}.glb"


def preset(quality: str, **table: Any) -> scenes.Scene:
    """Return a scene of nothing but a table, as a quality completes it."""
    camera = {"position": [0, 1, 5], "target": [0, 1, 0]}
    raw = {"format": 1, "quality": quality, "camera": camera, **table}
    return scenes.from_dict(raw, where="preset.toml", root=None)


def qualities(setting: Setting) -> tuple[str, ...]:
    """Return the presets of a run, cheapest first."""
    return QUALITIES[: setting.pick(2, 4)]


def by_price(
    subject: Subject, name: str, knobs: dict[str, Any], quality: str, size: int = 0
) -> Tried:
    """Bake an asset with these knobs from nothing, and check it as asking by price does. size : its
    bytes, where they are not those of its files."""
    with TemporaryDirectory() as room:
        store = Store(Path(room))
        begun = process_time()
        entry = subject.bake(store, knobs, None)
        spent = process_time() - begun
        told = ", ".join(f"{value:g} {knob}" for knob, value in knobs.items())
        size = size or bytes_in(entry.path)
        return Tried(name, told, quality, subject.reached(store, knobs), spent, size)


def bytes_in(folder: Path) -> int:
    """Return the bytes of an asset's files but for what only tells of it."""
    return sum(f.stat().st_size for f in folder.rglob("*") if f.suffix in (".ktx2", ".glb"))


def shadows(file: Path, setting: Setting) -> Iterator[Tried]:
    """Bake a mesh's shadow volume."""
    subject = OcclusionAsset(file, occlusion.Params(), compress.Params())
    for quality in qualities(setting):
        mesh = {"name": "a", "source": "a.glb", "shadow": {}}
        shadow = preset(quality, meshes=[mesh]).meshes[0].shadow
        assert shadow is not None
        knobs = {"rays": shadow.rays, "l_max": shadow.l_max, "components": shadow.components}
        for rays in (shadow.rays // 4, shadow.rays, 4 * shadow.rays):
            if rays >= shadow.harmonics:
                name = quality if rays == shadow.rays else ""
                given = knobs | {"rays": rays}
                yield by_price(subject, f"{file.stem}, shadow", given, name, shadow.bytes)


def transfers(file: Path, setting: Setting) -> Iterator[Tried]:
    """Bake what vertices make of light."""
    subject = TransferAsset(file, transfer.Params())
    for quality in qualities(setting):
        mesh = {"name": "a", "source": "a.glb", "lighting": "transfer"}
        own = preset(quality, meshes=[mesh]).meshes[0].transfer
        knobs = {"rays": own.rays, "l_max": own.l_max, "components": own.components}
        yield by_price(subject, f"{file.stem}, transfer", knobs, quality)


def photographs(setting: Setting) -> Iterator[Tried]:
    """Fit photographs: other people's where they are, else ours."""
    given = Path(os.environ.get("BAKELIGHT_DATA", "none")) / RTI
    file = given if given.is_file() else ASSETS / "photographs/ammonite/lights.lp"
    for quality in qualities(setting):
        group = {"name": "a", "source": "a.lp", "height": 1, "positions": [[0, 0, 0]]}
        own = preset(quality, billboards=[group]).billboards[0].dome
        assert own is not None
        subject = PhotographsAsset(file, "linear", dome.Params(), free=False)
        subject.fit = replace(subject.fit, held_out=subject.held())
        name = f"{file.parent.name}, photographs"
        yield by_price(subject, name, {"channels": own.channels}, quality)


def lightmaps(setting: Setting) -> Iterator[Tried]:
    """Light a world of cubes."""
    with TemporaryDirectory() as room:
        store = Store(Path(room))
        sky = lightmap_bakes.sky(store, ASSETS / "environments" / "soft_sky.hdr")
        file = ASSETS / "voxels" / "courtyard.vox"
        cells = lightmap_bakes.world(store, file, (), cell_size=None, grid=None)
        for quality in qualities(setting):
            own = preset(quality, voxels={"source": "a.vox"}).voxels
            assert own is not None
            params = lightmap.Params(texels=1, target=own.error, bounces=own.bounces)
            subject = of_inputs("courtyard", [cells, sky], params, stops=True)
            knobs = {"rays": RAYS[quality]}
            yield by_price(subject, "courtyard, lightmap", knobs, quality)


def sprites(file: Path, setting: Setting) -> Iterator[Tried]:
    """Bake a sprite, and look at it on the screen."""
    screen = Screen(file, setting.pick(128, SCREEN))
    for quality in qualities(setting):
        group = {"name": "a", "source": "a.glb", "height": 1, "positions": [[0, 0, 0]]}
        found = preset(quality, billboards=[group]).billboards[0]
        assert found.ring is not None
        own = billboard.Params(
            resolution=found.resolution // setting.pick(4, 1), samples=found.samples,
            lights=found.ring.lights, terms=found.ring.terms,
        )  # fmt: skip
        yield screen.tried(own, quality)
        if quality != "reference":
            for samples in {max(1, own.samples // 4), own.samples * 4}:
                yield screen.tried(replace(own, samples=samples), "")


class Screen:
    """Renders of a mesh as it stands on the screen, and sprites of it held against them."""

    def __init__(self, file: Path, height: int) -> None:
        self.mesh = bake_sprites.mesh_source(file).load()
        self.name, self.height = f"{file.stem}, sprite", height
        params = billboard.Params(resolution=height)
        surface = Surface(
            self.mesh, RayScene(self.mesh.vertices, self.mesh.faces), params.transmission,
            params.gloss,
        )  # fmt: skip
        self.frame = billboard.frame_of(self.mesh, params)
        self.truth = price_sprites.truth_of(surface, self.frame, params, spans=SPANS)[0]

    def tried(self, params: billboard.Params, quality: str) -> Tried:
        """Bake a sprite and hold it against the renders."""
        pack = mips.Params()
        begun = process_time()
        board = mips.pack(billboard.trace(self.mesh, params=params), params=pack)
        spent = process_time() - begun
        own = billboard.frame_of(self.mesh, params)
        # As drawn: smoothly between texels, from the level whose texels are a pixel or less
        level = max(0, round(float(np.log2(params.resolution / self.height))))
        row, column = self.truth.texels(self.frame.width, 0)
        step, border = self.frame.metres_per_texel / own.metres_per_texel, mips.border_of(pack)
        right = (self.frame.left - own.left) / own.metres_per_texel + (column + 0.5) * step
        down = (own.top - self.frame.top) / own.metres_per_texel + (row + 0.5) * step
        planes = mips.decoded(board, level=level, view=0)
        seen = bilinear(planes, *((v + border) / 2**level - 0.5 for v in (down, right)))
        terms = sprite_packing.unpack(seen, params.terms, pack.packing, pack.unpack)
        basis = circular_harmonics.evaluate(np.asarray(AZIMUTHS), params.terms)
        relit = np.maximum(np.einsum("knwc,mk->mnwc", terms, basis), 0)
        truth = self.truth.radiance.astype(np.float64)
        errors, wholes = (np.mean(np.square(v), axis=(0, 2, 3)) for v in (relit - truth, truth))
        told = (
            f"{params.resolution} texels, {params.samples} samples, {params.lights} lights, "
            f"{params.terms} terms"
        )
        size = sum(layer.nbytes for layer in board.levels)
        return Tried(self.name, told, quality, relative_rms(errors, wholes), spent, size)


def bilinear(planes: NDArray[np.floating[Any]], row: Array, column: Array) -> Array:
    """Look up planes (p, h, w, 4) at places counted from the middle of the first texel."""
    height, width = planes.shape[1:3]
    row, column = np.clip(row, 0, height - 1.001), np.clip(column, 0, width - 1.001)
    i, j = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    y, x = (row - i)[None, ..., None], (column - j)[None, ..., None]
    upper = planes[:, i, j] * (1 - x) + planes[:, i, j + 1] * x
    lower = planes[:, i + 1, j] * (1 - x) + planes[:, i + 1, j + 1] * x
    return np.asarray(upper * (1 - y) + lower * y)


def scene(setting: Setting) -> Iterator[Tried]:
    """Bake the grove, each set with the file's resolution times SHARE."""
    found = {}
    for quality in QUALITIES:
        raw = json.loads(json.dumps(scenes.load(GROVE).raw)) | {"quality": quality}
        for group in raw["billboards"]:
            group["resolution"] = max(16, int(SHARE * group["resolution"]))
            for knob in OPEN & set(group):
                del group[knob]
            for knob in {"lights", "terms"} & set(group.get("ring", {})):
                del group["ring"][knob]
        found[quality] = _picture(raw)
    truth = found["reference"][0]
    whole = blocks(np.mean(np.square(truth), axis=2))
    for quality, (picture, seconds, size) in found.items():
        apart = blocks(np.mean(np.square(picture - truth), axis=2))
        error = relative_rms(apart, whole)
        yield Tried("grove, scene", quality, quality, error, seconds, size)


def _picture(raw: dict[str, Any]) -> tuple[Array, float, int]:
    """Bake a scene from nothing; return its picture at noon, seconds and bytes."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "grove.json")
        path.write_text(json.dumps(raw), encoding="utf-8")
        begun = process_time()
        baked = bake_scene.bake_scene(path, root=ASSETS, build_folder=Path(folder))
        spent = process_time() - begun
        with Player(baked.folder, size=PICTURE) as player:
            linear = player.linear(NOON)[..., :3]
            shown = reference_film.develop(linear, player.scene, NOON)
        return np.asarray(shown, np.float64) / 255, spent, bytes_in(baked.folder)
