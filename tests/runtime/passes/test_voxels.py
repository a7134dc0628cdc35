"""A world of cubes against rays through its cells in numpy, pixel by pixel."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from bake import voxel_faces
from formats.lightmap import Lightmap
from formats.voxel_state import at_floor
from formats.voxels import Voxels
from maths import voxel_traversal
from runtime.player import Player

pytestmark = pytest.mark.gpu
HALF = 2.0**-11  # rounding to a half float
SIZE = (96, 64)
CAMERA = {"position": [2.1, 2.3, 3.0], "target": [0, 0.7, 0], "focal_length_mm": 40}
NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
FACE_LIGHT = np.array([[3, 1, 1], [1, 3, 1], [6, 6, 6], [1, 1, 3], [5, 4, 1], [1, 4, 5]], float)
SLOPE = np.array([0.3, 0.5, -0.4])


@pytest.fixture
def world():
    """7 x 6 x 8 cells of .25 m at random over a floor, three colours, one of which glows."""
    rng = np.random.default_rng(3)
    cells = np.where(rng.random((8, 6, 7)) < 0.25, rng.integers(1, 4, (8, 6, 7)), 0)
    cells[:, 0] = 1
    return Voxels(
        cells=cells.astype(np.uint16),
        albedo=np.float32([[0, 0, 0], [0.8, 0.7, 0.6], [0.5, 0.1, 0.1], [0.2, 0.3, 0.4]]),
        emission=np.float32([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0.4, 0.2, 0.1]]),
        cell_size=0.25,
    )


def lit(states, voxels, texels=2):
    """Faces of these states in light that is linear in space, and differs by the way they face."""
    faces = voxel_faces.layout(
        states, texels=texels, cell_size=voxels.cell_size, origin=voxels.origin
    )
    at, normal = np.nan_to_num(faces.positions()), faces.normals().astype(float)
    light = light_at(at, normal) * np.any(normal, axis=-1, keepdims=True)
    return Lightmap(light.astype(np.float32), np.zeros_like(light, np.float32), faces)


def light_at(at, normal):
    number = np.argmax(normal @ NORMALS.T, axis=-1)
    return np.maximum(FACE_LIGHT[number] + (at @ SLOPE)[..., None], 0.0)


def cast(player, voxels, cells, size=SIZE):
    """Numbers of what pixels see, (h, w): 6 cell + face, -1 for none; places and normals."""
    width, height = size
    x = 2 * (np.arange(width) + 0.5) / width - 1
    y = 1 - 2 * (np.arange(height) + 0.5) / height
    screen = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1).reshape(-1, 3)
    rays = screen @ player.view.world_from_ray(width / height).T
    eye = (player.view.position - voxels.origin) / voxels.cell_size
    # The eye is outside: rays begin where they enter the grid
    bounds = np.array(voxels.size, float)
    with np.errstate(divide="ignore"):
        ends = np.stack([(0 - eye) / rays, (bounds - eye) / rays])
    first, last = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
    enters = (first < last) & (first > 0)
    begin = eye + (np.where(enters, first, 0.0) + 1e-9)[:, None] * rays
    start = np.clip(np.floor(begin), 0, bounds - 1).astype(np.int64)
    hits = voxel_traversal.exact(cells > 0, start, begin, rays)
    nx, ny, _ = voxels.size
    inside = cells[start[:, 2], start[:, 1], start[:, 0]] > 0
    # Where the first cell is solid already, it was entered by the side of the grid
    side = 2 * np.argmax(ends.min(axis=0), axis=-1)
    side += rays[np.arange(len(rays)), side // 2] > 0
    face = np.where(inside, side, hits.face)
    cell = np.where(inside[:, None], start, hits.cell)
    at = begin + np.where(inside, 0.0, hits.t)[:, None] * rays
    seen = enters & (face >= 0)
    flat = cell[:, 0] + nx * (cell[:, 1] + ny * cell[:, 2])
    number = np.where(seen, 6 * flat + face, -1)
    metres = at * voxels.cell_size + voxels.origin
    normal = NORMALS[np.where(seen, face, 0)]
    shape = (height, width)
    return number.reshape(shape), metres.reshape(*shape, 3), normal.reshape(*shape, 3)


def within(number):
    """Pixels whose whole neighbourhood shows the same face of the same cell, or of none."""
    return (maximum_filter(number, 3) == minimum_filter(number, 3)) & (number >= 0)


def scene(**voxels):
    return {
        "format": 1,
        "camera": CAMERA,
        "time": {"duration": 1.0},
        "voxels": {"source": "a.vox", "cell_size": 0.25, **voxels},
        "picture": {"film": {"tonemap": "linear"}},
    }


def expected(voxels, cells, number, at, normal):
    row = cells.ravel()[np.maximum(number, 0) // 6]
    return voxels.albedo[row] / np.pi * light_at(at, normal) + voxels.emission[row]


def test_every_pixel_shows_its_face_in_its_light(ctx, write_scene, world):
    placed = at_floor(world, (0.0, 0.0, 0.0))
    light = lit(world.cells, placed)
    folder = write_scene(scene(), {"world": world, "light": light})
    with Player(folder, size=SIZE, context=ctx) as player:
        found = player.linear(0.0)[..., :3]
        number, at, normal = cast(player, placed, world.cells)
    sure = within(number)
    assert sure.sum() > 800
    truth = expected(placed, world.cells, number, at, normal)
    # At the edge of a rectangle light stays that of the outermost texel: half a texel further
    # on, the slope has added this much; half floats round light and picture once each
    edge = 0.98 / np.pi * np.abs(SLOPE).max() * 0.5 * 0.125 * np.sqrt(2)
    np.testing.assert_allclose(found[sure], truth[sure], rtol=2 * HALF, atol=edge)
    # Nothing is drawn where no cell is
    nothing = maximum_filter(number, 3) < 0
    assert nothing.any()
    assert not found[nothing].any()


def test_parts_are_drawn_where_they_are_now(ctx, write_scene, world):
    """A block slides by; texels of every state exist, faces only of the present one are seen."""
    cells = np.zeros_like(world.cells)
    cells[:, 0] = 1
    floor = Voxels(cells, world.albedo, world.emission, 0.25)
    part = Voxels(np.full((2, 2, 2), 2, np.uint16), world.albedo, world.emission, 0.25)
    way = {"times": [0, 1], "values": [[-0.25, 0.25, 0.25], [0.25, 0.25, 0.0]]}
    raw = scene(bodies=[{"name": "part", "source": "b.vox", "position": way}])
    placed = at_floor(floor, (0.0, 0.0, 0.0))
    states = []
    for x, z in ((2, 4), (4, 3)):
        state = cells.copy()
        state[z : z + 2, 1:3, x : x + 2] = 2
        states.append(state)
    # As the lightmap pass does: light that stays
    folder = write_scene(
        raw,
        {"world": floor, "part": part, "light": lit(states, placed)},
        called=("lightmap", "voxels", "film"),
    )
    edge = 0.98 / np.pi * np.abs(SLOPE).max() * 0.5 * 0.125 * np.sqrt(2)
    with Player(folder, size=SIZE, context=ctx) as player:
        for time, state in ((0.0, states[0]), (1.0, states[1]), (0.0, states[0])):
            found = player.linear(time)[..., :3]
            number, at, normal = cast(player, placed, state)
            sure = within(number)
            truth = expected(placed, state, number, at, normal)
            # Texels under the other state's block are not lit by this test's light alone
            np.testing.assert_allclose(found[sure], truth[sure], rtol=2 * HALF, atol=edge)


@pytest.mark.parametrize(
    ("light", "corner"),
    # Baked light has it fill whole cells: (.06, .81, .03) becomes (.125, .75, 0)
    [("gather", (-0.19, 0.56, -0.22)), ("lightmap", (-0.125, 0.5, -0.25))],
)
def test_a_lamp_is_a_cube_of_its_radiance_at_its_exact_place(
    ctx, write_scene, world, light, corner
):
    cells = np.zeros_like(world.cells)
    cells[:, 0] = 1
    floor = Voxels(cells, world.albedo, world.emission, 0.25)
    lamp = {"position": [0.06, 0.81, 0.03], "radiance": [7.0, 5.0, 3.0], "side": 2}
    lightmap = lit(cells, at_floor(floor, (0.0, 0.0, 0.0)))
    folder = write_scene(scene(lamps=[lamp], error=1.0), {"world": floor, "light": lightmap},
                         called=(light, "voxels", "film"))  # fmt: skip
    with Player(folder, size=SIZE, context=ctx) as player:
        found = player.linear(0.0)[..., :3]
        block = Voxels(np.ones((1, 1, 1), np.uint16), world.albedo, world.emission, 0.5, corner)
        number, _, _ = cast(player, block, block.cells)
    sure = minimum_filter(number, 3) >= 0
    assert sure.sum() > 50
    np.testing.assert_allclose(found[sure], np.broadcast_to([7.0, 5.0, 3.0], (sure.sum(), 3)))
