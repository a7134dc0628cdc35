"""How a scene's world of cubes is baked: cells of the world and its parts, then faces and light."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bake import cubes, recipe
from bake.lightmap_lights import Lamp
from bake.recipe import Baked, Entry
from bake.store import Store, seconds_of
from formats import effects
from formats.environment import Environment
from formats.errors import InputError
from formats.lights import Disc, EnvironmentLight, Polygon, Rectangle, Sphere, Sun
from formats.scene import Scene, VoxelWorld
from formats.voxel_state import Place
from formats.voxel_world import VOXELS, last_frame
from formats.voxels import Voxels
from pipelines import bake_sprites

WORLD = "world"
RAYS = {"draft": 256, "balanced": 1024, "fine": 4096, "reference": 16384}
"""Most rays of a texel of baked light, by quality."""
MOST_FRAMES = 1 << 15
"""Of an animation in which parts move."""


def cells(world: VoxelWorld, name: str) -> bake_sprites.Sprite:
    """Return how the cells of the world, or of a part of it, are baked. InputError."""
    # It names the stages for every kind of file
    from pipelines.voxels import chosen

    source = world.source
    if name != WORLD:
        source = next(body.source for body in world.bodies if body.name == name)
    mesh = source.suffix.lower() not in VOXELS
    knobs = {
        "cell_size": None if mesh else world.cell_size,
        "grid": world.grid if mesh else None,
        "emission_scale": 1.0,
        "emissive": tuple(world.emissive.items()) if name == WORLD else (),
        "solid": True,
    }
    given, step = chosen(source, knobs)
    return bake_sprites.Sprite(given, (step,))


def names(world: VoxelWorld) -> tuple[str, ...]:
    """Names of the world and its parts, in order."""
    return WORLD, *(body.name for body in world.bodies)


def light(
    store: Store,
    scene: Scene,
    given: Sequence[recipe.Input],
    lit: bool,
    watch: bake_sprites.Watch | None = None,
) -> Entry:
    """Bake the faces; lit : and their light."""
    return store.run(cubes.light, *given, params=params(scene, lit), on_progress=watch)


def located(store: Store, scene: Scene, given: Sequence[recipe.Input], lit: bool) -> Entry:
    """Return where that entry is or would be, and whether it is there."""
    contents = recipe.of(cubes.light, tuple(given), params(scene, lit))
    key = recipe.key(contents)
    path = store.folder / f"{contents['stage']}-{key}"
    return Entry(path, key, path.is_dir(), seconds_of(path))


def inputs(entries: Sequence[Entry], maps: Sequence[Entry]) -> list[recipe.Input]:
    """Return the inputs of `light`: cells of the world and its parts, then environments."""
    worlds: list[recipe.Input] = [Baked(entry, Voxels.load) for entry in entries]
    return [*worlds, *(Baked(entry, Environment.load) for entry in maps)]


def params(scene: Scene, lit: bool) -> cubes.Params:
    """Return the knobs that a scene has for the faces of its world; lit : and for their light."""
    world = scene.voxels
    assert world is not None
    lamps = [
        (_three(lamp.position.at(0.0)), _three(lamp.radiance.at(0.0)), lamp.side)
        for lamp in world.lamps
        if lit
    ]
    maps = [scene.lights[number] for number in maps_of(scene)] if lit else []
    return cubes.Params(
        position=world.position,
        moments=_moments(scene, world),
        lamps=tuple(lamps),
        lights=_lights(scene) if lit else (),
        reaches=world.reaches,
        environments=tuple(
            (_three(light.factor(0.0)), float(np.radians(light.rotate)))
            for light in maps
            if isinstance(light, EnvironmentLight)
        ),
        texels=world.texels,
        rays=RAYS[scene.quality] if lit else 0,
        bounces=world.bounces,
        target=world.error,
    )


def _lights(scene: Scene) -> tuple[Lamp, ...]:
    """The lights that the plan keeps, but for environments, as they are at first."""
    kept = {each.index for each in effects.lights(scene) if each.kept}
    lights = [light for i, light in enumerate(scene.lights) if i in kept]
    return tuple(
        _lamp(light, scene.ground is not None)
        for light in lights
        if not isinstance(light, EnvironmentLight)
    )


def _lamp(light: Sun | Sphere | Disc | Rectangle | Polygon, horizon: bool) -> Lamp:
    if isinstance(light, Sun):
        radius = float(np.radians(light.angular_diameter) / 2)
        strength, place = _three(light.irradiance.at(0.0)), _three(light.direction(0.0))
        return Lamp("sun", strength, place, radius, horizon=horizon)
    strength = _three(light.radiance.at(0.0))
    if isinstance(light, Sphere):
        return Lamp("sphere", strength, _three(light.position.at(0.0)), light.radius)
    axis, both = _three(light.axis(0.0)), light.two_sided
    if isinstance(light, Disc):
        place = _three(light.position.at(0.0))
        return Lamp("disc", strength, place, light.radius, axis, two_sided=both)
    corners = tuple(map(_three, light.corners(0.0)))
    return Lamp("polygon", strength, axis=axis, corners=corners, two_sided=both)


def _moments(scene: Scene, world: VoxelWorld) -> tuple[tuple[Place, ...], ...]:
    """Positions of the parts at every frame, each once, in order."""
    if not world.bodies:
        return ()
    still = all(body.position.constant for body in world.bodies)
    time = scene.time
    last = 0 if still else last_frame(time.duration, time.frame_rate)
    if last >= MOST_FRAMES:
        remedy = f"parts move in at most {MOST_FRAMES:,} frames: shorten it, or use fewer a second"
        raise InputError(scene.file, "time.duration", time.duration, remedy)
    return tuple(dict.fromkeys(world.positions(k / time.frame_rate) for k in range(last + 1)))


def maps_of(scene: Scene) -> list[int]:
    """Return the numbers of the environments that the plan keeps."""
    decided = {effect.name: effect.called for effect in effects.decide(scene)}
    if not decided["environment"]:
        return []
    return [e.index for e in effects.lights(scene) if e.type == "environment" and e.kept]


def _three(values: Any) -> Place:
    r, g, b = (float(v) for v in np.broadcast_to(np.asarray(values), (3,)))
    return r, g, b


def files(world: VoxelWorld) -> list[Path]:
    """Every file that the world is made from."""
    from bake import sources

    found: list[Path] = []
    for source in (world.source, *(body.source for body in world.bodies)):
        found += [source] if source.suffix.lower() in VOXELS else sources.files(source)
    return found
