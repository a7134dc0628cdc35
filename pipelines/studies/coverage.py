"""Do 95 % intervals hold the truth?

A run is a small bake with random numbers of its own: a shadow volume, a lightmap, or light gathered
on the card. In each, one number is drawn by chance, a coefficient of a voxel or the light of a
texel that has any, and its interval (`maths.intervals`) holds the truth or does not. Runs are
independent, so that the share has the interval of Clopper and Pearson; `every` is the share over
all numbers of all runs, which are not. An interrupted count goes on where it stopped.

The hard cases are thin leaves, of which rays meet a few by chance; one thin triangle, which most
rays miss; and a closed room with a small lamp, where a few bright texels light all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import lightmap, occlusion, voxel_faces
from bake.rays import RayScene
from formats.lightmap import Faces
from formats.mesh import Mesh
from formats.voxels import Voxels
from maths import intervals, spherical_harmonics
from maths.hashing import uniform01
from maths.polygon_lights import rectangle_irradiance
from maths.sampling import fibonacci_sphere, random_rotation
from maths.spherical_lights import project_polygon
from pipelines.studies import cube_gathers, interval, parts
from pipelines.studies.answer import Answer, Row, point
from pipelines.studies.subjects import Setting

Array = NDArray[np.float64]
Once = Callable[[int], tuple[Array, Array]]
"""One run: errors (n,), and how far intervals reach to each side (n,)."""

TAKES = ("mesh",)
GRID, L_MAX, RAYS = 6, 4, 128
TURNS, EACH = 4, 1 << 15  # rays of the truth a voxel, all around
TRIANGLE = np.array([[-1.0, -0.3, 0.0], [1.0, -0.2, 0.1], [0.2, 0.05, 0.3]])
SIDE = 3  # cells of a room
ALBEDO, GLOW = 0.7, 30.0
LIGHT_RAYS, PASSES = 64, 128
AIM = (0.93, 0.97)
PART = 50  # runs that are written down at once


@dataclass(frozen=True)
class Count:
    """What became of runs. held : of them.  every : share of all numbers.  ratio : of errors to
    standard errors as intervals tell them, both RMS.  seconds : of the processor, a run."""

    runs: int
    held: int
    every: float
    ratio: float
    seconds: float


def measure(setting: Setting) -> Answer:
    """Bake again and again; count how often what is told holds."""
    runs = setting.pick(40, 2000)
    with ExitStack() as stack:
        counts = {
            name: counted(once, runs, setting.seed, ", ".join(name))
            for name, once in subjects(setting, stack)
        }
    return answered(counts)


def answered(counts: dict[tuple[str, str], Count]) -> Answer:
    """Return the answer of all counts, by kind and name."""
    rows = [row_of(name, count, n) for n, (name, count) in enumerate(counts.items())]
    told = {", ".join(name): count.held / count.runs for name, count in counts.items()}
    shares, runs = list(told.values()), max(count.runs for count in counts.values())
    within = sum(AIM[0] <= share <= AIM[1] for share in shares)
    low, high = (1 - share for share in AIM[::-1])
    return Answer(
        question="coverage",
        title=f"{min(shares):.1%} to {max(shares):.1%} of {runs:,} intervals of 95 % hold the "
        f"truth in {len(counts)} worlds",
        truth="closed forms of a triangle and of rooms; of other meshes, 131,072 rays all around",
        rows=rows,
        unit=f"share of 95 % intervals that miss the truth; {low:.2f} to {high:.2f} is wanted",
        # More seconds are not meant to miss less
        axes={"world": "world, in the order of the table"},
        titles={"world": f"{within} of {len(rows)} worlds miss {low:.0%} to {high:.0%}"},
        figures={"held": told, "runs": runs, "aim": AIM},
    )


def row_of(name: tuple[str, str], count: Count, world: int) -> Row:
    """Return a count in the common form. world : its number."""
    kind, subject = name
    return point(
        subject,
        f"{kind}, {count.runs:,} runs",
        interval.share(count.runs - count.held, count.runs),
        series=kind,
        bake_seconds=count.seconds,
        world=world,
        held=count.held / count.runs,
        every=count.every,
        error_over_bar=count.ratio,
        runs=count.runs,
    )


def subjects(setting: Setting, stack: ExitStack) -> list[tuple[tuple[str, str], Once]]:
    """Return kind and name, and the run, of all that is baked."""
    found: list[tuple[tuple[str, str], Once]] = [(("occlusion", "triangle"), thin_triangle())]
    if setting.source is not None or not setting.quick:
        for name, mesh in setting.meshes("bell", "bush").items():
            found.append((("occlusion", name), volume(mesh)))
    if setting.source is not None:
        return found
    card = None if setting.quick else stack.enter_context(cube_gathers.card())
    for name, world in (("open corner", corner()), ("closed room", room())):
        found.append((("lightmap", name), rays(world)))
        if card is not None:
            found.append((("gather on the card", name), passes(card, world)))
    return found


def counted(once: Once, runs: int, seed: int = 0, name: str = "") -> Count:
    """Run with seeds of its own and count, in parts that are kept under a name."""
    first, last = 1 + seed * runs, 1 + (seed + 1) * runs
    tallies = [
        parts.part(f"{name} {start}", partial(tally, once, range(start, min(start + PART, last))))
        for start in range(first, last, PART)
    ]
    held, every, squares, bars, seconds = (sum(column) for column in zip(*tallies, strict=True))
    ratio = float(np.sqrt(squares / bars)) if bars > 0 else np.inf
    return Count(runs, held, every / runs, ratio, seconds / runs)


def tally(once: Once, runs: Iterable[int]) -> list[float]:
    """Return sums over runs: one number drawn of each that holds, the share of all that hold, mean
    squares of errors and of standard errors, the processor's seconds."""
    held, every, squares, bars = 0, 0.0, 0.0, 0.0
    started = process_time()
    for run in runs:
        off, reach = once(run)
        inside = np.abs(off) <= reach
        held += bool(inside[int(float(uniform01(run, 0xC07E4)) * len(off))])
        every += float(np.mean(inside))
        squares += float(np.mean(off**2))
        bars += float(np.mean((reach / intervals.coverage_factor()) ** 2))
    return [held, every, squares, bars, process_time() - started]


# shadow volumes


def thin_triangle() -> Once:
    """Return runs of one triangle, the truth by its outline."""
    box, _, _ = occlusion.box_of(TRIANGLE)
    truth = project_polygon(
        box.voxel_centres(GRID), TRIANGLE, np.ones(3), L_MAX, two_sided=True
    )[..., 0]  # fmt: skip
    return of_volume(TRIANGLE, np.array([[0, 1, 2]]), truth)


def volume(mesh: Mesh) -> Once:
    """Return runs of a mesh, the truth by rays all around each voxel."""
    used, faces = np.unique(mesh.faces, return_inverse=True)
    vertices, faces = mesh.vertices[used], faces.reshape(-1, 3).astype(np.int64)
    box, _, _ = occlusion.box_of(vertices)
    return of_volume(
        vertices, faces, all_around(RayScene(vertices, faces), box.voxel_centres(GRID))
    )


def all_around(scene: RayScene, places: Array) -> Array:
    """Return what a mesh hides from places (v, 3), (v, K), by Fibonacci spheres."""
    points = scene.to_unit(places)
    found = np.zeros((len(points), (L_MAX + 1) ** 2))
    for turn in range(TURNS):
        directions = fibonacci_sphere(EACH, random_rotation(0x7B07 + turn))
        Y = spherical_harmonics.evaluate(directions, L_MAX)
        towards = np.ascontiguousarray(directions, np.float32)
        for v, place in enumerate(points):
            starts = np.ascontiguousarray(np.broadcast_to(place, towards.shape))
            blocked = scene.occluded(starts, towards)
            found[v] += 4 * np.pi / (TURNS * EACH) * Y[blocked].sum(axis=0)
    return found


def of_volume(vertices: Array, faces: NDArray[np.int64], truth: Array) -> Once:
    """Return runs whose numbers are all coefficients of all voxels outside."""
    scene = RayScene(vertices, faces)
    params = occlusion.Params(grid=GRID, l_max=L_MAX, rays=RAYS, proof=0)

    def once(run: int) -> tuple[Array, Array]:
        found = occlusion.around(scene, vertices, faces, params=params, seed=run)
        outside = ~found.inside.ravel()
        off = found.terms.reshape(truth.shape)[outside] - truth[outside]
        reach = found.quality["coverage_factor"] * found.spread.ravel()[outside]
        return off.ravel(), np.repeat(reach.astype(np.float64), truth.shape[1])

    return once


# light among cubes


def room() -> Voxels:
    """Return a closed room with one glowing cell in the middle of its ceiling."""
    cells = np.ones((SIDE + 2,) * 3, np.uint16)
    cells[1:-1, 1:-1, 1:-1] = 0
    cells[SIDE // 2 + 1, SIDE + 1, SIDE // 2 + 1] = 2
    return _world(cells)


def corner() -> Voxels:
    """Return a floor and two walls, in one of which a cell glows."""
    cells = room().cells.copy()
    cells[-1], cells[:, -1], cells[:, :, -1] = 0, 0, 0
    cells[0, SIDE // 2 + 1, SIDE // 2 + 1] = 2
    return _world(cells)


def _world(cells: NDArray[np.uint16]) -> Voxels:
    albedo = np.repeat(np.array([[0], [ALBEDO], [0.3]], np.float32), 3, axis=1)
    emission = np.repeat(np.array([[0], [0], [GLOW]], np.float32), 3, axis=1)
    return Voxels(cells, albedo, emission)


def by_patches(world: Voxels, faces: Faces) -> tuple[NDArray[np.bool_], Array]:
    """Return which texels (h, w) look into the room, and their light (k,), by a dense system of
    rectangles, each even: what a texel of a lightmap stands for. The room is convex."""
    position, normal = faces.positions().astype(np.float64), faces.normals().astype(np.float64)
    ahead = position + 0.5 * normal
    with np.errstate(invalid="ignore"):
        within = np.all((ahead > 1) & (ahead < SIDE + 1), axis=2)
    centre, towards = position[within], normal[within]
    axis = np.argmax(np.abs(towards), axis=1)
    u, v = np.zeros((2, len(axis), 3))
    k = np.arange(len(axis))
    u[k, (axis + 1) % 3] = 0.5
    v[k, (axis + 2) % 3] = 0.5 * towards[k, axis]
    form = np.stack([rectangle_irradiance(centre, towards, *each, 1.0)
                     for each in zip(centre, u, v, strict=True)], axis=1)  # fmt: skip
    row = world.cells.ravel()[faces.cell()[within]]
    albedo, emission = (
        table[row, 0].astype(np.float64) for table in (world.albedo, world.emission)
    )
    return within, np.linalg.solve(np.eye(len(row)) - form * albedo / np.pi, form @ emission)


def _laid_out(world: Voxels) -> tuple[Faces, NDArray[np.bool_], Array]:
    faces = voxel_faces.layout(world.cells, texels=1)
    # What does not look into the room takes no rays
    r = faces.rectangles
    inward = r["plane"] == np.where(r["sign"] > 0, 1, SIDE + 1)
    faces = replace(faces, rectangles=r[inward])
    within, truth = by_patches(world, faces)
    within[within] = truth > 0
    return faces, within, truth[truth > 0]


def rays(world: Voxels) -> Once:
    """Return runs of a lightmap, by rays of Embree."""
    faces, lit, truth = _laid_out(world)
    params = lightmap.Params(texels=1, rays=LIGHT_RAYS, target=0.0)

    def once(run: int) -> tuple[Array, Array]:
        found = lightmap.gather(world, faces, params=params, seed=run)
        reach = found.quality["coverage_factor"] * found.error[lit][:, 0].astype(np.float64)
        return found.irradiance[lit][:, 0] - truth, reach

    return once


def passes(card: Any, world: Voxels) -> Once:
    """Return runs of light that is gathered on the card."""
    faces, lit, truth = _laid_out(world)
    volume = card.volume(world)

    def once(run: int) -> tuple[Array, Array]:
        gather = card.single(volume, faces, seed=run)
        gather.step(PASSES)
        light, (error, degrees) = gather.read()[lit][:, 0], gather.bars()
        gather.release()
        return light - truth, error[lit] * np.vectorize(intervals.coverage_factor)(degrees[lit])

    return once
