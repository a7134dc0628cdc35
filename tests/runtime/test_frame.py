"""Targets on first use, counters, timing."""

from __future__ import annotations

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
