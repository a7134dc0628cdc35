"""Fixtures of every test: numerical accidents become failures, random numbers have a seed."""

import signal
import zlib
from collections.abc import Iterator

import numpy as np
import pytest

# Where the suite runs in the background, Ctrl-C is ignored, and so it would be in what tests start
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def raise_on_floating_point_errors() -> Iterator[None]:
    """Overflow, invalid and division by zero raise; underflow to zero is no accident."""
    with np.errstate(all="raise", under="ignore"):
        yield


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Give a generator seeded by the test's own name: tests do not depend on their order."""
    return np.random.default_rng(zlib.crc32(request.node.nodeid.encode()))
