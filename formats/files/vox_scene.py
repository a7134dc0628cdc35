"""What a .vox file's scene shows: models placed by the scene's graph, in one box of cells.

A model turns about floor(size / 2): the cell v covers [v, v + 1) - floor(size / 2), which a
transform takes to R p + t. A file without a graph shows its first model, standing on z = 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formats.errors import InputError
from formats.files.vox import Model, VoxFile
from formats.files.vox_nodes import UNTURNED, Group, Rotation, Shape, Transform

MAX_DEPTH = 128
"""Deepest nesting of nodes."""
MAX_VISITS = 1 << 16
"""Largest number of nodes, each counted as often as the scene shows it."""
MAX_SIDE = 512
"""Largest side of the whole scene, cells."""
MAX_CELLS = 1 << 27
"""Most cells of all placed models, and of the box that holds them."""

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Placement:
    """One model in the scene. rotation and translation as in `vox_nodes`, in the file's axes."""

    model: int
    rotation: Rotation = UNTURNED
    translation: tuple[int, int, int] = (0, 0, 0)
    hidden: bool = False
    frames: int = 1


@dataclass(frozen=True, eq=False)
class Scene:
    """cells : (z, y, x) uint8 palette indices in the file's axes, 0 empty, no empty margins.

    lowest : (x, y, z) cells of its lowest corner. notes : what is not shown.
    """

    cells: NDArray[np.uint8]
    lowest: tuple[int, int, int]
    notes: tuple[str, ...]


def placements(file: VoxFile) -> list[Placement]:
    """List the models that a file shows, hidden ones too, in the order of its graph.

    Raises InputError for nodes that are missing, contain themselves, nest deeper than `MAX_DEPTH`,
    or are shown more than `MAX_VISITS` times in all.
    """
    if not file.nodes:
        size = file.models[0].size
        return [Placement(0, translation=(0, 0, size[2] // 2), frames=len(file.models))]
    found = []
    for visits, placement in enumerate(_walk(file, min(file.nodes), Placement(-1), ())):
        if visits == MAX_VISITS:
            raise InputError(file.name, "nodes", visits, f"show at most {MAX_VISITS} nodes")
        if placement is not None:
            found.append(placement)
    return found


def flatten(file: VoxFile) -> Scene:
    """Put all visible models into one box; where several lie, the last counts.

    Raises InputError as `placements`, where nothing is visible, and beyond `MAX_SIDE` or
    `MAX_CELLS`. Memory: the box, and 60 bytes a cell of the largest model.
    """
    placed, name = placements(file), file.name
    shown = [p for p in placed if not p.hidden and len(file.models[p.model].cells)]
    if not shown:
        raise InputError(name, "cells", 0, "show at least one layer with a model that has cells")
    total = sum(len(file.models[p.model].cells) for p in shown)
    if total > MAX_CELLS:
        raise InputError(name, "cells", total, f"place at most {MAX_CELLS}")
    boxes = {number: _box(file.models[number]) for number in {p.model for p in shown}}
    corners = np.concatenate([_placed(boxes[p.model], file.models[p.model], p) for p in shown])
    lowest, highest = corners.min(axis=0), corners.max(axis=0)
    size = (highest - lowest + 1).tolist()
    if max(size) > MAX_SIDE:
        remedy = f"keep the scene within {MAX_SIDE} cells a side"
        raise InputError(name, "size", tuple(size), remedy)

    cells = np.zeros(size[::-1], np.uint8)
    for placement in shown:
        model = file.models[placement.model]
        x, y, z = (_placed(model.cells[:, :3], model, placement) - lowest).T
        cells[z, y, x] = model.cells[:, 3]
    x0, y0, z0 = lowest.tolist()
    return Scene(cells, (x0, y0, z0), _notes(file, placed))


def _walk(
    file: VoxFile, number: int, so_far: Placement, path: tuple[int, ...]
) -> Iterator[Placement | None]:
    """Yield something for each node that is visited: its placement for a shape."""
    node, name = file.nodes.get(number), file.name
    if node is None:
        raise InputError(name, "nodes", number, "a node names this one, which is missing")
    if number in path:
        raise InputError(name, "nodes", number, "this node contains itself: mend the scene graph")
    if len(path) == MAX_DEPTH:
        raise InputError(name, "nodes", MAX_DEPTH, "groups nest too deeply: dissolve some")
    hidden, path = so_far.hidden or node.hidden, (*path, number)
    if isinstance(node, Shape):
        if not 0 <= node.model < len(file.models):
            raise InputError(name, "models", node.model, f"the file has {len(file.models)} models")
        frames = max(so_far.frames, node.frames)
        yield Placement(node.model, so_far.rotation, so_far.translation, hidden, frames)
        return
    yield None
    if isinstance(node, Group):
        below = Placement(-1, so_far.rotation, so_far.translation, hidden, so_far.frames)
        for child in node.children:
            yield from _walk(file, child, below, path)
        return
    hidden = hidden or node.layer in file.hidden_layers
    yield from _walk(file, node.child, _joined(so_far, node, hidden), path)


def _joined(outer: Placement, node: Transform, hidden: bool) -> Placement:
    """Return R (R' p + t') + t."""
    R, t = np.array(outer.rotation), np.array(outer.translation)
    a, b, c = (R @ np.array(node.rotation)).tolist()
    x, y, z = (R @ np.array(node.translation) + t).tolist()
    rotation = ((a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2]))
    return Placement(-1, rotation, (x, y, z), hidden, max(outer.frames, node.frames))


def _placed(cells: NDArray[np.integer], model: Model, placement: Placement) -> Integers:
    """Return where cells (n, 3) of a model lie in the scene."""
    pivot = np.array(model.size) // 2
    # Twice the middle of a cell is odd and stays so, turned
    doubled = 2 * (cells.astype(np.int64) - pivot) + 1
    turned = doubled @ np.array(placement.rotation).T
    return np.asarray((turned - 1) // 2 + np.array(placement.translation))


def _box(model: Model) -> NDArray[np.uint8]:
    """Return the lowest and the highest cell of a model: (2, 3)."""
    return np.stack([model.cells[:, :3].min(axis=0), model.cells[:, :3].max(axis=0)])


def _notes(file: VoxFile, placed: list[Placement]) -> tuple[str, ...]:
    notes = list(file.notes)
    hidden = sum(p.hidden for p in placed)
    if hidden:
        notes.append(f"{hidden} of {len(placed)} placed models are hidden: left out")
    if any(p.frames > 1 and not p.hidden for p in placed):
        notes.append("it is animated: the first frame is taken")
    return tuple(notes)
