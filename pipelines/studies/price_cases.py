"""Assets for the study `price`: lumps made by chance, meshes and worlds of others, whole scenes."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bake import billboard, compress, dome, dome_renders, lightmap, mips, occlusion, transfer
from bake.store import Store
from formats.errors import BakelightError
from pipelines import lightmap as lightmaps
from pipelines.price import Subject
from pipelines.price_dome import DomeAsset
from pipelines.price_lightmap import of_inputs
from pipelines.price_occlusion import OcclusionAsset
from pipelines.price_sprites import RingAsset
from pipelines.price_transfer import TransferAsset
from pipelines.studies.subjects import MESHES, Setting

GRID, TEXELS, DOME_TEXELS, EDGE = 12, 48, 32, 0.08
LARGER, EVERY = 2, 5  # sides of every fifth mesh, whose bakes are more than fixed costs
MOST_RAYS = 1024  # of a texel of baked light: its error has no floor, and there is no end to rays
BLOBS, OWN, SCENES = 12, 12, 8
MEASURED = ("bust", "oak", "bell", "knot")  # constants of the laws come from studies on these
KINDS = ("occlusion", "ring", "transfer", "occlusion", "ring", "dome")
OUTSIDE = (
    "trimesh/models/Duck.glb", "trimesh/models/monkey.glb", "trimesh/models/rabbit.obj",
    "trimesh/models/teapot.stl", "trimesh/models/fuze.obj", "trimesh/models/boolean.glb",
    "trimesh/models/suzanne.ply", "odedstein/spot/spot_control_mesh.obj",
    "odedstein/spot/spot_low_resolution.obj", "trimesh/models/ballA.off",
    "trimesh/models/target.obj", "trimesh/models/quadknot.obj",
)  # fmt: skip
WORLDS = (
    "mmmm/vox/chr_cop1.vox", "mmmm/vox/chr_hazmat1.vox", "mmmm/vox/obj_street1.vox",
    "opengametools/demo/vox/chr_knight.vox", "opengametools/demo/vox/chr_old.vox",
    "opengametools/demo/vox/chr_rain.vox", "opengametools/demo/vox/chr_sword.vox",
    "vengi/data/tests/crabby.vox", "vengi/data/tests/robo.vox", "vengi/data/tests/rgb.vox",
)  # fmt: skip
SKY = MESHES.parent / "environments" / "soft_sky.hdr"
SCENE = """
format = 1
quality = "draft"

[camera]
position = [0.0, 1.0, 6.0]
target = [0.0, 0.5, 0.0]

[[lights]]
type = "sphere"
position = [{x:.2f}, 3.0, 2.0]
radius = 0.4
radiance = [9.0, 9.0, 9.0]

[ground]
albedo = [0.4, 0.4, 0.4]

[[billboards]]
name = "sprite"
source = "{sprite}"
height = 1.0
resolution = {texels}
positions = [[-1.0, 0.0, 0.0]]
{dome}
"""
MESH = """
[[meshes]]
name = "mesh"
source = "{source}"
position = [1.0, 0.0, 0.0]
{lit}
"""
CUBES = """
[voxels]
source = "{source}"
texels = 1

[[lights]]
type = "environment"
source = "soft_sky.hdr"
"""


@dataclass(frozen=True)
class Case:
    """An asset of one kind."""

    kind: str
    name: str
    subject: Subject


def cases(setting: Setting, room: Path, store: Store) -> Iterator[Case]:
    """List assets, kinds in turn: two of each lump, one of each other mesh; some larger."""
    for n, file in enumerate(files(setting, room)):
        both = setting.source is not None or file.parent == room
        for kind in (KINDS[n % 6], KINDS[(n + 1) % 6])[: 1 + both]:
            yield Case(kind, file.stem, subject_of(kind, file, 1 if n % EVERY else LARGER))
    if setting.source is None:
        yield from worlds(setting, store)


def subject_of(kind: str, file: Path, times: float = 1) -> Subject:
    """Return a small asset of a kind, made from a mesh file. times : how much finer its sides."""
    if kind == "occlusion":
        grid = round(times * GRID)
        return OcclusionAsset(file, occlusion.Params(grid=grid), compress.Params())
    if kind == "ring":
        texels = round(times * TEXELS)
        return RingAsset(file, billboard.Params(resolution=texels), mips.Params(max_lod=1.0))
    if kind == "dome":
        fit = dome.Params(coverage=True, max_lod=1.0, bands=5, penalty=0.1)
        renders = dome_renders.Params(resolution=round(times * DOME_TEXELS))
        return DomeAsset(file, renders, fit, ("samples",))
    return TransferAsset(file, transfer.Params(edge=EDGE / times))


def files(setting: Setting, room: Path) -> Iterator[Path]:
    """List mesh files: the user's own, or lumps, other people's and ours."""
    if setting.source is not None:
        yield setting.source
        return
    for n in range(setting.pick(2, BLOBS)):
        yield blob(room / f"blob_{n}.obj", n)
    data = Path(os.environ.get("BAKELIGHT_DATA", "none")) / "meshes"
    found = [data / name for name in OUTSIDE if (data / name).is_file()]
    ours = [file for file in MESHES.glob("*.glb") if file.stem not in MEASURED]
    yield from found[: setting.pick(1, len(found))]
    yield from sorted(ours, key=lambda file: file.stat().st_size)[: setting.pick(1, OWN)]


def worlds(setting: Setting, store: Store) -> Iterator[Case]:
    """List the baked light of worlds of cubes."""
    sky = lightmaps.sky(store, SKY)
    for file in vox_files()[: setting.pick(1, len(WORLDS))]:
        try:
            cells = lightmaps.world(store, file, (), cell_size=None, grid=None)
        except BakelightError:
            continue
        asset = of_inputs(file.stem, [cells, sky], lightmap.Params(texels=1))
        few = tuple(n for n in asset.rays if n <= MOST_RAYS)
        yield Case("lightmap", file.stem, replace(asset, rays=few))


def vox_files() -> list[Path]:
    """Return those of WORLDS that are there."""
    data = Path(os.environ.get("BAKELIGHT_DATA", "none")) / "vox"
    return [data / name for name in WORLDS if (data / name).is_file()]


def scene_files(setting: Setting, room: Path) -> Iterator[Path]:
    """Write small scenes: each a sprite, and a shadow, a mesh lit by itself, or a world."""
    if setting.source is not None:
        return
    root, given = room / "whole", vox_files()
    (root / "scenes").mkdir(parents=True)
    shutil.copy(SKY, root)
    for n in range(setting.pick(1, SCENES)):
        for part in (2 * n, 2 * n + 1):
            blob(root / f"lump_{part}.obj", 100 + part)
        dome_lit = "dome = { bands = 4, penalty = 0.1, lights = 32 }" if n % 4 == 3 else ""
        text = SCENE.format(
            x=2 - n / 2, sprite=f"lump_{2 * n}.obj", texels=24 if dome_lit else 32, dome=dome_lit
        )
        if n % 4 == 2 and given:
            world = given[n % len(given)]
            shutil.copy(world, root)
            text += CUBES.format(source=world.name)
        else:
            lit = (f"shadow = {{ grid = {GRID} }}", 'lighting = "transfer"\n' +
                   f"transfer = {{ edge = {EDGE} }}")[n % 2]  # fmt: skip
            text += MESH.format(source=f"lump_{2 * n + 1}.obj", lit=lit)
        path = root / "scenes" / f"scene_{n}.toml"
        path.write_text(text)
        yield path


def blob(path: Path, seed: int, around: int = 36, down: int = 18) -> Path:
    """Write a closed lump of waves by chance as an OBJ file; later seeds are rougher."""
    rng = np.random.default_rng(seed)
    polar = np.pi * np.arange(1, down) / down
    turn = 2 * np.pi * np.arange(around) / around
    theta, phi = np.meshgrid(polar, turn, indexing="ij")
    toward = np.stack(
        [np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1
    )
    radius = np.ones(theta.shape)
    for _ in range(6):
        wave = rng.normal(size=3) * rng.uniform(2, 7)
        radius += (0.03 + 0.012 * seed) * np.sin(toward @ wave + rng.uniform(0, 6))
    stretch = rng.uniform(0.4, 1.0, 3)
    points = (np.maximum(radius, 0.2)[..., None] * toward * stretch).reshape(-1, 3)
    points = np.concatenate([points, [[0, stretch[1], 0], [0, -stretch[1], 0]]])
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    for i in range(down - 2):
        for j in range(around):
            a, b = i * around + j + 1, i * around + (j + 1) % around + 1
            lines.append(f"f {a} {b} {b + around} {a + around}")
    top, low, last = len(points) - 1, len(points), (down - 2) * around
    for j in range(around):
        a, b = j + 1, (j + 1) % around + 1
        lines += [f"f {top} {b} {a}", f"f {low} {last + a} {last + b}"]
    path.write_text("\n".join(lines) + "\n")
    return path
