"""From a traced shadow to the played one, one approximation at a time.

On what the camera sees of walls and ground, the share of the lamps' light that one caster leaves.
The truth is sampled: rays to the lamps, each weighed by its cosine. Then, in this order: light
counts alike from all angles; it is cut to bands up to l_max; it is projected at the ends of the
caster's longest axis instead of at each point; occlusion is read from the volume, beyond which it
thins; and from its codes, as the encoding keeps them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bake import compress, occlusion, occlusion_rays, reference_camera, reference_lights
from bake import reference_scene as parts
from bake.rays import RayScene
from bake.reference_world import World
from formats.mesh import Mesh
from formats.meshes import PlacedMesh, Shadow
from formats.occlusion import Box
from formats.scene import Scene
from maths.hashing import uniform01
from maths.occlusion_shadow import occlusion_falloff, occlusion_place
from maths.sampling import r2
from maths.spherical_rotation import rotate
from maths.trilinear import looked_up
from runtime.light_harmonics import LightsAtPoints
from runtime.lighting import at as lights_at

Array = NDArray[np.float64]

STEPS = ("cosine", "bands", "ends", "volume", "codes")
RAYS, FINE = 2048, 8192  # of the volume, and the rays of a point of its own
PIXELS = (96, 54)


@dataclass(frozen=True, eq=False)
class Receivers:
    """What the camera sees of what casts no shadow: point, normal (n, 3), metres of the world."""

    point: Array
    normal: Array


def receivers(scene: Scene, time: float, size: tuple[int, int] = PIXELS) -> Receivers:
    """Return where the middles of the picture's pixels meet what takes shadows and casts none:
    meshes without shadow, cubes, and the ground."""
    camera = reference_camera.at(scene, time, size, lens=False)
    found, _ = parts.parts_of(scene, time, camera.yaw, camera.position)
    world = World(parts.merged(found), scene.ground)
    rays = camera.rays(np.arange(size[0] * size[1]), np.zeros(1, np.int64), 1, 0)
    ends = world.cast(rays.origin, rays.direction)
    # Instances stand in this order: meshes, sprites, the world of cubes, its lamps
    groups = [each for each in scene.billboards if not (each.pictured or each.photographed)]
    sprites = sum(len(each.instances()) for each in groups)
    count = sum(len(part.tint) for part in found) - len(scene.meshes) - sprites
    flags = [mesh.shadow is None for mesh in scene.meshes] + [False] * sprites
    # The last one is for a scene in which nothing is met
    plain = np.array(flags + [n == 0 for n in range(count)] + [False], bool)
    here = ends.ground | ((ends.face >= 0) & plain[world.instance[np.maximum(ends.face, 0)]])
    picked = np.flatnonzero(here)
    whole = ends.hits.pick(picked)
    ends = type(ends)(ends.distance[picked], ends.point[picked], whole, ends.ground[picked])
    shaded = world.shade(ends, rays.direction[picked])
    return Receivers(shaded.front, shaded.normal)


def shares(
    scene: Scene,
    caster: PlacedMesh,
    mesh: Mesh,
    time: float,
    *,
    shadow: Shadow,
    samples: int,
    where: Receivers,
) -> dict[str, Array]:
    """Return by name the share (n, 3) of the lamps' light left at points: "truth" and STEPS.

    mesh : of the caster. shadow : its volume. samples : rays to each lamp.
    """
    found = _traced(scene, caster, mesh, time, samples, where)
    matrix, lights = caster.world_from_mesh(time), lights_at(scene, time)
    at = (where.point - matrix[:3, 3]) @ matrix[:3, :3] / caster.scale**2
    params = occlusion.Params(grid=shadow.grid, l_max=shadow.l_max, rays=RAYS)
    master = occlusion.trace(mesh, params=params)
    knobs = compress.Params(shadow.encoding, components=shadow.components, size=shadow.size)
    asset = compress.compress(master, params=knobs)
    exact = own_harmonics(mesh, at, shadow.l_max, FINE)
    project = LightsAtPoints({}, shadow.l_max).project
    turn = matrix[:3, :3].T / caster.scale
    found["bands"] = _left(exact, rotate(project(lights, where.point), turn))
    box, ends = master.box, np.repeat(np.asarray(master.box.centre)[None], 2, axis=0)
    axis = box.longest_axis
    ends[:, axis] += np.array([-1.0, 1.0]) * box.half_extent[axis]
    pair = rotate(project(lights, ends @ matrix[:3, :3].T + matrix[:3, 3]), turn)
    p = box.to_object(at)
    along = np.clip(p[:, axis] + 0.5, 0, 1)[:, None]

    def lerped(terms: Array) -> Array:
        first, second = (_left(terms, light[None]) for light in pair)
        return first * (1 - along) + second * along

    found["ends"] = lerped(exact)
    traced, stored = looked_up(master.terms, occlusion_place(p)), asset.terms(p)
    found["volume"] = lerped(thinned(traced, box, p))
    found["codes"] = lerped(thinned(stored, box, p))
    return found


def own_harmonics(mesh: Mesh, points: Array, l_max: int, rays: int) -> Array:
    """Return what a mesh hides from points (n, 3) of its space, each by rays of its own: (n, K)."""
    used = mesh.vertices[np.unique(mesh.faces)]
    scene = RayScene(mesh.vertices, mesh.faces)
    low, high = (scene.to_unit(c).astype(np.float64) for c in (used.min(axis=0), used.max(axis=0)))
    radius = float(np.linalg.norm(scene.to_unit(used) - (low + high) / 2, axis=1).max())
    exact = (points - scene.centre) * scene.scale
    cones = occlusion_rays.cones(exact, low, high, radius)
    keys = np.arange(len(points))
    found = occlusion_rays.project(scene, exact.astype(np.float32), cones, keys, rays, l_max)
    return np.asarray(found.terms, np.float64)


def thinned(terms: NDArray[np.float32], box: Box, p: Array) -> Array:
    """Return what a volume's lookups (m, K) at p (m, 3) hide, less beyond it."""
    factor = occlusion_falloff(p, 2 * np.asarray(box.half_extent))
    return np.asarray(terms * factor[:, None], np.float64)


def _left(terms: Array, light: Array) -> Array:
    """Share (n, 3) of lights (n or 1, K, 3) that occlusion (n, K) leaves."""
    total = 2 * np.sqrt(np.pi) * light[:, 0]
    hidden = np.einsum("nk,nkc->nc", terms, np.broadcast_to(light, (len(terms), *light.shape[1:])))
    return np.asarray(np.clip(1 - hidden / np.maximum(total, 1e-30), 0, 1))


def _traced(
    scene: Scene, caster: PlacedMesh, mesh: Mesh, time: float, samples: int, where: Receivers
) -> dict[str, Array]:
    """Return the truth, and the same with light alike from all angles, by rays to the lamps."""
    rays, matrix = RayScene(mesh.vertices, mesh.faces), caster.world_from_mesh(time)
    world = World(parts.merged(parts.parts_of(scene, time, 0.0, np.zeros(3))[0]), scene.ground)
    lamps = reference_lights.at(scene, time, world).plain
    sums = {name: np.zeros((2, len(where.point), 3)) for name in ("truth", "cosine")}
    at = (where.point - matrix[:3, 3]) @ matrix[:3, :3] / caster.scale**2
    start, number = rays.to_unit(at), np.arange(len(at))
    for i, lamp in enumerate(lamps):
        shift = np.stack([uniform01(number, i, k) for k in (1, 2)], axis=-1)
        for n in range(samples):
            u = np.concatenate([r2(np.full(len(at), n), shift), np.zeros((len(at), 1))], axis=1)
            sample = lamp.sample(where.point, u)
            direction = sample.direction @ matrix[:3, :3] / caster.scale
            seen = ~rays.occluded(start, direction.astype(np.float32))
            cosine = np.maximum(np.einsum("ij,ij->i", sample.direction, where.normal), 0)
            for name, factor in (("truth", cosine), ("cosine", np.ones(len(at)))):
                light = sample.weight * factor[:, None]
                sums[name] += np.stack([light * seen[:, None], light])
    return {n: np.divide(a, b, where=b > 0, out=np.ones_like(a)) for n, (a, b) in sums.items()}
