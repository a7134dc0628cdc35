"""Tiny sources of every kind, and how each is baked to its end: about a second together."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bake import (
    billboard,
    compress,
    cubes,
    dome,
    dome_renders,
    environment,
    lightmap,
    mesh,
    mips,
    occlusion,
    occlusion_rays,
    photograph_ring,
    picture,
    publish,
    tiles,
    transfer,
    transfer_rays,
    voxels,
)
from bake.lightmap_lights import Lamp
from bake.recipe import Baked, Entry, Source
from bake.store import Store
from formats import seal
from formats.environment import Environment
from formats.files import image, rgbe, vox
from formats.mesh import Mesh
from formats.occlusion import Occlusion, OcclusionHarmonics
from formats.picture import Picture
from formats.voxels import Voxels
from pipelines import bake_sprites
from pipelines.bake_scene import bake_scene
from pipelines.bake_sprites import Sprite, Step, dome_of_mesh, dome_step, mesh_source
from pipelines.deliver import deliver
from tests.bake.small_meshes import sphere_arrays
from tests.formats import vox_bytes

SCENE = """
format = 1
quality = "draft"
[camera]
position = [0, 1, 5]
target = [0, 0.5, 0]
[[lights]]
type = "sun"
to_light = [0.5, 0.6, 0.7]
irradiance = [3, 3, {blue}]
[[lights]]
type = "environment"
source = "sky.hdr"
[[billboards]]
name = "shrub"
source = "blob.obj"
height = 1.0
resolution = {resolution}
samples = 2
positions = [[0, 0, 0], [1, 0, -2]]
[[meshes]]
name = "stone"
source = "blob.obj"
position = [2, 0, -1]
"""
UNSEALED = ("timings.json", ".syntax.json")


@dataclass(frozen=True)
class Subject:
    """name : of what is baked. bake : bakes it in a store, returns its entry. scene : a scene file
    instead, which is baked whole."""

    name: str
    bake: Callable[[Store], Entry]
    scene: Path | None = None

    def run(self, build: Path, **store: Any) -> None:
        """Bake into build/store and deliver to build/scenes, as the program does."""
        if self.scene is not None:
            bake_scene(self.scene, root=self.scene.parent, build_folder=build)
            return
        entry = self.bake(Store(build / "store", **store))
        deliver(entry.path, build / "scenes" / self.name)

    def place_old(self, build: Path) -> None:
        """Put a baked folder of last week where the new one will be delivered."""
        folder = build / "scenes" / self.name
        folder.mkdir(parents=True)
        name = "report.json" if self.scene is None else "manifest.json"
        (folder / name).write_text('{"old": true}')
        seal.seal(folder)


def write_sources(folder: Path, size: int = 1) -> None:
    """Write every source file. size : 1, or a factor on pictures for proofs that need texels."""
    folder.mkdir(parents=True)
    for name, lumps in (("blob", 0.25), ("ball", 0.0)):
        points, faces = sphere_arrays(8, 12)
        x, y, z = points.T
        radius = 1 + lumps * (np.sin(3 * x + 1) * np.cos(2 * y) + 0.5 * z * x + 0.3 * y)
        lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in points * radius[:, None]]
        lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
        (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
    rng = np.random.default_rng(8)
    image.write(folder / "leaf.png", rng.integers(0, 256, (20 * size, 16 * size, 4), np.uint8))
    rgbe.write(folder / "sky.hdr", rng.random((8, 16, 3), np.float32))
    _write_photographs(folder, 10 * size)
    cells = [(x, y, z, 1 + (x + y + z) % 3) for x in range(5) for y in range(4) for z in range(3)]
    palette = vox_bytes.colours((200, 90, 60), (40, 160, 80), (120, 120, 120))
    kept = [cell for cell in cells if sum(cell[:3]) % 4]
    (folder / "pile.vox").write_bytes(vox_bytes.whole(vox_bytes.model((5, 4, 3), kept), palette))
    for name, resolution, blue in (("scene", 16, 3), ("other", 12, 2)):
        (folder / f"{name}.toml").write_text(SCENE.format(resolution=resolution, blue=blue))


def use_small_tiles() -> None:
    """Let stages share their work out in a few tiles and keep each as soon as it is finished."""
    tiles.EVERY, tiles.PRICE = 0.0, 0
    billboard.TILE, dome_renders.TILE = 24, 12
    occlusion_rays.TILE, transfer_rays.TILE = 1024, 512


def _write_photographs(folder: Path, side: int) -> None:
    """A bowl with a ripple under 10 lights at 30 degrees and 7 at 60, and their .lp file."""
    x, y = np.meshgrid(*[(np.arange(side) + 0.5) / side - 0.5] * 2)
    normal = np.stack([x + 0.2 * np.sin(9 * y), -y + 0.1 * np.cos(7 * x), np.ones_like(x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    lines = []
    for count, elevation in ((10, 30), (7, 60)):
        for n in range(count):
            turn, up = 2 * np.pi * (n + 0.1) / count, np.radians(elevation)
            light = np.array([np.cos(turn) * np.cos(up), np.sin(turn) * np.cos(up), np.sin(up)])
            shade = np.maximum(normal @ light, 0)[..., None] * [0.9, 0.6, 0.4]
            lines.append(f"{elevation}_{n}.png " + " ".join(f"{v:.6f}" for v in light))
            image.write(folder / f"{elevation}_{n}.png", (shade * 255).round().astype(np.uint8))
    (folder / "bowl.lp").write_text(f"{len(lines)}\n" + "\n".join(lines) + "\n")


def subjects(folder: Path, size: int = 1, mesh_name: str = "blob") -> dict[str, Subject]:
    """Return how each kind is baked from the sources of `folder`, by name."""
    shape = mesh_source(folder / f"{mesh_name}.obj")
    shots = bake_sprites.photographs_source(folder / "bowl.lp")
    trace = billboard.Params(
        resolution=12 * size, samples=2, lights=16, held_out=2, transmission=0.0
    )
    render = dome_renders.Params(resolution=8 * size, samples=2, lights=12)
    ring = photograph_ring.Params()
    pack, fit = mips.Params(max_lod=2.0), dome.Params(bands=3, penalty=0.01, channels=8)
    covered = dome.Params(bands=3, penalty=0.01, channels=8, coverage=True, max_lod=1.0)
    rays = occlusion.Params(grid=6 * min(size, 6), l_max=2, rays=64, proof=4)
    traced = Step(occlusion.trace, rays, OcclusionHarmonics.load)
    given = transfer.Params(l_max=2, rays=16, bounces=1, edge=0.25 / size, components=8)
    leaf = folder / "leaf.png"
    drawn = Source((leaf,), partial(picture.load, leaf))
    prepared = picture.Params(width=16 * size, height=20 * size, max_lod=1.0)
    sprites = {
        "ring": Sprite(shape, bake_sprites.ring_of_mesh(trace, pack)),
        "dome": Sprite(shape, dome_of_mesh(render, covered)),
        "picture": Sprite(drawn, (Step(picture.prepare, prepared, Picture.load),)),
        "occlusion": Sprite(shape, (traced, _compressed("talk", size))),
        "occlusion in bands": Sprite(shape, (traced, _compressed("bands", size))),
        "transfer": Sprite(shape, (Step(transfer.trace, given, None),)),
        "mesh": Sprite(shape, (Step(mesh.prepare, mesh.Params(), Mesh.load),)),
        "voxels": Sprite(*_pile(folder)),
        "voxels of a mesh": Sprite(
            shape, (Step(voxels.from_mesh, voxels.MeshParams(8 * size, True, ()), Voxels.load),)
        ),
        "environment": Sprite(*_sky(folder)),
        "photographs": Sprite(shots, (dome_step(fit),)),
        "ring of photographs": Sprite(shots, bake_sprites.ring_of_photographs(ring, pack)),
    }
    found = {
        name: Subject(name, partial(_bake_sprite, sprite=sprite))
        for name, sprite in sprites.items()
    }
    found["lightmap"] = Subject("lightmap", partial(_lightmap, folder=folder, size=size))
    found["cubes"] = Subject("cubes", partial(_cubes, folder=folder, size=size))
    found["scene"] = Subject("scene", lambda store: _nothing(), folder / "scene.toml")
    return found


def _bake_sprite(store: Store, sprite: Sprite) -> Entry:
    return bake_sprites.bake(store, sprite)


def _nothing() -> Entry:
    raise TypeError("a scene is baked whole")


def _compressed(encoding: str, size: int) -> Step:
    params = compress.Params(encoding, size=8 * size**2)
    return Step(compress.compress, params, Occlusion.load)


def _pile(folder: Path) -> tuple[Source[Any], tuple[Step, ...]]:
    path = folder / "pile.vox"
    params = voxels.Params(0.5, 1.0, (("1", (5.0, 4.0, 2.0)),))
    return Source((path,), partial(vox.read, path)), (Step(voxels.from_vox, params, Voxels.load),)


def _sky(folder: Path) -> tuple[Source[Any], tuple[Step, ...]]:
    path = folder / "sky.hdr"
    step = Step(environment.resample, environment.Params(width=16), Environment.load)
    return Source((path,), partial(environment.load, path)), (step,)


def _lightmap(store: Store, folder: Path, size: int) -> Entry:
    params = lightmap.Params(texels=2 * min(size, 8), rays=32, bounces=1, target=0.0)
    return store.run(lightmap.light, *_world(store, folder), params=params)


def _cubes(store: Store, folder: Path, size: int) -> Entry:
    """The same world with a lamp in it and two lights by it."""
    params = cubes.Params(
        position=(0.0, 0.0, 0.0),
        environments=(((1.0, 0.9, 0.8), 0.5),),
        lamps=(((0.5, 2.5, 0.5), (9.0, 6.0, 3.0), 1),),
        lights=(
            Lamp("sun", (2.0, 2.0, 1.5), (0.6, 0.8, 0.0), 0.01),
            Lamp("sphere", (20.0, 10.0, 5.0), (3.0, 3.0, 2.0), 0.2),
        ),
        reaches=(),
        texels=2 * min(size, 8),
        rays=16,
        bounces=1,
        target=0.0,
    )
    return store.run(cubes.light, *_world(store, folder), params=params)


def _world(store: Store, folder: Path) -> tuple[Baked[Any], ...]:
    return (
        Baked(bake_sprites.bake(store, Sprite(*_pile(folder))), Voxels.load),
        Baked(bake_sprites.bake(store, Sprite(*_sky(folder))), Environment.load),
    )


def tree(folder: Path) -> dict[str, str]:
    """SHA-256 of every file below a build folder but locks, times and finished tiles, by name."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in UNSEALED and not _aside(path)
    }


def _aside(path: Path) -> bool:
    return any(part == ".locks" or part.startswith(publish.TILES) for part in path.parts)


def leftovers(build: Path) -> list[Path]:
    """Unfinished and set-aside names anywhere in a build folder."""
    return sorted(path for path in build.rglob(".*-*") if path.name.startswith((".tmp-", ".bad-")))


def unfinished(build: Path) -> list[Path]:
    """Folders of finished tiles, whose bake is not."""
    return sorted((build / "store").glob(f"{publish.TILES}*"))
