"""A pass whose inputs did not change is not run again, and nothing of the picture shows it."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.player import Player

pytestmark = pytest.mark.gpu
SIZE = (48, 27)
EVEN = np.ones((8, 16, 3), np.float32)
ALL = ("environment", "surface", "ground", "sky", "fog", "defocus", "billboard", "depth_of_field")


def steps(*values):
    """A value that jumps at whole seconds."""
    return {"times": list(range(len(values))), "values": list(values), "interpolation": "step"}


def described(kit, *, mesh=False, lens=True, **moving):
    """A scene of every effect; moving : what is keyed, by its place in the scene."""
    raw = kit.scene_dict(
        time={"duration": 8.0, "frame_rate": 10},
        ground={"albedo": [0.2, 0.3, 0.2]},
        picture={
            "sky": {"zenith": moving.get("zenith", [0.1, 0.2, 0.4]), "horizon": [0.9, 0.6, 0.4]},
            "fog": {"extinction": moving.get("extinction", 0.05), "radiance": [0.5, 0.5, 0.5]},
            "film": {"tonemap": "linear", "exposure": moving.get("exposure", 0.0)},
        },
    )
    if lens:
        raw["camera"]["lens"] = {"f_number": 1.4, "focus_distance": moving.get("focus", 2.0)}
    if mesh:
        raw["meshes"] = [
            {"name": "wall", "source": "meshes/w.glb", "position": moving.get("wall", [0, 0, -2])}
        ]
    raw["camera"]["position"] = moving.get("camera", [0, 0.5, 4])
    raw["lights"][0]["irradiance"] = moving.get("sun", [3, 3, 3])
    raw["lights"].append({"type": "environment", "source": "environments/e.hdr"})
    return raw


@pytest.fixture
def played(kit, write_scene, ctx):
    """Return played(raw) -> (a player that reuses, one that draws every pass of every frame)."""
    made = []

    def play(raw):
        assets = {"ball": kit.sphere_asset(size=16)}
        if raw.get("meshes"):
            assets["wall"] = kit.quad()
        folder = write_scene(raw, assets, environment=EVEN, name=f"scene{len(made)}")
        made.extend(Player(folder, size=SIZE, context=ctx) for _ in range(2))
        made[-1].reuse = False
        return made[-2], made[-1]

    yield play
    for player in made:
        player.close()


@pytest.mark.parametrize("mesh", [False, True])
def test_a_still_scene_asked_twice_draws_nothing(kit, played, mesh):
    player, plain = played(described(kit, mesh=mesh))
    first = player.frame(1.0)
    assert player.skipped == ()
    assert player.profile["draw_calls"] > 0
    second = player.frame(1.0)
    assert player.skipped == player.called
    assert player.profile["draw_calls"] == 0
    assert player.profile["skipped"] == list(player.called)
    np.testing.assert_array_equal(second, first)
    np.testing.assert_array_equal(plain.frame(1.0), first)
    assert plain.skipped == ()


@pytest.mark.parametrize(
    ("mesh", "lens", "moving", "stays"),
    [
        # The dither of the film differs in every frame, so that a still scene draws the film alone
        (False, True, {}, ALL),
        (True, True, {}, ALL),
        (False, True, {"exposure": steps(0, 1, -1, 2, 0, 1, 2, 3)}, ALL),
        (False, False, {"extinction": steps(*np.linspace(0.01, 0.2, 8))}, ALL[:4]),
        (False, False, {"zenith": steps(*np.linspace([0.1] * 3, [1.0] * 3, 8).tolist())}, ALL[:3]),
        # Samples of what is opaque are not copied: all of it or nothing
        (True, False, {"zenith": steps(*np.linspace([0.1] * 3, [1.0] * 3, 8).tolist())}, ()),
        (True, True, {"focus": steps(*np.linspace(1.0, 4.0, 8))}, ALL[:5]),
        # The ground blurs itself where no mesh stands
        (False, True, {"focus": steps(*np.linspace(1.0, 4.0, 8))}, ()),
        (False, True, {"camera": steps(*[[0.1 * n, 0.5, 4] for n in range(8)])}, ()),
        (True, True, {"wall": steps(*[[0.1 * n, 0, -2] for n in range(8)])}, ()),
        (False, True, {"sun": steps(*[[n, n, 3] for n in range(8)])}, ()),
    ],
    ids=[
        *("still", "still mesh", "exposure", "fog", "sky", "sky mesh", "focus mesh", "focus"),
        *("camera", "mesh", "sun"),
    ],
)
def test_what_comes_before_a_change_stays_and_every_byte_is_that_of_a_fresh_frame(
    kit, played, mesh, lens, moving, stays
):
    player, plain = played(described(kit, mesh=mesh, lens=lens, **moving))
    for time in range(8):
        np.testing.assert_array_equal(player.frame(float(time)), plain.frame(float(time)))
        if time >= 2:
            # Two frames alike before a copy is made, and the third starts from it
            assert player.skipped == tuple(name for name in player.called if name in stays)
    assert (player.targets.texture_count > plain.targets.texture_count) == (0 < len(stays) < 8)


@pytest.mark.parametrize("mesh", [False, True])
def test_any_order_of_frames_gives_the_bytes_of_fresh_ones(kit, played, rng, mesh):
    raw = described(
        kit,
        mesh=mesh,
        lens=mesh,
        extinction=steps(0.05, 0.05, 0.05, 0.2, 0.2, 0.3, 0.05, 0.05),
        zenith=steps(*[[c] * 3 for c in (0.1, 0.1, 0.1, 0.1, 0.5, 0.5, 0.1, 0.1)]),
        camera=steps(*[[c, 0.5, 4] for c in (0, 0, 0, 0, 0, 0, 0, 0.5)]),
    )
    player, plain = played(raw)
    skipped, time = set(), 0.0
    for count in range(60):
        time = float(rng.integers(0, 8)) if count % 3 == 0 else time + 0.1
        if count == 30:
            for each in (player, plain):
                each.targets.resize((40, 30))
        if rng.random() < 0.3:
            np.testing.assert_array_equal(player.linear(time), plain.linear(time))
        else:
            np.testing.assert_array_equal(player.frame(time), plain.frame(time))
        skipped.add(len(player.skipped))
    assert len(skipped) > 2


def test_a_camera_of_the_viewer_and_a_turned_sun_are_seen(kit, played):
    from dataclasses import replace

    player, plain = played(described(kit))
    for each in (player, plain):
        each.frame(0.0)
        each.frame(0.0)
        each.sun_turn = (0.5, 0.0)
    np.testing.assert_array_equal(player.frame(0.0), plain.frame(0.0))
    for each in (player, plain):
        # An array that is written to in place is another camera
        each.camera = replace(each.view, position=each.view.position.copy())
        each.frame(0.0)
        each.camera.position[0] += 0.25
    np.testing.assert_array_equal(player.frame(0.0), plain.frame(0.0))
    assert player.skipped == ()


@pytest.mark.parametrize("failing", ["ground", "fog", "billboard", "film"])
def test_a_frame_that_failed_is_drawn_again(kit, played, monkeypatch, failing):
    player, plain = played(described(kit, lens=False, extinction=steps(0.01, 0.2, 0.3)))
    player.frame(0.0)

    def fail(time):
        raise RuntimeError("lost")

    # This frame was to make a copy, which later ones would start from
    with monkeypatch.context() as patch:
        patch.setattr(player.passes[failing], "draw", fail)
        with pytest.raises(RuntimeError, match="lost"):
            player.frame(1.0)
    for time in (0.0, 1.0, 2.0, 1.0):
        np.testing.assert_array_equal(player.frame(time), plain.frame(time))


def test_a_pass_without_a_key_always_draws(kit, played):
    player, plain = played(described(kit))
    drawn = player.passes["fog"]

    class Always:
        reads, writes = drawn.reads, drawn.writes

        def __init__(self):
            self.count, self.uniforms = 0, drawn.uniforms

        def draw(self, time):
            self.count += 1
            drawn.draw(time)

    player.passes["fog"] = always = Always()
    for _ in range(4):
        np.testing.assert_array_equal(player.frame(0.0), plain.frame(0.0))
    assert always.count == 4
    assert player.skipped == ("environment", "ground", "sky")


def test_a_clear_is_not_left_out_where_nothing_drew_before(kit, write_scene, ctx):
    raw = kit.scene_dict(time={"duration": 4.0, "frame_rate": 10})
    raw["lights"][0]["irradiance"] = steps([3, 3, 3], [1, 1, 1], [2, 2, 2], [0, 0, 0])
    raw["lights"].append({"type": "environment", "source": "environments/e.hdr"})
    folder = write_scene(raw, {"ball": kit.sphere_asset(size=16)}, environment=EVEN)
    with (
        Player(folder, size=SIZE, context=ctx) as player,
        Player(folder, size=SIZE, context=ctx) as plain,
    ):
        plain.reuse = False
        for time in range(4):
            np.testing.assert_array_equal(player.frame(time), plain.frame(time))
            assert player.skipped == ()
