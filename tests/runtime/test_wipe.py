"""The other side of the divider, by a tracer that answers at once."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from runtime.camera import Camera
from runtime.edits import Edits
from runtime.truth import Traced
from runtime.wipe import Wipe


class Stub:
    """What a wipe asks of a player."""

    class targets:  # noqa: N801
        size = (8, 4)

    sun_turn = (0.0, 0.0)

    def __init__(self):
        self.view = Camera(np.array([0.0, 0, 4]), np.zeros(3))


@dataclass
class Tracer:
    pictures: list = field(default_factory=list)
    busy: str | None = "tracing"
    error: str | None = None
    closed: bool = False

    def poll(self):
        return self.pictures.pop(0) if self.pictures else None

    def close(self):
        self.closed = True


@pytest.fixture
def traced():
    """A wipe that traces, and the list of its tracers."""
    tracers = []

    def truth(player, time):
        tracers.append(Tracer())
        return tracers[-1]

    wipe = Wipe(truth)
    wipe.choose("truth")
    return wipe, tracers


def picture(code=0):
    return np.full((4, 8, 3), code, np.uint8)


def test_modes_are_those_that_there_is_something_for():
    wipe = Wipe()
    assert wipe.modes == ("off",)
    wipe.keep(np.zeros((4, 8, 4), np.uint8))
    assert wipe.mode == "kept"
    assert wipe.notes == ()
    assert wipe.picture.shape == (4, 8, 3)
    wipe.effect = "fog"
    assert wipe.modes == ("off", "kept", "effect")
    wipe.next()
    assert wipe.label == "without fog"
    wipe.next()
    assert wipe.mode == "off"


def test_tracing_begins_where_the_view_holds_still(traced):
    wipe, tracers = traced
    player = Stub()
    assert wipe.waiting
    assert not wipe.follow(player, 0.0, Edits(), still=False)
    assert tracers == []
    assert wipe.follow(player, 0.0, Edits(), still=True)
    assert wipe.follow(player, 0.0, Edits(), still=True) is False
    assert wipe.picture is None
    tracers[0].pictures = [
        Traced(picture(1), 0.25, 0.1),
        Traced(picture(2), 16.0, 0.01, notes=("no blur",)),
    ]
    for code in (1, 2):
        assert wipe.follow(player, 0.0, Edits(), still=True)
        assert wipe.picture[0, 0, 0] == code
    assert wipe.label == "traced, 16 paths a pixel"
    assert wipe.notes == ("no blur",)
    tracers[0].busy = None
    assert not wipe.waiting


@pytest.mark.parametrize("what", ["time", "camera", "edits", "player"])
def test_it_ends_when_something_changes(traced, what):
    wipe, tracers = traced
    player, time, edits = Stub(), 0.0, Edits()
    wipe.follow(player, time, edits, still=True)
    tracers[0].pictures = [Traced(picture(), 1.0, 0.1)]
    wipe.follow(player, time, edits, still=True)
    if what == "time":
        time = 0.5
    elif what == "camera":
        player.view = Camera(np.array([0.0, 1, 4]), np.zeros(3))
    elif what == "edits":
        edits = edits.effect(("fog",), False)
    else:
        player = Stub()
    assert wipe.follow(player, time, edits, still=False)
    assert tracers[0].closed
    # What was traced is of another view
    assert wipe.picture is None
    wipe.follow(player, time, edits, still=True)
    assert len(tracers) == 2
    wipe.choose("off")
    assert tracers[1].closed


def test_what_went_wrong_is_said(traced):
    wipe, tracers = traced
    wipe.follow(Stub(), 0.0, Edits(), still=True)
    tracers[0].error = "out of memory"
    assert wipe.label == "out of memory"
