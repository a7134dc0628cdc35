"""Layers of a frame: the picture stays as it is, and each is what its name says."""

import numpy as np
import pytest

from formats.errors import InputError
from formats.mesh import Material
from runtime.layers import CHANNELS, FAR, Layers
from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = (64, 36)
CAMERA = {"position": [0, 1, 4], "target": [0, 0.8, 0], "focal_length_mm": 50}
GROUND = {"height": 0.0, "albedo": [0.35, 0.3, 0.2], "accent": [0.1, 0.2, 0.05], "scale": 0.3}
SKY = {"zenith": [0.2, 0.4, 0.9], "horizon": [0.8, 0.8, 0.9]}
LENS = {"f_number": 1.4, "focus_distance": 3.0}


@pytest.fixture
def scene(kit, write_scene):
    """Return scene(**tables) -> folder: a square that faces +z at z = -1, two balls, a ground."""

    def made(**more):
        board = {"name": "board", "source": "meshes/board.glb", "position": [0, 1, -1]}
        raw = kit.scene_dict(meshes=[board], ground=GROUND, camera=CAMERA)
        raw["billboards"][0]["positions"] = [[-0.6, 0, 0.5], [0.5, 0, -2]]
        raw["picture"]["sky"] = SKY
        raw = {key: value for key, value in (raw | more).items() if value is not None}
        assets = {"ball": kit.sphere_asset(), "board": kit.quad(Material(), half=0.5)}
        return write_scene(raw, assets, name=f"scene{len(more)}")

    return made


@pytest.mark.parametrize("lens", [None, LENS])
def test_the_picture_stays_as_it_is(scene, ctx, lens):
    folder = scene(camera={**CAMERA, **({"lens": lens} if lens else {})})
    with Player(folder, size=SIZE, context=ctx) as player:
        plain = player.linear(0.0)[..., :3]
        taken = Layers(player, tuple(CHANNELS))
        assert np.array_equal(taken.take(0.0)["beauty"], plain)
        # Nor does a frame that takes up what is drawn already
        again = taken.take(0.0)
        assert np.array_equal(again["beauty"], plain)
        taken.remove()
        assert np.array_equal(player.linear(0.0)[..., :3], plain)
        assert not [name for name in player.passes if name.startswith("layer")]


def test_what_is_not_asked_for_costs_nothing(scene, ctx):
    folder = scene()
    counts = []
    for names in ((), ("depth",), ("normal",)):
        with Player(folder, size=SIZE, context=ctx) as player:
            Layers(player, names).take(0.0)
            counts.append((player.programs.count, player.targets.texture_count))
    # Depth is there anyway; geometry has a program and three targets
    assert counts[1] == counts[0]
    assert counts[2] == (counts[0][0] + 1, counts[0][1] + 3)


def test_places_normals_and_numbers_are_those_of_the_scene(scene, ctx):
    with Player(scene(), size=SIZE, context=ctx) as player:
        found = Layers(player, ("position", "normal", "id", "depth")).take(0.0)
        camera = player.view
    board = found["id"][..., 0] == 1
    # The square is 1 m at 5 m: 50 / 24 / 5 of the height, squared; edges count by their middles
    assert abs(board.sum() - (36 * 50 / 24 / 5) ** 2) < 2 * 15
    assert np.abs(found["position"][board][:, 2] + 1).max() < 1e-5
    assert np.abs(found["position"][board][:, :2] - [0, 1]).max() <= 0.5
    assert np.abs(found["normal"][board] - [0, 0, 1]).max() < 1e-3
    ground = (np.abs(found["normal"] - [0, 1, 0]).max(axis=-1) < 1e-6) & ~board
    assert ground.sum() > 100
    assert np.abs(found["position"][ground][:, 1]).max() < 1e-6
    sky = ~board & ~ground
    assert np.all(found["position"][sky] == 0)
    # Both say how far: a sample may lie half a pixel beside the middle, at edges on something else
    along = camera.depth(found["position"].astype(np.float64))
    depth = found["depth"][..., 0]
    assert np.median(np.abs(along / depth - 1)[board]) < 2e-3
    assert np.median(np.abs(along / depth - 1)[ground]) < 2e-2
    assert np.mean(depth[sky] == FAR) > 0.98


def test_sprites_over_the_opaque_picture_are_the_picture(scene, ctx):
    with Player(scene(), size=SIZE, context=ctx) as player:
        found = Layers(player, ("opaque", "sprites", "before_post")).take(0.0)
    sprites = found["sprites"]
    assert 0 < np.mean(sprites[..., 3] > 0.5) < 0.5
    over = sprites[..., :3] + (1 - sprites[..., 3:]) * found["opaque"]
    # Half floats of two sums: 2^-11 of the larger, twice
    assert np.abs(over - found["before_post"]).max() <= 2**-10 * found["before_post"].max()
    assert np.array_equal(found["before_post"], found["beauty"])


def test_coverage_is_the_share_of_opaque_samples(scene, ctx):
    folder = scene(ground=None, picture={"sky": SKY})
    with Player(folder, size=SIZE, context=ctx) as player:
        coverage = Layers(player, ("coverage",)).take(0.0)["coverage"]
        samples = player.targets.samples
    shares = np.unique(coverage)
    assert set(shares) <= {n / samples for n in range(samples + 1)}
    assert len(shares) > 2
    # Area in pixels: each pixel of the edge, 60 of them, is off by at most an eighth of one
    assert abs(coverage.sum() - (36 * 50 / 24 / 5) ** 2) < 60 / 8


def test_an_unknown_layer_is_an_input_error(scene, ctx):
    player = Player(scene(), size=SIZE, context=ctx)
    with player, pytest.raises(InputError, match="coverage"):
        Layers(player, ("covrage",))
