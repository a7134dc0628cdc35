"""At how many points of a caster should lights be projected: one, two or four?

A mesh hides a glowing ball from a floor under it. The ball's harmonics are taken at the middle of
the mesh, at the ends of its longest axis (as the player does), at four points along it, at the
corners of a square of its two longest axes, or at each point of the floor; between points what
light is left is linear. What the mesh hides is known exactly, up to l_max 7, from rays of each
point's own: points and bands are all that err. The truth is rays to the ball.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bake import occlusion
from bake.rays import RayScene
from formats.mesh import Mesh
from formats.occlusion import Box
from maths.hashing import uniform01
from maths.sampling import r2
from maths.spherical_lights import project_sphere
from pipelines.studies import interval
from pipelines.studies.answer import Answer, Picture, Row, Shot, point
from pipelines.studies.shadow_steps import own_harmonics
from pipelines.studies.stages import processor_seconds
from pipelines.studies.subjects import Setting

Array = NDArray[np.float64]

TAKES = ("mesh",)
L_MAX = 7
WAYS = {
    "one, in the middle": (1, 1),
    "two ends": (2, 1),
    "four on a line": (4, 1),
    "four corners": (2, 2),
}
"""Points along the longest axis, and along the second."""
OWN, DEFAULT = "each point's own", "two ends"
DISTANCES = (1.5, 2.0, 3.0, 6.0, 12.0)  # of the ball, in longest half-extents of the mesh
ANGLE = 15.0  # degrees, of the ball's radius as the middle of the mesh sees it
TOWARDS = np.array([[1.0, 0.7, 0.35], [-0.5, 1.0, 0.8], [0.2, 0.35, -1.0]])
CITED = 2.0
LAMPS = 100  # whose projection is timed


@dataclass(frozen=True, eq=False)
class Scene:
    """A mesh, points (n, 3) of a floor of side x side, and what the mesh hides of them (n, K)."""

    rays: RayScene
    box: Box
    side: int
    floor: Array
    hidden: Array


def measure(setting: Setting) -> Answer:
    """Compare shadows by light at few points with traced ones, near and far balls."""
    rows: list[Row] = []
    shots: dict[tuple[str, str], Shot] = {}
    for name, mesh in setting.meshes("bust", "oak", "knot").items():
        scene = scene_of(mesh, setting.pick(24, 48))
        spent = {way: price(scene.box, counts) for way, counts in WAYS.items()}
        for distance in DISTANCES[:: setting.pick(2, 1)]:
            apart = {way: np.zeros(len(scene.floor)) for way in [*WAYS, OWN]}
            for number, towards in enumerate(TOWARDS):
                ball, radius = placed(scene.box, towards, distance)
                truth = traced(scene, ball, radius, setting.pick(64, 256))
                for way in apart:
                    left = shadow(scene, ball, radius, way)
                    apart[way] += np.square(left - truth) / len(TOWARDS)
                    if number == 0:
                        pictures = [seen(scene, share) for share in (left, truth)]
                        shots[name, told(way, distance)] = Shot(pictures[0], pictures[1])
            for way, squares in apart.items():
                blocks = interval.blocks(squares.reshape(scene.side, -1), 8)
                rows.append(
                    point(
                        name,
                        told(way, distance),
                        interval.rms(blocks),
                        series=way,
                        frame_ms=spent.get(way),
                        default=way == DEFAULT,
                        way=way,
                        distance=distance,
                    )
                )
    near = {way: mean_of(rows, way, min(DISTANCES)) for way in [*WAYS, OWN]}
    far = {way: mean_of(rows, way, max(DISTANCES)) for way in [*WAYS, OWN]}
    one, two, line, corners = (near[way] for way in WAYS)
    least, most = min(DISTANCES), max(DISTANCES)
    return Answer(
        question="caster_points",
        title=f"Under a lamp {least:g} half lengths away two points err by {two:.3f}, one by "
        f"{one:.3f}, four by {line:.3f} on a line and {corners:.3f} at corners, each point's own "
        f"light by {near[OWN]:.3f}; from {most:g} on two suffice: {far[DEFAULT]:.3f} against "
        f"{far[OWN]:.3f}",
        truth="rays to the ball from each point of the floor",
        rows=rows,
        unit="RMS error of the share of light that is left",
        axes={"distance": "distance of the lamp, longest half-extents of the mesh"},
        shots=shots,
        figures={"near": near, "far": far},
    )


def told(way: str, distance: float) -> str:
    """Return how a setting is told."""
    return f"{way}, lamp {distance:g} away"


def mean_of(rows: list[Row], way: str, distance: float) -> float:
    """Return the mean error of a way over the meshes."""
    own = [r for r in rows if r["way"] == way and r["distance"] == distance]
    return float(np.mean([float(r["error"]) for r in own]))


def scene_of(mesh: Mesh, side: int) -> Scene:
    """Lay a floor under a mesh, twice as wide as it is, and trace what each of its points sees."""
    box, _, _ = occlusion.box_of(mesh.vertices[np.unique(mesh.faces)])
    across = 2 * (np.arange(side) + 0.5) / side - 1
    x, z = np.meshgrid(2 * across, 2 * across)
    half = np.asarray(box.half_extent)
    # As wide along x as along z, just below the lowest corner
    wide = max(half[0], half[2])
    place = np.stack([wide * x, np.full_like(x, -1.02 * half[1]), wide * z], axis=-1)
    floor = place.reshape(-1, 3) + np.asarray(box.centre)
    hidden = own_harmonics(mesh, floor, L_MAX, 1024)
    return Scene(RayScene(mesh.vertices, mesh.faces), box, side, floor, hidden)


def placed(box: Box, towards: Array, distance: float) -> tuple[Array, float]:
    """Return centre (3,) and radius of a ball, metres."""
    away = distance * max(box.half_extent)
    unit = towards / np.linalg.norm(towards)
    return np.asarray(box.centre) + away * unit, away * float(np.sin(np.radians(ANGLE)))


def points_of(box: Box, counts: tuple[int, int]) -> Array:
    """Return the points (a, b, 3) of a box: a along its longest axis, b along its second."""
    order = np.argsort(-np.asarray(box.half_extent), kind="stable")
    found = np.tile(np.asarray(box.centre), (*counts, 1))
    for i, count in enumerate(counts):
        if count > 1:
            along = np.linspace(-1, 1, count) * box.half_extent[order[i]]
            found[..., order[i]] += along[:, None] if i == 0 else along[None, :]
    return found


def lamp(at: Array, ball: Array, radius: float) -> Array:
    """Return the harmonics (..., K) of the ball at points (..., 3)."""
    return project_sphere(at, ball, radius, np.ones(3), L_MAX)[..., 0]


def left_of(hidden: Array, light: Array) -> Array:
    """Return the share (n,) that occlusion (n, K) leaves of light (n or 1, K)."""
    total = np.maximum(2 * np.sqrt(np.pi) * light[..., 0], 1e-30)
    return np.asarray(np.clip(1 - np.einsum("nk,nk->n", hidden, light + 0 * hidden) / total, 0, 1))


def shadow(scene: Scene, ball: Array, radius: float, way: str) -> Array:
    """Return the share (n,) of the ball's light that each point of the floor is left with."""
    if way == OWN:
        return left_of(scene.hidden, lamp(scene.floor, ball, radius))
    counts = WAYS[way]
    lights = lamp(points_of(scene.box, counts), ball, radius)
    order = np.argsort(-np.asarray(scene.box.half_extent), kind="stable")
    p = scene.box.to_object(scene.floor)
    found = np.zeros(len(p))
    places = []
    for i, count in enumerate(counts):
        x = np.clip(p[:, order[i]] + 0.5, 0, 1) * (count - 1)
        low = np.minimum(x.astype(np.int64), max(count - 2, 0))
        places.append((low, x - low))
    for da in (0, 1)[: counts[0]]:
        for db in (0, 1)[: counts[1]]:
            (a, fa), (b, fb) = places
            share = (fa if da else 1 - fa) * (fb if db else 1 - fb)
            found += share * left_of(scene.hidden, lights[a + da, b + db])
    return found


def price(box: Box, counts: tuple[int, int]) -> float:
    """Return processor milliseconds to project LAMPS balls at the points of a way."""
    balls = [
        placed(box, np.array([np.cos(i), 1.0, np.sin(i)]), 2.0 + i / LAMPS) for i in range(LAMPS)
    ]
    centres, radii = np.array([b for b, _ in balls]), np.array([r for _, r in balls])
    at = points_of(box, counts).reshape(-1, 1, 3)
    project = partial(project_sphere, at, centres, radii, np.ones(3), L_MAX)
    best = min(processor_seconds(project)[1] for _ in range(5))
    return 1e3 * best


def traced(scene: Scene, ball: Array, radius: float, samples: int) -> Array:
    """Return the share (n,) of rays from each point into the cone of the ball that meet nothing."""
    offset = ball - scene.floor
    away = np.linalg.norm(offset, axis=1)
    axis = offset / away[:, None]
    lowest = np.sqrt(np.maximum(1 - np.square(radius / away), 0))
    # A frame about each axis
    helper = np.where(np.abs(axis[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(axis, u)
    start, number = scene.rays.to_unit(scene.floor), np.arange(len(scene.floor))
    shift = np.stack([uniform01(number, k) for k in (1, 2)], axis=-1)
    seen = np.zeros(len(scene.floor))
    for n in range(samples):
        x = r2(np.full(len(number), n), shift)
        cosine = 1 - x[:, 0] * (1 - lowest)
        sine, turn = np.sqrt(np.maximum(1 - cosine**2, 0)), 2 * np.pi * x[:, 1]
        way = cosine[:, None] * axis
        way += (sine * np.cos(turn))[:, None] * u + (sine * np.sin(turn))[:, None] * v
        seen += ~scene.rays.occluded(start, np.ascontiguousarray(way, np.float32))
    return seen / samples


def seen(scene: Scene, share: Array) -> Picture:
    """Return shares (n,) of the floor as a picture."""
    codes = np.rint(255 * share.reshape(scene.side, -1)).astype(np.uint8)
    return np.repeat(codes[..., None], 3, axis=2)
