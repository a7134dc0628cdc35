"""How should a world of cubes lie on the card: 4 bytes a cell, or blocks of half a byte?

`rgba8` is a volume of 4 bytes a cell, `bc1` blocks that the shader decodes, `bc1_array` slices of
such blocks that the card decodes (OpenGL has no BC1 volumes). The courtyard, as it is and with
cells twice as fine along each axis (four times in a full run); what glows has one colour, a ramp
between two, or a colour for every cell. Bytes are those of solid and emission with their border.
Errors of emission are RMS over glowing cells, over the RMS of what they should send out. Times are
processor milliseconds: of a pass of exact rays; of writing bytes at hand, those of a lamp's box and
those of the volume; and with all that comes before, of moving the lamp and of making the volume.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bake import voxel_faces
from formats.voxel_state import Glow
from formats.voxels import Voxels
from maths.colour import srgb_encode
from pipelines.studies import cube_gathers, cube_views
from pipelines.studies.answer import Answer, Panel, Row, Shot, point
from pipelines.studies.cube_gathers import Card
from pipelines.studies.cube_views import Shown
from pipelines.studies.interval import Interval, blocks, ratio
from pipelines.studies.subjects import Setting
from runtime import voxel_blocks
from runtime.voxel_world import STORAGES, VoxelVolume

TAKES = ("voxels",)
COLOURS = ("one", "ramp", "many")
MOVES = 12
SHADES = 512
"""Colours of a ramp, and of many."""


def measure(setting: Setting) -> Answer:
    """Measure every storage of every world."""
    sizes, rounds = ((1, 2), 2) if setting.quick else ((1, 2, 4), 16)
    shots: dict[tuple[str, str], Shot] = {}
    own, _ = cube_gathers.worlds(setting.source)
    rows: list[Row] = []
    with cube_gathers.card() as card:
        cases = [(1, colours) for colours in COLOURS] + [(n, COLOURS[0]) for n in sizes[1:]]
        for finer, colours in cases:
            world = subject(own, finer, colours)
            turns = max(3, rounds // finer**2)
            rows += measured(card, world, turns, {"finer": finer, "colours": colours}, shots)
    plain, blocks, slices = (of_storage(rows, storage, sizes[-1]) for storage in STORAGES)
    times = {
        name: [float(row[name]) / float(plain[name]) for row in (plain, blocks, slices)]
        for name in ("bytes", "pass_ms")
    }
    many = [
        float(row["emission_error"])
        for row in rows
        if (row["colours"], row["finer"]) == ("many", 1)
    ]
    return Answer(
        question="voxel_storage",
        title=f"BC1 takes {times['bytes'][1]:.3f} of the bytes of RGBA8 and "
        f"{times['pass_ms'][1]:.2f} of the time of a pass, but errs by {many[1]:.0%} where each "
        f"cell has a colour of its own, RGBA8 by {many[0]:.1%}; moving a lamp takes "
        f"{share(plain, 'move_ms', 'made_ms'):.2g} of making a volume",
        truth="emission of the palette; times are the processor's, the best of several rounds",
        rows=rows,
        unit="RMS error of emission, share of its RMS",
        shots=shots,
        panels=panels(rows),
        figures={
            storage: {
                **{name: ratios[k] for name, ratios in times.items()},
                "move_bytes": share(row, "move_bytes", "bytes"),
                "write": share(row, "write_ms", "whole_ms"),
                "move": share(row, "move_ms", "made_ms"),
            }
            for k, (storage, row) in enumerate(zip(STORAGES, (plain, blocks, slices), strict=True))
        },
    )


def measured(
    card: Card,
    world: Voxels,
    rounds: int,
    told: Row,
    shots: dict[tuple[str, str], Shot] | None = None,
) -> list[Row]:
    """Return one row for each storage."""
    faces = voxel_faces.layout(
        world.cells, texels=1, cell_size=world.cell_size, origin=world.origin
    )
    gathers = {
        storage: card.gather(world, faces, storage=storage, bounces=0) for storage in STORAGES
    }
    spent = card.best(gathers, 4, rounds)
    behind = faces.cell().reshape(-1).astype(np.int64)
    glowing = np.asarray(world.emission.any(axis=1))
    glows = glowing[world.cells].reshape(-1)[np.maximum(behind, 0)]
    worth = np.where(behind >= 0, 0.02 + glows, 0).astype(np.float32)
    look = cube_views.shown(cube_views.chosen(world, faces, worth), world, faces)
    rows: list[Row] = []
    for storage, gather in gathers.items():
        what = f"{told['colours']} colour{'s' if told['colours'] == 'many' else ''}"
        finer = f"cells 1/{told['finer']}" if told["finer"] != 1 else "as it is"
        row = point(
            f"{finer}, {what}",
            storage,
            interval_of(gather.volume, world),
            series=storage,
            frame_ms=spent[storage],
            bytes=nbytes(gather.volume),
            default=storage == STORAGES[0],
        )
        row |= {"storage": storage, **told, "cells": int(np.prod(world.size))}
        row |= fidelity(gather.volume, world)
        row |= {"pass_ms": spent[storage], **update(card, gather.volume, world)}
        rows.append(row)
        if shots is not None:
            shots[str(row["subject"]), storage] = shot(gather.volume, world, look, behind)
    return rows


def subject(world: Voxels, finer: int, colours: str) -> Voxels:
    """Return a world with so many cells for one along each axis; what glows has one colour, runs
    from one to another along x + y + z, or has a random one for every cell."""
    cells = world.cells
    for axis in range(3):
        cells = np.repeat(cells, finer, axis=axis)
    found = replace(world, cells=cells, cell_size=world.cell_size / finer)
    if colours == "one":
        return found
    rng = np.random.default_rng(0)
    lit = np.asarray(world.emission.any(axis=1))[cells]
    along = np.argwhere(lit).sum(axis=1)
    chosen = rng.integers(0, SHADES, len(along))
    shades = rng.uniform(0, world.emission.max(), (SHADES, 3))
    if colours == "ramp":
        chosen = (along - along.min()) * (SHADES - 1) // max(1, np.ptp(along))
        shades = np.linspace(shades[0], shades[1], SHADES)
    cells = cells.copy()
    cells[lit] = len(world.albedo) + chosen
    albedo = np.repeat(world.albedo[world.emission.any(axis=1)][:1], SHADES, axis=0)
    return replace(
        found,
        cells=cells,
        albedo=np.concatenate([world.albedo, albedo]),
        emission=np.concatenate([world.emission, shades.astype(np.float32)]),
    )


@dataclass(frozen=True)
class Writes:
    """Writing of bytes at hand. box : of the first block, or eight cells.  whole : of all."""

    nbytes: int
    box: Callable[[], None]
    whole: Callable[[], None]


def writes(card: Card, volume: VoxelVolume) -> Writes:
    """Return how the texture of a volume is written."""
    if volume.storage == "bc1_array":
        blocks = voxel_blocks.bordered(voxel_blocks.blocks_of(volume.texels))
        few = blocks[:2, :1, :1].copy()
        slices = voxel_blocks.CompressedSlices(card.ctx)
        return Writes(
            blocks.nbytes,
            lambda: slices.write(volume.world, few, (0, 0, 0)),
            lambda: slices.write(volume.world, blocks, (0, 0, 0)),
        )
    raw = volume.world.read(alignment=1)
    side = (2, 2, 2) if volume.storage == "rgba8" else (1, 1, 2)
    size = int(np.prod(side)) * len(raw) // int(np.prod(volume.world.size))
    # What this puts into a corner is written over with the whole
    return Writes(
        len(raw),
        lambda: volume.world.write(raw[:size], viewport=(0, 0, 0, *side), alignment=1),
        lambda: volume.world.write(raw, alignment=1),
    )


def nbytes(volume: VoxelVolume) -> int:
    """Return the bytes of solid and emission, the border included."""
    nx, ny, nz = (int(side) for side in volume.size)
    if volume.storage == "rgba8":
        return 4 * (nx + 2) * (ny + 2) * (nz + 2)
    return 8 * (-(-nx // 4) + 2) * (-(-ny // 4) + 2) * (nz + 2)


def fidelity(volume: VoxelVolume, world: Voxels) -> Row:
    """Compare what rays find with the palette."""
    expected = world.emission[world.cells]
    found = volume.texels[..., :3].astype(np.float64) * (volume.scale / 255)
    lit = expected.any(axis=-1)
    apart: NDArray[np.float64] = found[lit] - expected[lit]
    rms = np.sqrt(np.mean(np.square(expected[lit], dtype=np.float64)))
    return {
        "emission_error": float(np.sqrt(np.mean(apart**2)) / rms),
        "largest_error": float(np.abs(apart).max() / rms),
        "dark_that_glow": int(np.count_nonzero(found[~lit].any(axis=-1))),
        "solid_that_differ": int(np.count_nonzero(volume.solid != (world.cells > 0))),
    }


def interval_of(volume: VoxelVolume, world: Voxels) -> Interval:
    """Return the error of emission with its interval, by blocks of glowing cells."""
    expected = world.emission[world.cells]
    found = volume.texels[..., :3].astype(np.float64) * (volume.scale / 255)
    lit = expected.any(axis=-1)
    apart, whole = (
        np.square(v[lit], dtype=np.float64).sum(axis=-1)[None] for v in (found - expected, expected)
    )
    square = ratio(blocks(apart, 64), blocks(whole, 64))
    return Interval(*(float(np.sqrt(v)) for v in (square.value, square.low, square.high)))


def shot(volume: VoxelVolume, world: Voxels, look: Shown, cells: NDArray[np.int64]) -> Shot:
    """Return a view of what glows, as stored and as it should be, and of the rest by albedo."""
    brightest = float(world.emission.max())
    even = np.full((*look.at.shape, 3), 0.3 * brightest, np.float32) * look.albedo
    cell = np.maximum(cells[look.at], 0)
    found = volume.texels[..., :3].astype(np.float32).reshape(-1, 3) * (volume.scale / 255)
    glows = look.emission.any(axis=-1, keepdims=True)
    made, truth = (
        np.where(glows, emission, even) * (look.hit[..., None] / brightest)
        for emission in (found[cell], look.emission)
    )
    codes = [np.rint(255 * srgb_encode(np.clip(v, 0, 1))).astype(np.uint8) for v in (made, truth)]
    return Shot(codes[0], codes[1])


def update(card: Card, volume: VoxelVolume, world: Voxels) -> Row:
    """Move a lamp of one cell, which lies in eight, and write the volume, in turn."""
    written = writes(card, volume)
    corner = np.stack(np.meshgrid(*(np.arange(2),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    share_of, radiance = np.full(8, 0.125), np.full(3, volume.scale)
    nx, ny, nz = volume.size
    best = dict.fromkeys(("write_ms", "whole_ms", "move_ms", "made_ms"), np.inf)
    sent = 0
    for k in range(MOVES):
        # In the open above the courtyard
        place = np.array([nx // 3 + k, ny - 3, nz // 2])
        lamps = [Glow(corner + place, share_of, radiance)]
        before = volume.uploaded
        actions: dict[str, Callable[[], Any]] = {
            "move_ms": partial(volume.set_glow, lamps),
            "write_ms": written.box,
            "whole_ms": written.whole,
        }
        if k < 2:
            actions["made_ms"] = partial(card.volume, world, storage=volume.storage)
        for name, action in actions.items():
            spent = 1e3 * timed(card, action)
            # The first lamp has no place to leave
            best[name] = min(best[name], spent) if k else best[name]
            if name == "move_ms":
                sent = max(sent, volume.uploaded - before)
    volume.set_glow([])
    return {"move_bytes": sent, **best}


def timed(card: Card, action: Callable[[], object]) -> float:
    """Return the processor seconds until the card is done."""
    card.ctx.finish()
    started = process_time()
    action()
    card.ctx.finish()
    return process_time() - started


def share(row: Row, part: str, of: str, other: Row | None = None) -> float:
    """Return one number over another, of the same row or of another one."""
    return float(row[part]) / float((other or row)[of])


def of_storage(rows: list[Row], storage: str, finer: int) -> Row:
    """Return the row of the world of one colour."""
    keys = {"storage": storage, "finer": finer, "colours": COLOURS[0]}
    return next(row for row in rows if all(row[name] == key for name, key in keys.items()))


def panels(rows: list[Row]) -> tuple[Panel, ...]:
    """Plot times against the size of the world."""

    def lines(*names: str) -> dict[str, list[tuple[float, float]]]:
        found: dict[str, list[tuple[float, float]]] = {}
        for row in rows:
            for name in names:
                if row["colours"] == COLOURS[0]:
                    label = f"{row['storage']}, {name.split('_')[0]}"
                    points = found.setdefault(label, [])
                    points.append((float(row["cells"]), float(row[name])))
        return found

    log = ("log", "log")
    x = "cells of the world"
    finest = max(int(row["finer"]) for row in rows)
    plain, blocks = (of_storage(rows, storage, finest) for storage in STORAGES[:2])
    return (
        Panel(
            x, "bytes", lines("bytes", "move_bytes"), None, log,
            title=f"Blocks take {share(blocks, 'bytes', 'bytes', plain):.3f} of the bytes",
        ),
        Panel(
            x, "processor milliseconds of a pass", lines("pass_ms"), None, ("log", "linear"),
            title=f"A pass through blocks takes {share(blocks, 'pass_ms', 'pass_ms', plain):.2f} "
            "of the time in the largest world",
        ),
        Panel(
            x, "processor milliseconds", lines("whole_ms", "write_ms", "move_ms"), None, log,
            title=f"A moved lamp takes {share(plain, 'move_ms', 'move_ms', blocks):.2f} of the "
            "time that blocks ask for",
        ),
    )  # fmt: skip
