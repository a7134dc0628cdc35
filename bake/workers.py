"""Threads for tiles: Embree and numpy release the interpreter's lock, BLAS stays at one thread."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TypeVar

from formats import interrupts

Tile = TypeVar("Tile")
Result = TypeVar("Result")
Progress = Callable[[float], None]

PATIENCE = 0.05  # seconds between looks whether Ctrl-C was asked for

_count = 0


def use(count: int) -> None:
    """Set the number of threads; 0 means one a core."""
    global _count
    _count = count


def count() -> int:
    """Return the number of threads that tiles are spread over."""
    if _count:
        return _count
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def silent(fraction: float) -> None:
    """Progress that nobody watches; `fraction` runs from 0 to 1."""


def map_tiles(
    function: Callable[[Tile], Result], tiles: Iterable[Tile], progress: Progress = silent
) -> list[Result]:
    """Apply `function` to every tile, in threads, and return the results in the order of the tiles.

    The result does not depend on the number of threads as long as `function` is pure. An exception,
    Ctrl-C included, drops the tiles that have not begun and is raised again.
    """
    from threadpoolctl import threadpool_limits  # type: ignore[import-untyped, unused-ignore]

    work: Sequence[Tile] = list(tiles)
    with (
        interrupts.held() as interrupt,
        threadpool_limits(limits=1),
        ThreadPoolExecutor(count()) as pool,
    ):
        try:
            futures = [pool.submit(function, tile) for tile in work]
            for ended, future in enumerate(futures, 1):
                while not future.done():
                    if interrupt.asked:
                        raise KeyboardInterrupt
                    wait([future], timeout=PATIENCE)
                future.result()
                progress(ended / len(futures))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [future.result() for future in futures]
