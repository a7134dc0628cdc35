"""A few kills, full disks, flips and bakes at once over real stages; `make crash` does hundreds.

Each proof is also shown something broken, which it must find.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.hard_crash import order

ROOT = Path(__file__).resolve().parents[2]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs fork and /proc"),
]

# One process that has imported everything and no threads, so that its children cost little
PROGRAM = """
import json, sys
from pathlib import Path
from tests.hard_crash import at_once, bits, forks, full_disk, kills, order
from tests.hard_crash.subjects import subjects, use_small_tiles, write_sources
use_small_tiles()
here = Path(sys.argv[1])
write_sources(here / "sources")
found = subjects(here / "sources")
some = {name: found[name] for name in ("voxels", "mesh")}
warm = [*some.values(), found["dome"]]
forks.import_what(lambda: [each.run(here / "warm") for each in warm] and None)
one, tiled = {"mesh": found["mesh"]}, {"dome": found["dome"]}
print(json.dumps({
    "kills": kills.prove(some, here, 6),
    "kills amid tiles": kills.prove(tiled, here, 4),
    "turned tiles": kills.control_of_tiles(tiled, here),
    "bits of tiles": bits.prove_tiles(tiled, here, 3),
    "control of kills": kills.control(found["voxels"], here / "control", 6),
    "full disk": full_disk.prove(one, here, 14),
    "bits": bits.prove(some, here, 12),
    "control of bits": bits.prove(one, here / "unseen", 6, verify=lambda path: None),
    "at once": at_once.prove(one, here, 1),
    "order": order.prove(one, here),
}))
"""


@pytest.fixture(scope="module")
def proofs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path_factory.mktemp("crash"))],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize(
    "name", ["kills", "kills amid tiles", "full disk", "bits", "bits of tiles", "at once", "order"]
)
def test_nothing_goes_wrong(proofs: dict[str, Any], name: str) -> None:
    proof = proofs[name]
    assert not any(proof["wrong"].values()), proof


def test_what_must_be_found_is_found(proofs: dict[str, Any]) -> None:
    assert proofs["control of kills"] > 0
    assert proofs["turned tiles"] == ["dome"]
    assert proofs["control of bits"]["wrong"]["verify missed"] > 0


def test_order_finds_a_missing_flush() -> None:
    """The judge of events on lists written by hand: whole, and with one thing missing each."""
    rename = ("rename", "/s/name", "/s/.tmp-1=folder\n/s/.tmp-1/a=1f")
    whole = [("fsync", "/s/.tmp-1/a", "1f"), ("fsync", "/s/.tmp-1", "folder"), rename]
    whole.append(("fsync", "/s", "folder"))
    assert order.judged(whole) == (["/s/name"], [])
    for missing, problem in ((0, order.WRONG[0]), (1, order.WRONG[1]), (3, order.WRONG[2])):
        events = whole[:missing] + whole[missing + 1 :]
        assert [found for found, _ in order.judged(events)[1]] == [problem]
    written_after = [("fsync", "/s/.tmp-1/a", "00"), *whole[1:]]
    assert order.judged(written_after)[1] == [(order.WRONG[0], "/s/.tmp-1/a")]
