"""Nothing grows: not over 1,000 frames of every effect, and not over 20 reloads."""

from __future__ import annotations

import ctypes
import gc
import os
from pathlib import Path

import numpy as np
import pytest

from runtime.capture import loader
from runtime.player import Player
from tests.runtime import domes

pytestmark = pytest.mark.gpu
SIZE = (32, 18)
FRAMES, RELOADS = 1000, 20
WARM = 300  # frames until everything there is was asked for once
KINDS = ("Texture", "Framebuffer", "Renderbuffer", "Buffer", "Program", "Shader", "VertexArray")
HIGHEST = 32768  # names of objects that are looked for: drivers give out the lowest free one
# Heaps grow by pages of their own: measured 2.1 MB over 700 frames, in two steps of 1 MB after 10
# and 350 frames, and 0.6 MB over 15 reloads. One page leaked a frame would make 2.9 MB; textures
# are counted besides
GROWTH = 2.6e6


@pytest.fixture
def every_effect(kit, write_scene):
    """A sealed scene that calls for every effect: all moves for 5 s, then only fog and exposure."""

    def over(first, last, still=True):
        values = [first, last, last if still else first]
        return {"times": [0.0, 5.0, 10.0], "values": values, "loop": True}

    places = {"height": 1.0, "positions": [[0, 0, 0], [1, 0, -1], [-1, 0, 1]]}
    raw = kit.scene_dict(
        time={"duration": 10.0, "frame_rate": 100},
        ground={"albedo": [0.2, 0.3, 0.2]},
        meshes=[
            {"name": "wall", "source": "meshes/w.glb", "position": over([0, 0, -2], [1, 0, 1])}
        ],
        billboards=[
            {"name": "ball", "source": "meshes/b.glb", **places},
            {"name": "bowl", "source": "meshes/c.glb", **places},
        ],
        picture={
            "sky": {"zenith": over([0.1] * 3, [0.4] * 3), "horizon": [0.9, 0.6, 0.4]},
            "fog": {"extinction": over(0.05, 0.1, still=False), "radiance": [0.5, 0.5, 0.5]},
            "radial_blur": {"strength": over(0.1, 0.3)},
            "bloom": {"strength": over(0.1, 0.3), "threshold": 0.2},
            "film": {"exposure": over(0.0, 1.0, still=False), "grain": 2.0},
        },
    )
    raw["camera"] |= {
        "position": over([0, 0.5, 4], [2, 0.7, 4]),
        "lens": {"f_number": 0.5, "focus_distance": over(2.0, 6.0)},
    }
    near = {"radiance": [1, 1, 1], "position": over([0, 2, 0], [1, 2, 0])}
    raw["lights"] += [
        {"type": "environment", "source": "environments/e.hdr"},
        {"type": "sphere", "radius": 0.2, **near},
        {"type": "disc", "radius": 0.2, "facing": [0, -1, 0], **near},
        {"type": "rectangle", "size": [1, 1], "facing": [0, -1, 0], **near},
    ]
    assets = {
        "ball": kit.sphere_asset(size=16),
        "bowl": domes.matt_ball(size=16),
        "wall": kit.quad(),
    }
    return write_scene(raw, assets, environment=np.ones((8, 16, 3), np.float32))


@pytest.fixture
def alive(ctx):
    """Return alive() -> kind -> number of OpenGL objects that the driver says exist."""
    load = loader(ctx)
    ask = {
        kind: ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(load(f"glIs{kind}")) for kind in KINDS
    }

    def count():
        gc.collect()
        return {kind: sum(is_one(n) for n in range(1, HIGHEST)) for kind, is_one in ask.items()}

    return count


def resident():
    """Bytes of memory that this process holds."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc/self/statm")
def test_a_thousand_frames_hold_nothing_more(every_effect, ctx, alive):
    with Player(every_effect, size=SIZE, context=ctx) as player:
        assert len(player.called) == 11
        held, skipped = [], set()
        for number in range(FRAMES):
            # Every moment is asked for twice, and the animation runs twice
            player.draw(number // 2 * 0.04)
            skipped.add(len(player.skipped))
            if number % 50 == 0:
                player.frame(number * 0.04)
                player.linear(number * 0.04)
            if number == WARM:
                objects, counted = alive(), player.targets.objects
                textures = player.profile["textures"], player.profile["bytes"]
                programs = player.programs.count
            if number >= WARM and number % 10 == 0:
                held.append(resident())
        assert alive() == objects
        assert player.targets.objects == counted
        assert (player.profile["textures"], player.profile["bytes"]) == textures
        assert player.programs.count == programs
        # Nothing stays, what is opaque stays, all stays
        assert {0, 4, 11} <= skipped
    assert max(held) - held[0] < GROWTH
    # What the player counts is what there is
    assert objects["Texture"] >= textures[0]


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc/self/statm")
def test_twenty_reloads_leave_nothing_behind(every_effect, ctx, alive):
    # What other tests left behind must not go while this one counts
    gc.collect()
    before, held = alive(), []
    for number in range(RELOADS):
        with Player(every_effect, size=SIZE, context=ctx) as player:
            for time in (0.0, 0.0, 1.0):
                player.frame(time)
            if number == 0:
                playing = alive()
                assert all(playing[kind] > before[kind] for kind in ("Texture", "Program")), (
                    playing,
                    before,
                )
            player.targets.resize((SIZE[0] + number, SIZE[1]))
            player.frame(2.0)
        # What other tests left in this context may still go, but nothing may come
        left = alive()
        assert all(left[kind] <= before[kind] for kind in before)
        # In a large process cycles may wait long for their collection: they are no leak
        gc.collect()
        held.append(resident())
    # The first reloads fill the caches of Python, numpy and the driver
    assert max(held[5:]) - held[5] < GROWTH
