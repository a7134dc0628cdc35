"""Targets on first use, counters, timing."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.frame import Frame

pytestmark = pytest.mark.gpu


def test_targets_are_made_when_first_asked_for_and_counted(ctx):
    frame = Frame(ctx, (10, 6))
    assert (frame.texture_count, frame.texture_bytes) == (0, 0)
    colour = frame.target("colour")
    assert frame.target("colour") is colour
    assert (frame.texture_count, frame.texture_bytes) == (1, 10 * 6 * 8)
    frame.target("colour", "depth")
    frame.target("picture", dtype="f1")
    assert (frame.texture_count, frame.texture_bytes) == (3, 10 * 6 * (8 + 4 + 4))
    frame.resize((5, 3))
    assert frame.texture_count == 0
    assert frame.target("colour").size == (5, 3)
    frame.release()


def test_passes_are_timed_by_name_and_the_method_is_told(ctx):
    frame = Frame(ctx, (4, 4))
    with frame.timed("sky"):
        frame.target("colour").clear()
    assert frame.milliseconds["sky"] > 0
    software = "llvmpipe" in ctx.info["GL_RENDERER"]
    assert frame.timing == ("wall clock between finish calls" if software else "timer queries")
    frame.release()


def test_samples_are_averaged_once_and_only_where_there_are_any(ctx):
    frame = Frame(ctx, (8, 4), samples=4)
    assert frame.texture_bytes == 0
    target = frame.opaque()
    assert target is frame.opaque()
    assert frame.unresolved
    assert frame.texture_bytes == frame.samples * 12 * 8 * 4
    target.use()
    target.clear(0.25, 0.5, 1.0, 1.0, depth=0.75)
    frame.resolve()
    assert not frame.unresolved
    colour = np.frombuffer(frame.texture("colour").read(), np.float16).reshape(-1, 4)
    np.testing.assert_array_equal(colour, np.tile([0.25, 0.5, 1.0, 1.0], (32, 1)))
    depth = np.frombuffer(frame.texture("depth").read(), np.float32)
    # 24 bits
    np.testing.assert_allclose(depth, 0.75, atol=2.0**-24)
    # Nothing was drawn since: what is in colour stays
    frame.target("colour").clear(0.0, 0.0, 0.0, 0.0)
    frame.resolve()
    assert not np.frombuffer(frame.texture("colour").read(), np.float16).any()
    frame.resize((4, 4))
    assert frame.texture_bytes == 0
    assert frame.opaque().size == (4, 4)
    frame.release()


def test_one_sample_is_the_plain_target(ctx):
    frame = Frame(ctx, (8, 4))
    assert frame.opaque() is frame.target("colour", "depth")
    assert not frame.unresolved
    frame.release()


def test_no_more_samples_are_asked_for_than_the_card_has(ctx):
    frame = Frame(ctx, (2, 2), samples=1000)
    assert frame.samples == ctx.max_samples
    frame.release()


def test_several_targets_are_written_at_once(ctx):
    frame = Frame(ctx, (4, 2))
    made = frame.targets((("position", 4, "f4"), ("id", 1, "i4")), "depth")
    assert made is frame.targets((("position", 4, "f4"), ("id", 1, "i4")), "depth")
    assert frame.texture_bytes == 4 * 2 * (16 + 4 + 4)
    frame.release()
