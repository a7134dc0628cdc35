"""Sprites among cubes against maps, balls and suns that light them without any cubes."""

from __future__ import annotations

import numpy as np
import pytest

from bake import voxel_faces
from formats.billboard import Ring
from formats.lightmap import Lightmap
from formats.voxel_state import at_floor
from formats.voxels import Voxels
from maths.transforms import latlong_direction, normalise
from runtime import lighting, probe_places, sprite_probes
from runtime.dome_series import DomeSeries
from runtime.passes import probe
from runtime.player import Player
from tests.runtime import domes

CELL = 0.5
RINGS = {
    "view": Ring(axis="view", elevation=0.5, terms=5, one_sided=False),
    "front": Ring(axis="view", elevation=0.5, terms=5, one_sided=True),
    "up": Ring(axis="up", elevation=0.3, terms=7, one_sided=False),
}
EVERY = [*RINGS, "dome"]
every_kind = pytest.mark.parametrize("kind", EVERY)


def series_of(kind):
    if kind == "dome":
        return DomeSeries(domes.matt_ball(size=16))
    return lighting.RingSeries(RINGS[kind])


def world(cells, emission=(0.0, 0.0, 0.0)):
    table = np.float32([[0, 0, 0], emission])
    albedo = np.float32([[0, 0, 0], [0.5, 0.5, 0.5]])
    return Voxels(np.asarray(cells, np.uint16), albedo, table, CELL)


def dark(voxels):
    placed = at_floor(voxels, (0.0, 0.0, 0.0))
    place = {"cell_size": placed.cell_size, "origin": placed.origin}
    faces = voxel_faces.layout(placed.cells, texels=1, **place)
    empty = np.zeros((faces.size[1], faces.size[0], 3), np.float32)
    return Lightmap(empty, empty, faces)


@pytest.fixture
def among(ctx, write_scene):
    """Return among(voxels, ...) -> SpriteLighting in those cubes, and the scene's lights."""
    players = []

    def make(voxels, *, lights=(), environment=None, by="lightmap", **more):
        raw = {
            "format": 1,
            "camera": {"position": [0, 1, 5], "target": [0, 0, 0]},
            "lights": list(lights),
            "voxels": {"source": "a.vox", "cell_size": CELL, **more},
        }
        called = (by, "probe", "voxels", "film")
        called = called if environment is None else ("environment", *called)
        folder = write_scene(
            raw,
            {"world": voxels, "light": dark(voxels)},
            called=called,
            environment=environment,
            name=f"scene{len(players)}",
        )
        player = Player(folder, size=(16, 16), context=ctx)
        players.append(player)
        made = lighting.SpriteLighting()
        made.surround(sprite_probes.SpriteProbes(player.passes["probe"]))
        return made, player.lights

    yield make
    for player in players:
        player.close()


def lit(projector, lights, series, yaw, centres, flip=None, shares=()):
    centres = np.asarray(centres, float)
    flip = np.zeros(len(centres), bool) if flip is None else np.array(flip)
    rows, index = projector.project(lights, series, yaw, centres, flip, shares)
    return rows[index]


def size_of(rows):
    return np.sqrt(np.mean(rows**2))


def directions(rows):
    u, v = ((np.arange(n) + 0.5) / n for n in (2 * rows, rows))
    return latlong_direction(np.stack(np.meshgrid(u, v), axis=-1))


def smooth(d, tint):
    """A map with harmonics up to l = 2."""
    x, y, z = np.moveaxis(d, -1, 0)[..., None]
    return 1.5 + tint[0] * x + tint[1] * y + tint[2] * z + 0.5 * x * y - 0.3 * z * z


@every_kind
@pytest.mark.gpu
def test_a_map_past_the_cubes_lights_as_the_map_by_itself(among, rng, kind):
    """Far above the only cell; turned cameras, mirrored sprites, a map scaled and turned."""
    tint = rng.uniform(-0.3, 0.3, (3, 3))
    radiance, fine = (smooth(directions(rows), tint) for rows in (64, 256))
    light = {"type": "environment", "source": "a.hdr", "scale": [2.0, 1.0, 0.5], "rotate": 40.0}
    made, lights = among(
        world(np.ones((1, 1, 1))), lights=[light], environment=radiance.astype(np.float32)
    )
    series, turn = series_of(kind), np.radians(40.0)
    place = [[0.0, 60.0, 0.0], [3.0, 50.0, -8.0]]
    for yaw in (0.0, 0.9, -2.4):
        found = lit(made, lights, series, yaw, place, [False, True])
        truth = series.environment(fine, yaw - turn) * [2.0, 1.0, 0.5]
        truth = series.constants(np.stack([truth, truth * series.mirror[:, None]]))
        # 1,024 rays in place of all directions: .5 % measured where they end at z = 0
        assert size_of(found - truth) < 0.01 * size_of(truth)


@every_kind
@pytest.mark.gpu
def test_a_room_that_glows_is_an_even_map(among, kind):
    cells = np.ones((6, 6, 6), int)
    cells[1:-1, 1:-1, 1:-1] = 0
    made, lights = among(world(cells, (0.6, 1.0, 0.2)))
    even = lighting.Lights((), (), (lighting.EnvironmentState(0, np.ones(3), 0.0),))
    alone, series = lighting.SpriteLighting(), series_of(kind)
    alone.take({0: np.full((64, 128, 3), (0.6, 1.0, 0.2))})
    places = np.array([[0, 1.5, 0], [0.9, 0.6, -0.9], [-0.3, 2.2, 0.4]])
    found = lit(made, lights, series, 0.7, places)
    truth = lit(alone, even, series, 0.7, places)
    # 128 places on the walls and the rays together: measured 1.3 %
    assert size_of(found - truth) < 0.02 * size_of(truth)


@every_kind
@pytest.mark.gpu
def test_a_lamp_is_a_ball_of_the_same_size(among, kind):
    lamp = {"position": [1.0, 2.25, 0.75], "radiance": [4.0, 2.0, 1.0], "side": 1}
    cells = np.zeros((8, 9, 12), int)
    cells[:, 0] = 1
    made, lights = among(world(cells), lamps=[lamp], by="gather")
    place = np.array([[-1.75, 2.25, 0.25], [0.2, 1.3, -0.4]])
    series = series_of(kind)
    ball = lighting.SphereState(
        np.array(lamp["position"]), probe.BALL * CELL, np.array(lamp["radiance"])
    )
    truth = lit(lighting.SpriteLighting(), lighting.Lights((), (ball,), ()), series, 0.4, place)
    np.testing.assert_allclose(lit(made, lights, series, 0.4, place), truth, atol=1e-9)
    # Found once more, and from elsewhere
    np.testing.assert_allclose(lit(made, lights, series, 0.4, place), truth, atol=1e-9)


SUN = {"type": "sun", "to_light": [0.3, 1.0, 0.2], "irradiance": [3.0, 2.0, 1.0]}
OTHERS = [
    {"type": "sphere", "position": [0.1, 1.6, 0.4], "radius": 0.2, "radiance": [3.0, 2.0, 1.0]},
    {
        "type": "disc",
        "position": [0.1, 2.2, 0.0],
        "facing": [0, -1, 0],
        "radius": 0.3,
        "radiance": [3.0, 2.0, 1.0],
    },
    {
        "type": "rectangle",
        "position": [0, 2.2, 0.1],
        "facing": [0, -1, 0.1],
        "size": [0.4, 0.3],
        "radiance": [1.0, 2.0, 3.0],
    },
]


@every_kind
@pytest.mark.gpu
def test_lights_are_as_without_cubes_where_nothing_hides_them(among, kind):
    made, lights = among(world(np.ones((8, 1, 8))), lights=[SUN, *OTHERS])
    place, series = [[0.0, 1.2, 0.0], [0.9, 0.9, -0.5]], series_of(kind)
    truth = lit(lighting.SpriteLighting(), lights, series, 0.4, place, [False, True])
    found = lit(made, lights, series, 0.4, place, [False, True])
    np.testing.assert_allclose(found, truth, atol=1e-9)
    # Shares of suns past other sprites count beside the cubes
    half = [np.array([0.5, 0.25])]
    truth = lit(lighting.SpriteLighting(), lights, series, 0.4, place, None, half)
    found = lit(made, lights, series, 0.4, place, None, half)
    np.testing.assert_allclose(found, truth, atol=1e-9)


@pytest.mark.gpu
def test_walls_hide_lights(among):
    cells = np.ones((8, 7, 8), int)
    cells[1:-1, 1:-1, 1:-1] = 0
    place, series = [[0.0, 1.2, 0.0], [0.9, 0.9, -0.5]], series_of("up")
    outside = [{**light, "position": [0.0, 6.0, 0.0]} for light in OTHERS]
    made, lights = among(world(cells), lights=[SUN, *outside])
    assert not lit(made, lights, series, 0.0, place).any()
    # A hole for the sun over one of the two
    cells[3:5, -1, 3:5] = 0
    made, lights = among(world(cells), lights=[{**SUN, "to_light": [0, 1, 0]}])
    found = lit(made, lights, series, 0.0, place)
    truth = lit(lighting.SpriteLighting(), lights, series, 0.0, place)
    np.testing.assert_allclose(found[0], truth[0], atol=1e-9)
    assert not found[1].any()


@pytest.mark.gpu
def test_many_sprites_share_points_and_are_nearly_as_alone(among, rng):
    """Two rooms side by side, one that glows: its light does not come through the wall."""
    cells = np.ones((10, 8, 21), int)
    cells[1:-1, 1:-1, 1:10] = cells[1:-1, 1:-1, 11:-1] = 0
    cells[4:6, 6, 3:5] = 2
    table, albedo = np.zeros((3, 3), np.float32), np.float32([[0] * 3, [0.5] * 3, [0.5] * 3])
    table[2] = 1.0
    made, lights = among(Voxels(cells.astype(np.uint16), albedo, table, CELL))
    low, high = np.array([-4.6, 0.6, -1.9]), np.array([4.6, 3.0, 1.9])
    places = rng.uniform(low, high, (400, 3))
    places = places[np.abs(places[:, 0]) > 0.3]
    series = series_of("view")
    whole = lit(made, lights, series, 0.3, places)
    at = made._cubes._at(series, places)
    assert len(at.points) <= 2 * probe_places.MOST
    each = np.concatenate([lit(made, lights, series, 0.3, p[None]) for p in places[::6]])
    glows = places[::6, 0] < 0
    assert not each[~glows].any()
    assert np.abs(whole[::6][~glows]).max() < 1e-6 * np.abs(each).max()
    # Measured .2: next to a lamp light is not linear in between
    off = np.linalg.norm((whole[::6] - each)[glows], axis=(1, 2))
    off /= np.linalg.norm(each[glows], axis=(1, 2))
    print("many", np.quantile(off, [0.5, 0.9]))
    # Measured: .21 and .51; without sharing out by what each sees of the lantern, 1 and 3
    assert np.quantile(off, 0.5) < 0.3
    assert np.quantile(off, 0.9) < 0.7


def test_one_sided_rings_fade_in_about_their_plane():
    series = series_of("front")
    x = np.array([-0.06, -0.05, 0.0, 0.05, 0.06])
    d = normalise(np.stack([1 + 0 * x, 0 * x, x], axis=-1))
    two_sided = lighting.RingSeries(RINGS["view"]).directions(d)
    share = series.directions(d)[:, 0] / two_sided[:, 0]
    np.testing.assert_allclose(share, [0, 0, 0.5, 1, 1], atol=2e-3)
