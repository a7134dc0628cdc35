"""Tiles in threads: order, progress, errors."""

import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from bake import workers
from formats import interrupts


@pytest.fixture(autouse=True)
def own_count(monkeypatch):
    monkeypatch.setattr(workers, "_count", 3)


def test_results_come_in_the_order_of_the_tiles():
    """Later tiles finish first, and one of many is slow."""

    def work(tile):
        time.sleep(0.02 if tile % 5 == 0 else 0.0)
        return tile * tile

    assert workers.map_tiles(work, range(40)) == [n * n for n in range(40)]


def test_no_tiles_no_results():
    said = []
    assert workers.map_tiles(lambda tile: tile, [], said.append) == []
    assert said == []


def test_tiles_run_side_by_side():
    meeting = threading.Barrier(3, timeout=10)
    assert len(set(workers.map_tiles(lambda tile: meeting.wait(), range(3)))) == 3


def test_progress_rises_to_one():
    said = []
    workers.map_tiles(lambda tile: time.sleep(0.001), range(20), said.append)
    assert said == sorted(said)
    assert said[-1] == 1.0
    assert all(0 <= fraction <= 1 for fraction in said)


@pytest.mark.parametrize("error", [ValueError, MemoryError, KeyboardInterrupt])
def test_an_exception_drops_the_tiles_that_have_not_begun(error):
    begun = []

    def work(tile):
        begun.append(tile)
        if tile == 4:
            raise error("tile 4")
        time.sleep(0.005)

    with pytest.raises(error, match="tile 4"):
        workers.map_tiles(work, range(500))
    assert len(begun) < 250


def test_an_interrupt_while_waiting_ends_the_work():
    """Ctrl-C reaches the main thread, here between two reports of progress."""
    begun = []

    def work(tile):
        begun.append(tile)
        time.sleep(0.005)

    def interrupt(fraction):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        workers.map_tiles(work, range(500), interrupt)
    assert len(begun) < 250


def test_blas_stays_at_one_thread():
    from threadpoolctl import threadpool_info

    found = workers.map_tiles(
        lambda tile: [p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas"],
        range(4),
    )
    np.ones((64, 64)) @ np.ones((64, 64))
    assert any(found)
    assert all(number == 1 for pools in found for number in pools)


def test_the_number_of_threads(monkeypatch):
    monkeypatch.setattr(workers, "_count", 0)
    assert workers.count() >= 1
    workers.use(7)
    assert workers.count() == 7
    workers.use(0)
    assert workers.count() >= 1


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="needs signals to threads")
def test_ctrl_c_never_strikes_where_locks_are_taken():
    """Python's locks do not survive an exception out of a signal: of 60 processes interrupted in
    their first .4 s without this care, one hung and one ended in a RuntimeError."""
    main = threading.main_thread().ident

    def work(tile):
        time.sleep(0.001)
        signal.pthread_kill(main, signal.SIGINT)

    with pytest.raises(KeyboardInterrupt) as caught:
        workers.map_tiles(work, range(1000))
    assert Path(caught.traceback[-1].path) in (Path(workers.__file__), Path(interrupts.__file__))
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
