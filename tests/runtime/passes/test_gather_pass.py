"""Light that follows what moves: settled where time jumps, a few rays a frame where it goes on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bake import cubes as stage
from bake.lightmap_lights import Lamp
from formats.environment import Environment
from formats.voxels import Voxels
from maths.area_lights import rectangle_irradiance
from runtime.passes.gather import FIRST
from runtime.player import Player

pytestmark = pytest.mark.gpu
ERROR = 0.02
RATE = 24
PALETTE = {
    "albedo": np.float32([[0, 0, 0], [0.5, 0.6, 0.7], [0.7, 0.3, 0.2]]),
    "emission": np.float32([[0, 0, 0], [0, 0, 0], [0, 0, 0]]),
}
# It rests for half a second, goes for a quarter, and rests again: in cells that touch no wall
BEGIN, END = (-0.25, 1.25, 0.75), (1.75, 1.75, 0.25)
WAY = {"times": [0, 0.5, 0.75], "values": [BEGIN, BEGIN, END]}
LAMP = {"position": WAY, "radiance": [8.0, 4.0, 2.0]}


def room():
    """A floor, two walls and a pillar: 8 x 5 x 6 cells of .5 m."""
    cells = np.zeros((6, 5, 8), np.uint16)
    cells[:, 0], cells[0], cells[:, :, 0] = 1, 2, 1
    cells[3, 1:4, 4] = 2
    return Voxels(cells, **PALETTE, cell_size=0.5)


def params(**more):
    return stage.Params((0.0, 0.0, 0.0), texels=1, rays=4096, bounces=2, target=0.005, **more)


@pytest.fixture
def playing(ctx, write_scene):
    """Return play(...) -> a player of the room with a lamp; all are closed after the test."""
    players = []

    def play(world=None, *, lights=(), environment=None, roaming=False, texels=1, **more):
        world = room() if world is None else world
        layout = stage.light(world, params=stage.Params((0.0, 0.0, 0.0), texels=texels))
        raw = {
            "format": 1,
            "time": {"duration": 1.0, "frame_rate": RATE},
            "camera": {"position": [1, 2, 4], "target": [0, 0.8, 0]},
            "lights": list(lights),
            "voxels": {"source": "a.vox", "cell_size": 0.5, "texels": texels, "bounces": 2,
                       "error": ERROR, "lamps": [LAMP], **more},
        }  # fmt: skip
        first = () if environment is None else ("environment",)
        folder = write_scene(
            raw,
            {"world": world, "light": layout},
            called=(*first, "gather", "voxels", "film"),
            environment=environment,
            name=f"scene{len(players)}",
        )
        players.append(Player(folder, size=(32, 24), context=ctx, roaming=roaming))
        return players[-1]

    yield play
    for player in players:
        player.close()


def gathered(player):
    return player.passes["gather"].gather


def apart(found, truth, player):
    """Relative RMSE over the texels that have light."""
    used = player.passes["voxels"].cubes.faces.cell() >= 0
    return float(np.sqrt(np.mean((found[used] - truth[used]) ** 2) / np.mean(truth[used] ** 2)))


def lamp_at(place):
    return params(lamps=((place, (8.0, 4.0, 2.0), 1),))


def test_a_picture_by_itself_settles_and_is_not_gathered_again(playing):
    player = playing()
    first = player.frame(0.0)
    gather = gathered(player)
    assert gather.converged
    assert gather.error() <= ERROR
    done = gather.passes
    # That it has settled is news to the second frame, not to the third
    assert np.array_equal(player.frame(0.0), first)
    assert np.array_equal(player.frame(0.0), first)
    assert gather.passes == done
    assert set(player.skipped) >= {"gather", "voxels", "film"}
    # Within the error of rays of Embree, and of its own
    truth = stage.light(room(), params=lamp_at(BEGIN)).irradiance
    assert apart(gather.read(), truth, player) < 1.5 * ERROR


def test_a_smaller_error_takes_more_passes(playing):
    loose, fine = playing(error=0.1), playing(error=0.02)
    for player in (loose, fine):
        player.draw(0.0)
    assert gathered(fine).error() <= 0.02
    assert gathered(fine).passes > gathered(loose).passes


def test_a_jump_in_time_is_a_fresh_start(playing):
    jumped, fresh = playing(), playing()
    jumped.draw(0.0)
    for player in (jumped, fresh):
        player.draw(0.95)
        assert gathered(player).error() <= ERROR
    # Two errors that know nothing of each other, and what fading left: 2^-(64 / 4)
    assert apart(gathered(jumped).read(), gathered(fresh).read(), jumped) < 2 * ERROR
    truth = stage.light(room(), params=lamp_at(END)).irradiance
    assert apart(gathered(jumped).read(), truth, jumped) < 1.5 * ERROR
    # Back again, a little at a time, is as far
    jumped.draw(0.0)
    truth = stage.light(room(), params=lamp_at(BEGIN)).irradiance
    assert apart(gathered(jumped).read(), truth, jumped) < 1.5 * ERROR


def test_frames_are_the_same_in_every_player_with_and_without_reuse(playing):
    """Through rest, motion, and rest; what settled before the motion is no jump after it."""
    one, other, plain = playing(passes=16), playing(passes=16), playing(passes=16)
    plain.reuse = False
    passes = []
    for frame in range(6, RATE):
        pictures = [player.frame(frame / RATE) for player in (one, other, plain)]
        assert np.array_equal(pictures[0], pictures[1])
        assert np.array_equal(pictures[0], pictures[2])
        passes.append(gathered(one).passes)
        assert passes[-1] == gathered(plain).passes
    per_frame = np.diff(passes)
    # At rest until frame 12, in motion until 18
    assert not per_frame[: 12 - 6].any()
    assert (per_frame[13 - 6 : 18 - 6] == 16).all()
    assert per_frame.max() == 16


def test_light_settles_again_after_motion(playing):
    player = playing(passes=64)
    for frame in range(10, 10 + RATE):
        player.draw(min(frame / RATE, 1.0))
    for _ in range(40):
        player.draw(1.0)
    gather = gathered(player)
    assert gather.converged
    assert "gather" in player.skipped
    truth = stage.light(room(), params=lamp_at(END)).irradiance
    assert apart(gather.read(), truth, player) < 1.5 * ERROR


def test_what_touches_a_glowing_face_stays_bounded(playing):
    """Texels from a sixteenth of a cell on, before a wall of cells that glow."""
    cells = np.zeros((6, 3, 8), np.uint16)
    cells[:, 0], cells[:, 1:, 0] = 1, 2
    glowing = np.float32([[0, 0, 0], [0, 0, 0], [4, 2, 1]])
    world = Voxels(cells, PALETTE["albedo"], glowing, cell_size=0.5)
    player = playing(world, texels=8, bounces=0, lamps=[])
    player.draw(0.0)
    faces = player.passes["voxels"].cubes.faces
    at, found = np.nan_to_num(faces.positions()), gathered(player).read()[..., 0]
    up = faces.normals()[..., 1] > 0
    row = up & (np.abs(at[..., 2] - 0.5 / 16) < 1e-3) & (at[..., 0] > -1.5)
    point = at[row].astype(float)
    assert point[:, 0].min() == -1.5 + 0.5 / 16
    # The wall: 3 m wide, 1 m high above the floor; light from one side never exceeds half of pi L
    truth = rectangle_irradiance(
        point, [[0, 1.0, 0]], [-1.5, 1.0, 0.0], [0, 0, -1.5], [0, 0.5, 0], 4.0
    )
    assert truth.max() > 0.9 * 2 * np.pi
    assert found.max() < 2 * np.pi * (1 + 2 * ERROR)
    np.testing.assert_allclose(found[row], truth, rtol=4 * ERROR, atol=0.0)


def test_who_roams_sees_light_settle(playing):
    player = playing(roaming=True, passes=8)
    for frame in range(3):
        player.draw(0.0)
        assert gathered(player).passes == 8 * (frame + 1)


def test_lights_that_move_are_followed(playing):
    """A sun and a sphere that change, as Embree finds them at each moment."""
    to = {"times": [0, 1], "values": [[0.3, 1.0, 0.4], [-0.5, 1.0, 0.2]]}
    way = {"times": [0, 1], "values": [[0.5, 1.75, 1.0], [-1.0, 1.5, 0.5]]}
    sun = {"type": "sun", "to_light": to, "irradiance": [2.0, 1.5, 1.0], "angular_diameter": 8.0}
    ball = {"type": "sphere", "position": way, "radius": 0.2, "radiance": [4.0, 6.0, 9.0]}
    player = playing(lights=[sun, ball], lamps=[])
    for time in (0.0, 1.0, 0.5):
        player.draw(time)
        gather = gathered(player)
        assert gather.error() <= ERROR
        light, other = player.lights.suns[0], player.lights.spheres[0]
        lamps = (
            Lamp("sun", (2.0, 1.5, 1.0), tuple(light.to_light.tolist()), np.radians(4.0)),
            Lamp("sphere", (4.0, 6.0, 9.0), tuple(other.position.tolist()), 0.2),
        )
        truth = stage.light(room(), params=params(lights=lamps)).irradiance
        # Rays to lights bring little noise: what is left is that of light handed on, which the
        # told error leaves out. Measured .038 after 64 passes, .008 after 384
        assert apart(gather.read(), truth, player) < 2.5 * ERROR
    player.draw(0.5)
    assert player.draw(0.5) is None
    assert "gather" in player.skipped
    # Turned by hand, it shines from elsewhere at once
    player.sun_turn = (1.0, 0.0)
    player.draw(0.5)
    assert "gather" not in player.skipped


def test_an_environment_that_changes_is_followed(playing):
    scale = {"times": [0, 1], "values": [1.0, 3.0]}
    light = {"type": "environment", "source": "a.hdr", "scale": scale}
    player = playing(
        lights=[light], environment=np.ones((8, 16, 3), np.float32), lamps=[], bounces=0
    )
    # Texels on top of the pillar see the whole sky over them: E = pi L
    at = np.nan_to_num(player.passes["voxels"].cubes.faces.positions())
    top = np.linalg.norm(at - [0.25, 2.0, 0.25], axis=-1) < 0.1
    assert top.sum() == 1
    for time in (0.0, 1.0, 0.5):
        player.draw(time)
        found = gathered(player).read()
        low = found[top][0]
        # The back wall is a cell higher than the pillar and hides less than a tenth
        assert np.all(0.9 * np.pi * (1 + 2 * time) < low)
        assert np.all(low < np.pi * (1 + 2 * time) * (1 + ERROR))
    bright = gathered(player).read()
    knobs = replace(params(environments=(((2.0, 2.0, 2.0), 0.0),)), bounces=0)
    truth = stage.light(room(), Environment(np.ones((8, 16, 3), np.float32)), params=knobs)
    assert apart(bright, truth.irradiance, player) < 1.5 * ERROR


def test_a_player_in_haste_adds_a_pair_a_frame_and_waits_while_the_camera_moves(playing):
    player = playing(roaming=True, passes=32)
    gather = gathered(player)
    # Any pair takes longer
    player.haste = 1e-9
    for frame in range(3):
        player.draw(0.0)
        assert gather.passes == 2 * (frame + 1)
    for turn in range(3):
        player.camera = replace(player.view, target=player.view.target + 0.01 * (turn + 1))
        player.draw(0.0)
        assert gather.passes == 6
    player.draw(0.0)
    assert gather.passes == 8
    # Time enough for all that the scene wants
    player.haste = 100.0
    player.draw(0.0)
    assert gather.passes == 40


def test_the_first_frame_of_a_window_shows_at_once_and_settles_all_the_same(playing):
    player = playing(roaming=True, passes=32)
    gather = player.passes["gather"].gather
    seen = []
    for _ in range(60):
        player.frame(0.0)
        seen.append(gather.passes)
    assert seen[0] == FIRST
    assert seen[1] == FIRST + 32
    # Ends at the error as every still does, though 8 and 32 never add up to a multiple of 64
    assert seen[-1] == seen[-2]
    assert gather.converged
