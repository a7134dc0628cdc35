"""The world on the card is that of its moment, whichever moments came before."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bake import voxel_faces
from formats.errors import DamagedError
from formats.lightmap import Lightmap
from formats.voxel_state import at_floor
from formats.voxels import Voxels
from runtime import cubes
from runtime.player import Player

pytestmark = pytest.mark.gpu
PALETTE = {
    "albedo": np.float32([[0, 0, 0], [0.5, 0.6, 0.7], [0.8, 0.2, 0.1]]),
    "emission": np.float32([[0, 0, 0], [0, 0, 0], [1, 2, 3]]),
}
SLIDE = {"times": [0, 1], "values": [[-1.0, 0.5, 0.0], [1.0, 0.5, 0.0]]}
FLY = {"times": [0, 1], "values": [[-1.0, 1.3, 0.1], [0.9, 1.1, 0.3]]}
LAMP = {"position": FLY, "radiance": [6.0, 3.0, 1.0], "side": 2}
PART = {"name": "part", "source": "b.vox", "position": SLIDE}


def floor():
    """10 x 6 x 6 cells of .5 m with a floor, and one that glows."""
    cells = np.zeros((6, 6, 10), np.uint16)
    cells[:, 0], cells[5, 1, 1] = 1, 2
    return Voxels(cells, **PALETTE, cell_size=0.5)


@pytest.fixture
def playing(ctx, write_scene):
    """Return play(...) -> a player of a scene with a part that slides, and other keys of voxels."""
    players = []

    def play(duration=1.0, environment=None, lights=(), **more):
        world = floor()
        placed = at_floor(world, (0.0, 0.0, 0.0))
        faces = voxel_faces.layout(placed.cells, texels=1, cell_size=0.5, origin=placed.origin)
        dark = np.zeros((faces.size[1], faces.size[0], 3), np.float32)
        raw = {
            "format": 1,
            "time": {"duration": duration, "frame_rate": 8},
            "camera": {"position": [0, 1, 5], "target": [0, 0, 0]},
            "lights": list(lights),
            "voxels": {"source": "a.vox", "cell_size": 0.5, "bodies": [PART], **more},
        }
        assets = {
            "world": world,
            "part": Voxels(np.full((1, 2, 2), 2, np.uint16), **PALETTE, cell_size=0.5),
            "light": Lightmap(dark, dark, faces),
        }
        first = () if environment is None else ("environment",)
        folder = write_scene(
            raw,
            assets,
            called=(*first, "lightmap", "voxels", "film"),
            environment=environment,
            name=f"scene{len(players)}",
        )
        players.append(Player(folder, size=(16, 16), context=ctx))
        return players[-1]

    yield play
    for player in players:
        player.close()


def on_card(world):
    """What rays read of every cell: texels (z, y, x, 4), and rows of the palette."""
    nx, ny, nz = world.volume.size
    raw = np.frombuffer(world.volume.world.read(), np.uint8).reshape(nz + 2, ny + 2, nx + 2, 4)
    rows = np.frombuffer(world.volume.rows.read(alignment=1), np.uint16).reshape(nz, ny, nx)
    assert (raw[0, ..., 3] == 255).all()
    return raw[1:-1, 1:-1, 1:-1], rows


def expected(world, time):
    """The same, cell by cell."""
    described, joined = world.described, world.world
    cells = joined.cells(joined.offsets(described.positions(time)))
    light = joined.voxels.emission[cells].astype(np.float64)
    solid = cells > 0
    for lamp in described.lamps if described.mode == "talk" else ():
        glow = joined.glow(lamp, cells, time)
        for (x, y, z), share in zip(glow.cells, glow.share, strict=True):
            light[z, y, x] += share * glow.radiance
            solid[z, y, x] = True
    scale = world.volume.scale
    texels = np.concatenate([np.rint(light / scale * 255), 255.0 * solid[..., None]], axis=-1)
    return texels, cells


@pytest.mark.parametrize("mode", ["exact", "talk"])
def test_the_card_holds_the_world_of_the_moment(playing, mode):
    """Among the cells lamps share out their light for the talk's way of gathering alone."""
    world = cubes.of(playing(lamps=[LAMP], mode=mode))
    for time in (0.0, 0.125, 0.5, 1.0, 0.25, 0.25, 0.0):
        world.at(time)
        texels, rows = on_card(world)
        truth, cells = expected(world, time)
        np.testing.assert_array_equal(rows, cells)
        # Lamp and cells of their own never meet; a code may round either way
        assert np.abs(texels - truth).max() <= 1
        np.testing.assert_array_equal(texels[..., 3], truth[..., 3])


def test_what_changes_is_told(playing):
    world = cubes.of(playing(lamps=[LAMP], mode="talk"))
    before = on_card(world)[0].copy()
    assert world.at(0.0) == []
    for time in (0.125, 0.5, 1.0):
        changes = world.at(time)
        after = on_card(world)[0].copy()
        told = np.zeros(before.shape[:3], bool)
        for change in changes:
            told[tuple(slice(a, b) for a, b in zip(change.low, change.high, strict=True))[::-1]] = 1
        differs = (before != after).any(axis=-1)
        assert differs.any()
        assert not (differs & ~told).any()
        # Not much more than that: boxes around what went and came
        assert told.sum() < 8 * differs.sum()
        assert world.at(time) == []
        before = after


def test_parts_stand_where_they_do_at_frames(playing):
    """8 frames a second; lamps move between them too."""
    world = cubes.of(playing(lamps=[]))
    states = [world.state(time) for time in (np.arange(80) + 0.5) / 80]
    assert all(states[k] == states[10 * (k // 10)] for k in range(80))
    assert len(set(states)) == len({world.state(k / 8) for k in range(8)}) == 5
    # After the end it stays; a still scene stands as at first
    assert world.state(7.0) == world.state(1.0)
    still = cubes.of(playing(duration=0.0, lamps=[LAMP]))
    assert still.state(0.3)[0] == still.state(0.0)[0]
    assert still.state(0.3) != still.state(0.0)


def test_the_state_is_that_of_its_moment_alone(playing):
    """Whatever the volume holds now; and lamps that light nothing are drawn all the same."""
    sunk = {"times": [0, 1], "values": [[-1, 0.25, 0], [1, 0.25, 0]]}
    within = {**LAMP, "position": sunk, "side": 1}
    world = cubes.of(playing(lamps=[LAMP, within]))
    before = world.state(0.5)
    world.at(1.0)
    assert world.state(0.5) == before
    alone = cubes.of(playing(lamps=[within], mode="talk"))
    assert alone.state(0.01) != alone.state(0.0)
    assert alone.volume.set_glow(alone._lamps(0.01)) == []


def test_light_that_comes_counts(playing):
    world = cubes.of(playing())
    key = world.key(0.0)
    assert world.key(0.0) == key
    world.lit += 1
    assert world.key(0.0) != key
    assert world.state(0.0) == key[0]


def test_all_environments_are_one_sky(playing, rng):
    light = {"type": "environment", "source": "a.hdr"}
    radiance = rng.random((16, 32, 3)).astype(np.float16).astype(np.float32)
    player = playing(environment=radiance, lights=[light])
    world = cubes.of(player)
    small = rng.random((8, 16, 3)).astype(np.float32)
    player.passes["environment"].maps[1] = small

    def state(index, factor, rotate=0.0):
        return SimpleNamespace(index=index, factor=np.array(factor), rotate=rotate)

    both = SimpleNamespace(environments=[state(0, [1.0, 2, 3]), state(1, [0.5, 0, 1], np.pi / 2)])
    found = world.sky(both)
    # A quarter turn is four columns of sixteen: what was at +x comes from -z
    turned = np.roll(small, -4, axis=1).repeat(2, axis=0).repeat(2, axis=1)
    np.testing.assert_allclose(found, radiance * [1, 2, 3] + turned * [0.5, 0, 1], rtol=1e-6)
    assert found.dtype == np.float32
    # Not made again while it stays the same
    assert world.sky(both) is found
    both.environments[0].factor = np.array([2.0, 2.0, 3.0])
    assert world.sky(both) is not found
    assert world.sky(SimpleNamespace(environments=[])) is None
    assert cubes.of(playing()).sky(both) is None


def test_one_world_for_all_passes(playing):
    player = playing()
    assert cubes.of(player) is cubes.of(player) is player.passes["voxels"].cubes


@pytest.mark.parametrize("missing", ["voxels/part", "voxels/world", "lightmap/world"])
def test_a_missing_asset_is_told(playing, missing):
    player = playing()
    del player._assets[missing]
    player._shared.clear()
    with pytest.raises(DamagedError, match=rf"assets\.{missing}.*bake it again"):
        cubes.of(player)


def test_lamps_stand_anywhere_but_in_baked_light(playing):
    lamp = {**LAMP, "position": [0.3, 1.3, 0.1], "side": 1}
    world = cubes.of(playing(lamps=[lamp]))
    described = world.described.lamps[0]
    # 10 x 6 x 6 cells of .5 m from (-2.5, 0, -1.5): the one that holds it
    assert world.middle(described, 0.0).tolist() == [0.25, 1.25, 0.25]
    (free,) = world.free_lamps(0.0)
    assert (free.middle, free.half_side, free.radiance) == ((5.5, 2.5, 3.5), 0.5, (6.0, 3.0, 1.0))
    world._gathered = True
    assert world.middle(described, 0.0).tolist() == [0.3, 1.3, 0.1]
