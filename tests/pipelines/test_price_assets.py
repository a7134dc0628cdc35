"""What each kind of asset is promised to cost, against bakes of it."""

from __future__ import annotations

import json
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from bake import billboard, compress, dome, dome_renders, mips, occlusion, transfer
from bake.store import Store
from formats import report
from pipelines import (
    cli,
    price,
    price_dome,
    price_occlusion,
    price_sprites,
    price_transfer,
    single,
)  # fmt: skip
from pipelines.price import Ask
from pipelines.price_dome import DomeAsset
from pipelines.price_occlusion import OcclusionAsset
from pipelines.price_sprites import RingAsset
from pipelines.price_transfer import TransferAsset

ROUND = 9  # sides of the cups
LONGEST = 1.25
"""Times the promise that a bake may err: its own interval is a tenth to a fifth, twice."""


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Probe and check with a third of the rays and places."""
    for module, name, value in (
        (price_sprites, "TRUTH", 36), (price_sprites, "SPANS", 24), (price_dome, "TRUTH", 36),
        (price_dome, "UNSEEN", 6), (price_occlusion, "PROBE_GRID", 7),
        (price_occlusion, "MANY", 512), (price_transfer, "TRUTH", 768),
        (price_transfer, "VERTICES", 64),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)


@pytest.fixture(scope="module")
def cup(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cup without a lid, of a few walls that shade each other."""
    turn = 2 * np.pi * np.arange(ROUND) / ROUND
    rim = np.stack([np.cos(turn), np.zeros(ROUND), np.sin(turn)], axis=1)
    up = np.array([0, 1.2, 0])
    rings = [0.6 * rim, rim + up, 0.85 * rim + up, 0.5 * rim + up / 12]
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for ring in rings for x, y, z in ring]
    for k in range(len(rings) - 1):
        for i in range(ROUND):
            a, b = k * ROUND + i + 1, k * ROUND + (i + 1) % ROUND + 1
            lines.append(f"f {a} {a + ROUND} {b + ROUND} {b}")
    for k, order in ((0, range(ROUND)), (3, reversed(range(ROUND)))):
        lines.append("f " + " ".join(str(k * ROUND + i + 1) for i in order))
    path = tmp_path_factory.mktemp("cup") / "cup.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def kept(subject: price.Subject, store: Store, target: float) -> price.Deal:
    """Buy an error and check what holds of every deal."""
    _, deal = price.buy(subject, store, Ask(target), clock=process_time)
    assert deal.reached is not None
    assert deal.error <= price.SAFETY * target
    assert deal.reached.value <= min(2 * target, LONGEST * deal.error)
    assert deal.reached.low < deal.reached.value < deal.reached.high
    return deal


def test_occlusion(cup: Path, tmp_path: Path) -> None:
    subject = OcclusionAsset(cup, occlusion.Params(grid=10), compress.Params())
    deal = kept(subject, Store(tmp_path), 0.07)
    assert set(deal.knobs) == {"rays", "l_max", "components"}


def test_ring_of_a_mesh(cup: Path, tmp_path: Path) -> None:
    subject = RingAsset(cup, billboard.Params(resolution=40, lights=32), mips.Params(max_lod=1.0))
    deal = kept(subject, Store(tmp_path), 0.25)
    coarse = price.choose(subject.probe(process_time), Ask(0.4), "cup")
    assert coarse.knobs["samples"] <= deal.knobs["samples"]


def test_dome_of_a_mesh(cup: Path, tmp_path: Path) -> None:
    fit = dome.Params(bands=4, penalty=0.1, coverage=True)
    renders = dome_renders.Params(resolution=24, lights=32)
    kept(DomeAsset(cup, renders, fit, ("samples",)), Store(tmp_path), 0.4)


def test_transfer(cup: Path, tmp_path: Path) -> None:
    subject = TransferAsset(cup, transfer.Params(edge=0.2))
    kept(subject, Store(tmp_path), 0.08)


def test_written_knobs_stay(cup: Path) -> None:
    free = ("rays",)
    subject = OcclusionAsset(cup, occlusion.Params(grid=8, l_max=3), compress.Params(), free)
    found = {(p.knobs["l_max"], p.knobs["components"]) for p in subject.probe(process_time).points}
    assert found == {(3, 16)}


def test_command_reports_promised_against_reached(
    cup: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    single.add_to(cli.cli)
    out = tmp_path / "out"
    words = ["occlusion", str(cup), "-o", str(out), "--grid", "8", "--build", str(tmp_path / "b")]
    assert cli.run([*words, "--target-error", "0.09", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["price"]
    # The copy is sealed anew, and reads as any other
    assert report.read(out)["price"] == told
    assert told["promised_error"] <= 0.09
    assert told["target_error"] == 0.09
    assert cli.run([*words, "--target-error", "1e-6"]) == 2
    assert "the best is" in capsys.readouterr().err
