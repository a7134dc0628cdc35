"""The layout of a world's faces: nothing forgotten, nothing twice, no seams, nothing over edges."""

import time
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from bake import voxel_faces
from bake.voxel_faces import layout
from formats.errors import InputError
from formats.lightmap import Faces
from formats.lightmap_rectangles import NONE
from tests.bake import cell_worlds

SHAPE = (5, 6, 7)


def random_cells(seed: int, share: float = 0.5) -> NDArray[np.uint16]:
    rng = np.random.default_rng(seed)
    return (rng.random(SHAPE) < share).astype(np.uint16)


def slow_faces(states: list[NDArray[np.uint16]], *, below: bool = False) -> set[tuple[int, ...]]:
    """All exposed faces as (x, y, z, face), by a loop."""
    nz, ny, nx = states[0].shape
    found = set()
    for x, y, z, axis, down in product(range(nx), range(ny), range(nz), range(3), (0, 1)):
        front = [x, y, z]
        front[axis] += -1 if down else 1
        within = all(0 <= p < n for p, n in zip(front, (nx, ny, nz), strict=True))
        for cells in states:
            free = not within or cells[front[2], front[1], front[0]] == 0
            skipped = axis == 1 and down and y == 0 and not below
            if cells[z, y, x] and free and not skipped:
                found.add((x, y, z, 2 * axis + down))
    return found


def of_pages(faces: Faces) -> dict[tuple[int, ...], tuple[int, int]]:
    """All faces that a layout has, with their first texel."""
    found = {}
    for z, y, x in np.argwhere(faces.page_of > 0):
        for face, (column, row) in enumerate(faces.pages[faces.page_of[z, y, x]]):
            if column != NONE:
                found[int(x), int(y), int(z), face] = (int(column), int(row))
    return found


@pytest.mark.parametrize("below", [False, True])
@pytest.mark.parametrize("texels", [1, 3])
def test_every_exposed_face_has_its_texels_once(texels: int, below: bool) -> None:
    for seed in range(4):
        cells = random_cells(seed, share=(0.1, 0.3, 0.6, 0.9)[seed])
        faces = layout(cells, texels=texels, below=below)
        found = of_pages(faces)
        assert set(found) == slow_faces([cells], below=below)
        # Texels lie on their own face, once each
        position, normal, cell = faces.positions(), faces.normals(), faces.cell()
        taken = np.zeros(faces.size[::-1], int)
        for (x, y, z, face), (column, row) in found.items():
            block = np.s_[row : row + texels, column : column + texels]
            taken[block] += 1
            assert np.all(cell[block] == (z * SHAPE[1] + y) * SHAPE[2] + x)
            axis, sign = face // 2, -1 if face % 2 else 1
            assert np.all(normal[block][..., axis] == sign)
            middle = np.array([x, y, z]) + 0.5
            middle[axis] += 0.5 * sign
            assert np.allclose(position[block].mean(axis=(0, 1)), middle, atol=1e-5)
        assert np.array_equal(taken, (cell >= 0).astype(int))
        assert np.array_equal(np.isnan(position[..., 0]), cell < 0)


def test_the_columns_of_a_texel_grow_along_u_and_v() -> None:
    cells = np.ones((1, 1, 1), np.uint16)
    faces = layout(cells, texels=2, cell_size=0.5, origin=(1.0, 2.0, 3.0), below=True)
    assert len(faces.rectangles) == 6
    position = faces.positions()
    for r in faces.rectangles:
        first = position[r["y"], r["x"]]
        for step, other in (((0, 1), (r["axis"] + 1) % 3), ((1, 0), (r["axis"] + 2) % 3)):
            along = position[r["y"] + step[0], r["x"] + step[1]] - first
            assert np.allclose(along, 0.25 * np.eye(3)[other])
    assert np.nanmin(position.reshape(-1, 3), axis=0).tolist() == [1.0, 2.0, 3.0]
    assert np.nanmax(position.reshape(-1, 3), axis=0).tolist() == [1.5, 2.5, 3.5]


def test_faces_of_any_time_get_texels() -> None:
    states = [random_cells(seed) for seed in range(3)]
    faces = layout(states, texels=1)
    assert set(of_pages(faces)) == slow_faces(states)


def test_rectangles_and_gutters_do_not_overlap() -> None:
    faces = layout(random_cells(5), texels=2)
    taken = np.zeros(faces.size[::-1], int)
    for r in faces.rectangles:
        wide, high = r["width"] * 2, r["height"] * 2
        assert r["x"] >= 1
        assert r["y"] >= 1
        taken[r["y"] - 1 : r["y"] + high + 1, r["x"] - 1 : r["x"] + wide + 1] += 1
    assert taken.max() == 1
    assert np.array_equal(taken > 0, faces.source()[..., 0] >= 0)


def test_long_rectangles_are_split() -> None:
    faces = layout(np.ones((1, 2, 400), np.uint16), texels=1)
    assert faces.rectangles["width"].max() <= voxel_faces.LONGEST
    assert faces.rectangles["height"].max() <= voxel_faces.LONGEST
    # 400 cells take 4 parts along the top and 4 each for front and back; two ends of 2 x 1
    assert len(faces.rectangles) == 4 + 2 * 4 + 2


def test_merging_is_as_good_as_it_gets_on_plain_shapes() -> None:
    # A box has one rectangle a side; a comb is cut along its teeth, whichever axis they follow
    assert len(layout(np.ones((5, 4, 3), np.uint16), texels=1).rectangles) == 5
    comb = np.zeros((9, 1, 8), np.uint16)
    comb[::2] = 1
    for cells in (comb, comb.transpose(2, 1, 0)):
        top = layout(np.ascontiguousarray(cells), texels=1).rectangles
        assert np.count_nonzero(top["axis"] == 1) == 5


def bilinear(picture: NDArray[np.float64], x: float, y: float) -> float:
    i, j = int(np.floor(x - 0.5)), int(np.floor(y - 0.5))
    s, t = x - 0.5 - i, y - 0.5 - j
    rows = (1 - t) * picture[j, i : i + 2] + t * picture[j + 1, i : i + 2]
    return float((1 - s) * rows[0] + s * rows[1])


def shown(faces: Faces, picture: NDArray[np.float64]) -> NDArray[np.float64]:
    source = faces.source().astype(int)
    there = source[..., 0] >= 0
    return np.where(there, picture[source[..., 1], source[..., 0]], np.nan)


@pytest.mark.parametrize("texels", [2, 3])
@pytest.mark.parametrize("share", [0.5, 0.8])
def test_lookups_have_no_seams_between_coplanar_faces(texels: int, share: float) -> None:
    cells = random_cells(11, share)
    faces = layout(cells, texels=texels)
    pages = of_pages(faces)
    filled = shown(faces, np.random.default_rng(0).random(faces.size[::-1]))
    seams = 0
    for (x, y, z, face), (column, row) in pages.items():
        axis = face // 2
        for side, other in ((0, (axis + 1) % 3), (1, (axis + 2) % 3)):
            beside = [x, y, z]
            beside[other] += 1
            if (*beside, face) not in pages:
                continue
            next_column, next_row = pages[(*beside, face)]
            for at in np.linspace(0, texels, 4 * texels + 1):
                here, there = [texels, at], [0.0, at]
                if side:
                    here, there = here[::-1], there[::-1]
                one = bilinear(filled, column + here[0], row + here[1])
                two = bilinear(filled, next_column + there[0], next_row + there[1])
                # Float64 of numbers below 1
                assert abs(one - two) < 1e-12
                seams += 1
    assert seams > 500


@pytest.mark.parametrize("texels", [1, 2])
def test_no_light_crosses_an_edge(texels: int) -> None:
    """Each plane in a colour of its own: a lookup anywhere on a face finds that colour alone."""
    cells = random_cells(7, 0.6)
    faces = layout(cells, texels=texels)
    rows, _, _, x, y = faces.interior
    r = faces.rectangles[rows]
    colour = np.full(faces.size[::-1], np.nan)
    colour[y, x] = r["axis"] * 1000 + r["sign"] * 100 + r["plane"]
    filled = shown(faces, colour)
    for one in faces.rectangles:
        wide, high = one["width"] * texels, one["height"] * texels
        around = filled[one["y"] - 1 : one["y"] + high + 1, one["x"] - 1 : one["x"] + wide + 1]
        assert np.all(around == around[1, 1])


def test_gutters_beyond_an_edge_copy_the_edge() -> None:
    # Two faces in one plane with a gap between them share nothing
    cells = np.zeros((1, 1, 3), np.uint16)
    cells[0, 0, ::2] = 1
    faces = layout(cells, texels=2)
    source = faces.source()
    for r in faces.rectangles:
        around = source[r["y"] - 1 : r["y"] + 3, r["x"] - 1 : r["x"] + 3]
        inner = np.clip(np.arange(4), 1, 2) - 1
        assert np.array_equal(around[..., 0], np.broadcast_to(r["x"] + inner, (4, 4)))
        assert np.array_equal(around[..., 1], np.broadcast_to(r["y"] + inner[:, None], (4, 4)))


def test_vertices_stand_on_the_faces_and_run_round_them() -> None:
    faces = layout(random_cells(2), texels=2, cell_size=0.25, origin=(-1.0, 0.5, 2.0))
    position, normal, uv = faces.vertices()
    p, n = position.reshape(-1, 4, 3).astype(float), normal.reshape(-1, 4, 3)
    assert np.all(n == n[:, :1])
    across = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    area = 0.25**2 * faces.rectangles["width"] * faces.rectangles["height"]
    # float32 positions of size 3
    assert np.allclose(across, n[:, 0] * area[:, None], atol=1e-6)
    # A texel's centre, by the corners' atlas coordinates, is where `positions` says
    size = np.array(faces.size)
    corner = uv.reshape(-1, 4, 2) * size
    place = faces.positions()
    for r, where, at in zip(faces.rectangles, p, corner, strict=True):
        first = np.array([r["x"], r["y"]])
        low, high = np.argmin(at.sum(axis=1)), np.argmax(at.sum(axis=1))
        assert np.allclose(at[low], first, atol=1e-4)
        extent = at[high] - at[low]
        middle = place[r["y"], r["x"]]
        share = np.array([0.5, 0.5]) / extent
        axis = r["axis"]
        assert abs(middle[axis] - where[0, axis]) < 1e-6
        for k in (0, 1):
            i = (axis + 1 + k) % 3
            expected = where[low, i] + share[k] * (where[high, i] - where[low, i])
            assert abs(middle[i] - expected) < 1e-5


def test_a_large_town_takes_seconds() -> None:
    rng = np.random.default_rng(1)
    cells = np.zeros((128, 128, 128), np.uint16)
    cells[:, :4] = 1
    for _ in range(200):
        x, z = rng.integers(0, 120, 2)
        wide, deep = rng.integers(4, 24, 2)
        cells[z : z + deep, 4 : rng.integers(6, 64), x : x + wide] = 1
    began = time.perf_counter()
    faces = layout(cells, texels=2)
    # .15 s measured on one core; a loop over its faces takes a minute
    assert time.perf_counter() - began < 5
    used = np.sum((faces.rectangles["width"] * 2 + 2) * (faces.rectangles["height"] * 2 + 2))
    # Shelves of falling height: 94 % measured
    assert used / (faces.size[0] * faces.size[1]) > 0.85


@pytest.mark.parametrize(
    ("cells", "texels", "named"),
    [
        (np.zeros((2, 2, 2), np.uint16), 1, "cells"),
        (cell_worlds.room(1), 0, "texels"),
        (cell_worlds.room(1), 65, "texels"),
        ([cell_worlds.room(1), cell_worlds.room(2)], 1, "cells"),
        (np.ones((2, 2), np.uint16), 1, "cells"),
    ],
)
def test_what_cannot_be_laid_out_is_refused(
    cells: NDArray[np.uint16], texels: int, named: str
) -> None:
    with pytest.raises(InputError) as refused:
        layout(cells, texels=texels)
    assert refused.value.field == named


def test_an_atlas_has_a_largest_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(voxel_faces, "MAX_SIDE", 32)
    with pytest.raises(InputError, match="lower the texels"):
        layout(random_cells(3), texels=4)
