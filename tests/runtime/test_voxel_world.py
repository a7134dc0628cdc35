"""Worlds of cubes on the card: updates equal a fresh upload and cost little; lamps' shares."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from formats.voxels import Voxels
from maths.voxel_traversal import distances
from runtime.voxel_lamps import PAGE, Lamps, exposed
from runtime.voxel_world import STORAGES, VoxelVolume

pytestmark = pytest.mark.gpu


@dataclass
class Glow:
    cells: np.ndarray
    share: np.ndarray
    radiance: np.ndarray


def world(rng, size=(19, 10, 13)):
    cells = (rng.random(size[::-1]) < 0.2) * rng.integers(1, 4, size[::-1])
    emission = np.array([[0, 0, 0], [0, 0, 0], [4, 2, 1], [0, 0, 3]], np.float32)
    albedo = np.array([[0] * 3, [0.5] * 3, [0.2] * 3, [0.1] * 3], np.float32)
    return Voxels(cells.astype(np.uint16), albedo, emission)


def contents(volume):
    """What the card holds."""
    found = [volume.rows.read(), volume.gaps.read()]
    if volume.storage != "bc1_array":
        found.append(volume.world.read())
    return found


@pytest.mark.parametrize("storage", STORAGES)
def test_updates_are_a_fresh_upload(ctx, rng, storage):
    voxels = world(rng)
    volume = VoxelVolume(ctx, voxels, storage=storage, brightest=4.0, gaps=True)
    for _ in range(4):
        low = rng.integers(0, 8, 3)
        high = low + rng.integers(1, 6, 3)
        cells = volume.cells.copy()
        inside = tuple(slice(a, b) for a, b in zip(low[::-1], high[::-1], strict=True))
        cells[inside] = rng.integers(0, 4, cells[inside].shape)
        changes = volume.set_cells(cells, [(tuple(low), tuple(high))])
        assert len(changes) == 1
        assert volume.set_cells(cells, [(tuple(low), tuple(high))]) == []
        fresh = VoxelVolume(
            ctx, replace(voxels, cells=cells), storage=storage, brightest=4.0, gaps=True
        )
        np.testing.assert_array_equal(volume.texels, fresh.texels)
        assert contents(volume) == contents(fresh)
        np.testing.assert_array_equal(volume.glowing()[0], fresh.glowing()[0])
        fresh.release()
    # What lies outside of the world changes nothing
    assert volume.set_cells(volume.cells, [((30, 0, 0), (40, 5, 5))]) == []
    volume.release()


def test_lamps_come_and_go(ctx, rng):
    voxels = world(rng)
    volume = VoxelVolume(ctx, voxels, brightest=8.0, gaps=True)
    before = volume.texels.copy(), contents(volume)
    z, y, x = np.argwhere(voxels.cells == 0)[[5, 40]].T
    glow = Glow(np.stack([x, y, z], axis=1), np.array([0.25, 0.75]), np.array([8.0, 4.0, 0.0]))
    far = Glow(np.array([[99, 0, 0]]), np.ones(1), np.ones(3))
    changes = volume.set_glow([glow, far, glow])
    # Two lamps on one cell add up; full codes stand for 8
    codes = np.rint(2 * np.outer(glow.share, glow.radiance) / 8 * 255)
    np.testing.assert_array_equal(volume.texels[z, y, x, :3], np.minimum(codes, 255))
    assert np.all(volume.texels[z, y, x, 3] == 255)
    assert all(np.all(np.greater(c.high, c.low)) for c in changes)
    assert max(c.radiance for c in changes) == 8
    field = distances(np.pad(volume.solid, 1, constant_values=True))
    assert volume.gaps.read() == field.tobytes()
    assert len(volume.set_glow([])) > 0
    np.testing.assert_array_equal(volume.texels, before[0])
    assert contents(volume) == before[1]
    volume.release()


def test_a_moved_lamp_costs_a_hundredth_of_the_volume(ctx, rng):
    """Under a tenth; 2 cells that move by 3 are a box of 48."""
    cells = np.zeros((32, 32, 32), np.uint16)
    cells[:, 0] = 1
    voxels = Voxels(cells, np.zeros((2, 3), np.float32), np.zeros((2, 3), np.float32))
    for storage in STORAGES:
        volume = VoxelVolume(ctx, voxels, storage=storage, brightest=1.0)
        whole, share = volume.uploaded, np.array([0.5, 0.5])
        volume.set_glow([Glow(np.array([[5, 5, 5], [6, 5, 5]]), share, np.ones(3))])
        start = volume.uploaded
        volume.set_glow([Glow(np.array([[7, 6, 7], [8, 6, 7]]), share, np.ones(3))])
        assert volume.uploaded - start < whole / 100
        volume.release()


def test_lamps_have_the_share_of_their_power(ctx, rng):
    volume = VoxelVolume(ctx, world(rng))
    lamps = Lamps(ctx, lambda texture, size: texture, destinations=True)
    lamps.update(volume)
    cells, radiance = volume.glowing()
    faces, owner = exposed(cells, volume.solid)
    slow = 0
    for (x, y, z), row in zip(cells, range(len(cells)), strict=True):
        for axis in range(3):
            for step in (1, -1):
                at = np.array([x, y, z])
                at[axis] += step
                if np.all((at >= 0) & (at < volume.size)) and not volume.solid[tuple(at[::-1])]:
                    slow += 1
                    assert np.count_nonzero(owner == row)
    assert lamps.count == len(faces) == slow
    data = np.frombuffer(lamps.table.read(), np.uint32).reshape(-1, 4)[: lamps.count]
    stay = data[:, 1].view(np.float32)
    share = {}
    for (own, _, other, _), part in zip(data.tolist(), stay.tolist(), strict=True):
        share[own] = share.get(own, 0) + part / lamps.count
        share[other] = share.get(other, 0) + (1 - part) / lamps.count
    power = radiance @ [0.2126, 0.7152, 0.0722]
    expected = power[owner] / power[owner].sum()
    assert lamps.power == pytest.approx(power[owner].sum())
    # float32 parts
    np.testing.assert_allclose([share[f] for f in faces.tolist()], expected, rtol=1e-4)
    # Destinations: so many of the page as the cell has power, to one
    page = np.frombuffer(lamps.destinations.read(), np.float32).reshape(-1, 4)
    flat = page[:, :3].astype(int) @ [1, 1000, 1000000]
    counts = [np.count_nonzero(flat == cell @ [1, 1000, 1000000]) for cell in cells]
    np.testing.assert_allclose(counts, PAGE**2 * power / power.sum(), atol=1)
    lamps.table.release()
    lamps.destinations.release()
    volume.release()


def test_a_world_without_lamps(ctx):
    cells = np.ones((2, 2, 2), np.uint16)
    volume = VoxelVolume(ctx, Voxels(cells, np.zeros((2, 3), "f4"), np.zeros((2, 3), "f4")))
    lamps = Lamps(ctx, lambda texture, size: texture, destinations=True)
    lamps.update(volume)
    assert (lamps.count, lamps.power) == (0, 0.0)
    assert not np.frombuffer(lamps.destinations.read(), np.float32).any()
    lamps.table.release()
    lamps.destinations.release()
    volume.release()
