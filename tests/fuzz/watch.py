"""Start workers, watch for crashes and hangs, go on behind them."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from time import monotonic, sleep

from tests.fuzz.subjects import ROOT

PATIENCE = 20.0  # seconds without another input; a worker's own start counts too


def fuzz(name: str, start: int, stop: int) -> list[dict[str, object]]:
    """Read inputs start..stop - 1 of a subject; return the faults: subject, number, fault."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as made:
        folder, found = Path(made), []
        while start < stop:
            (folder / "at").write_text(str(start))
            ended = _run(name, start, stop, folder)
            at = int((folder / "at").read_text())
            if at < stop:
                found.append({"subject": name, "number": at, "fault": ended})
            start = at + 1
        lines = (folder / "found.jsonl").read_text().splitlines()
        return found + [json.loads(line) for line in lines]


def _run(name: str, start: int, stop: int, folder: Path) -> str:
    """Run one worker to its end; return how it ended."""
    command = [sys.executable, "-m", "tests.fuzz.worker", name, str(start), str(stop), str(folder)]
    with open(folder / "errors", "wb") as errors:
        worker = subprocess.Popen(command, cwd=ROOT, stdout=errors, stderr=errors)
        last, seen = monotonic(), ""
        while worker.poll() is None:
            sleep(0.05)
            now = (folder / "at").read_text()
            if now != seen:
                last, seen = monotonic(), now
            if monotonic() - last > PATIENCE:
                worker.kill()
                worker.wait()
                return f"hung for {PATIENCE:.0f} s"
    told = (folder / "errors").read_text(errors="replace").strip().splitlines()
    if worker.returncode == 1 and told:
        raise RuntimeError(f"the worker for {name} failed: {told[-1]}")
    return f"crashed with {worker.returncode}: {told[-1] if told else ''}"
