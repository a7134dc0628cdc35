"""Any bytes in: a sound result, or one typed error, in time and within memory; never a crash."""

import os
import sys

import pytest

from tests.fuzz import subjects, watch

COUNT = int(os.environ.get("BAKELIGHT_FUZZ", "3000"))
"""Inputs a subject; `make fuzz` reads 100,000."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits memory through Linux"),
]


@pytest.mark.parametrize("name", subjects.SUBJECTS)
def test_damaged_files_end_in_one_typed_error(name: str) -> None:
    faults = watch.fuzz(name, 0, COUNT)
    assert not faults, f"{len(faults)} of {COUNT}, the first: {faults[0]}"
