"""Parts snap to cells, lamps share their light out, and nothing outside the world matters."""

from dataclasses import replace

import numpy as np
import pytest

from formats.errors import InputError
from formats.keyed import Keyed
from formats.voxel_state import World, at_floor
from formats.voxel_world import VoxelLamp
from formats.voxels import Voxels

PALETTE = {
    "albedo": np.float32([[0, 0, 0], [0.5, 0.5, 0.5], [0.8, 0.2, 0.1]]),
    "emission": np.float32([[0, 0, 0], [0, 0, 0], [1, 2, 3]]),
}


def volume(cells, **more):
    return Voxels(np.asarray(cells, np.uint16), **PALETTE, **more)


@pytest.fixture
def floor():
    """8 x 4 x 6 cells of .5 m with a floor."""
    cells = np.zeros((6, 4, 8), np.uint16)
    cells[:, 0] = 1
    return volume(cells, cell_size=0.5)


def keyed(values):
    return Keyed.hold(values)


def test_a_volume_stands_on_the_middle_of_its_underside(floor):
    assert at_floor(floor, (1.0, 2.0, 3.0)).origin == (-1.0, 2.0, 1.5)


def test_parts_snap_to_cells_and_bring_their_own_palette(floor):
    door = volume(np.full((1, 2, 1), 2), cell_size=0.5)
    world = World(floor, [door])
    places = [((0.25, 0.5, 0.25),), ((0.49, 0.4, 0.3),), ((0.74, 0.5, 0.25),), ((0.25, 0.5, 0.25),)]
    assert world.states(places) == [((4, 1, 3),), ((5, 1, 3),)]
    cells = world.cells(world.offsets(places[0]))
    # Rows of the part follow those of the world
    assert np.argwhere(cells == 4).tolist() == [[3, 1, 4], [3, 2, 4]]
    assert world.voxels.emission[4].tolist() == [1, 2, 3]
    assert np.array_equal(cells[:, 0], floor.cells[:, 0])


@pytest.mark.parametrize("offset", [(-1, -1, -1), (7, 3, 5), (-20, 0, 0), (8, 0, 0), (3, 3, 3)])
def test_a_part_that_leaves_the_world_is_cut_off(floor, offset):
    part = volume(np.full((2, 2, 2), 2), cell_size=0.5)
    world = World(floor, [part])
    found = world.cells([offset]) == 4
    expected = np.zeros_like(found)
    for z, y, x in np.ndindex(2, 2, 2):
        at = np.array([z, y, x]) + offset[::-1]
        if np.all((at >= 0) & (at < found.shape)):
            expected[tuple(at)] = True
    assert np.array_equal(found, expected)


@pytest.mark.parametrize("side", [1, 2, 3])
def test_a_lamp_keeps_its_light_wherever_it_is(side):
    """In the open the shares add up to its volume in cells, and their middle is its own."""
    empty = volume(np.zeros((16, 16, 16)), cell_size=0.5)
    rng = np.random.default_rng(1)
    for _ in range(20):
        position = rng.uniform([-1.5, 2.0, -1.5], [1.5, 6.0, 1.5])
        lamp = VoxelLamp(position=keyed(position), radiance=keyed((1.0, 2.0, 3.0)), side=side)
        world = World(empty)
        glow = world.glow(lamp, world.voxels.cells, 0.0)
        assert glow.share.sum() == pytest.approx(side**3, rel=1e-12)
        middles = (glow.cells + 0.5) * 0.5 + world.voxels.origin
        found = (glow.share @ middles) / side**3
        np.testing.assert_allclose(found, position, atol=1e-12)
        assert glow.radiance.tolist() == [1, 2, 3]


def test_light_of_a_lamp_in_a_wall_or_outside_is_lost(floor):
    lamp = VoxelLamp(position=keyed((0.25, 0.25, 0.25)), radiance=keyed((1.0, 1.0, 1.0)))
    inside = World(floor).glow(lamp, floor.cells, 0.0)
    assert inside.share.sum() == 0
    far = replace(lamp, position=keyed((1e6, 0.0, -1e6)))
    outside = World(floor).glow(far, floor.cells, 0.0)
    assert len(outside.cells) == 0


def test_the_world_has_room_for_its_lamps(floor):
    """8 x 4 x 6 cells of .5 m; a lamp of two cells a side from (1, 1, 0) to (3.1, 2.2, 0)."""
    way = (1.0, 1.0, 0.0), (3.1, 2.2, 0.0), 2
    grown = World(floor, (), (0.0, 0.0, 0.0), [way])
    # Up to x = 3.6 and y = 2.7: from 2 m four cells more, from 2 m two
    assert grown.voxels.size == (12, 6, 6)
    assert grown.voxels.origin == at_floor(floor, (0.0, 0.0, 0.0)).origin
    assert np.array_equal(grown.voxels.cells[:, :4, :8], floor.cells)
    assert not grown.voxels.cells[:, 4:].any()
    assert not grown.voxels.cells[:, :, 8:].any()
    end = VoxelLamp(position=keyed(way[1]), radiance=keyed([1, 1, 1]), side=2)
    assert grown.glow(end, grown.voxels.cells, 0.0).share.sum() == pytest.approx(8)
    # To lower sides the origin goes along; what lies within stays where it is
    lower = World(floor, (), (0.0, 0.0, 0.0), [((-2.5, -0.25, 0.0), (0.0, 0.0, 0.0), 1)])
    assert lower.voxels.size == (10, 5, 6)
    assert lower.voxels.origin == (-3.0, -0.5, -1.5)
    assert np.array_equal(lower.voxels.cells[:, 1:, 2:], floor.cells)
    # One that touches the side adds nothing, whichever way its place rounds
    inside = World(floor, (), (0.1, 0.2, 0.3), [((0.1 + 1.75, 1.95, 0.3),) * 2 + (1,)])
    assert inside.voxels.size == floor.size


@pytest.mark.parametrize("place", [(300.0, 1.0, 0.0), (0.0, 1e6, 0.0), (200.0, 200.0, 200.0)])
def test_lamps_too_far_away_are_refused(floor, place):
    with pytest.raises(InputError, match="keep them near"):
        World(floor, (), (0.0, 0.0, 0.0), [((0.0, 0.0, 0.0), place, 1)])


def test_parts_that_never_are_within_are_told(floor):
    """One below the floor, one that passes through, one whose box alone reaches in."""
    hollow = np.full((1, 2, 3), 2)
    hollow[0, :, 0] = 0
    parts = [volume(cells, cell_size=0.5) for cells in (np.full((1, 1, 1), 2),) * 2 + (hollow,)]
    world = World(floor, parts)
    gone, there = (0, -5, 0), (3, 1, 2)
    assert world.outside([(gone, gone, (7, 1, 2)), (gone, there, (7, 1, 2))]) == [0, 2]
    assert world.outside([(there, there, (6, 1, 2))]) == []


def test_too_many_colours_are_refused(floor):
    full = np.zeros((1 << 16, 3), np.float32)
    with pytest.raises(InputError, match="65,538 colours"):
        World(replace(floor, albedo=full, emission=full), [volume([[[1]]])])


@pytest.mark.parametrize("side", [1, 2, 3])
def test_a_snapped_lamp_fills_whole_cells(side, rng):
    """Whatever the world's origin and the size of its cells."""
    for _ in range(20):
        cell = float(rng.uniform(0.03, 3.0))
        empty = volume(np.zeros((12, 12, 12)), cell_size=cell)
        world = World(empty, (), tuple(rng.uniform(-50, 50, 3)))
        place = world.voxels.origin + rng.uniform(3, 9, 3) * cell
        snapped = world.snapped(place, side)
        assert np.abs(snapped - place).max() <= cell / 2 * (1 + 1e-9)
        glow = world.glow(
            VoxelLamp(position=keyed(snapped), radiance=keyed([1, 1, 1]), side=side),
            world.voxels.cells,
            0.0,
        )
        assert len(glow.cells) == side**3
        np.testing.assert_allclose(glow.share, 1.0)
