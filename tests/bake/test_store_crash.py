"""Whatever happens to a bake, the store verifies afterwards and no name is half written.

Children are forked by a small single-threaded program, so that dozens of kills take seconds.
"""

import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import pytest

from bake import store as store_module
from bake.store import Store

ROOT = Path(store_module.__file__).parents[1]

pytestmark = pytest.mark.skipif(os.name == "nt", reason="needs fork, signals and rlimits")

STAGES = """
    import time
    from dataclasses import dataclass
    from functools import partial
    from pathlib import Path
    from bake import workers
    from bake.store import Source, Store
    from formats import report

    @dataclass(frozen=True)
    class Params:
        number: int = 0
        files: int = 6
        bytes: int = 20_000
        work_seconds: float = 0.0
        save_seconds: float = 0.0
        tiles: int = 0

    class Blob:
        def __init__(self, params):
            self.params = params
        def save(self, folder):
            p = self.params
            for n in range(p.files):
                with open(folder / f"{n}.bin", "wb") as file:
                    for block in range(10):
                        file.write(bytes([p.number % 256]) * (p.bytes // 10))
                        time.sleep(p.save_seconds / p.files / 10)
            report.write(folder, {"number": p.number})

    def read(path):
        return path.read_text()

    def blob(text, *, params, progress):
        with open("calls.txt", "a") as file:
            file.write("call\\n")
        Path("begun").touch()
        time.sleep(params.work_seconds)
        workers.map_tiles(lambda tile: time.sleep(0.02), range(params.tiles), progress)
        return Blob(params)

    def exr(text, *, params, progress):
        return Picture()

    class Picture:
        def save(self, folder):
            import numpy as np
            from formats.files import exr
            noise = np.random.default_rng(1).random((256, 256, 4), np.float32)
            exr.write(folder / "noise.exr", {"noise": noise})
            report.write(folder, {})

    def bake(stage=blob, say=print, **params):
        here = Path("input.txt")
        source = Source((here,), partial(read, here))
        return Store(Path("store"), say=say).run(stage, source, params=Params(**params))
"""

KILLED_BAKES = """
    import os, random, signal, sys, time
    import filelock, importlib.metadata, threadpoolctl
    import crash_stages
    from bake import publish

    seed, kills, in_place = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3] == "in_place"
    if in_place:
        publish.temporary = lambda parent, label: parent / ("crash_stages.blob-" + label)
        publish.publish = lambda folder, final: True
        publish.discard = lambda folder: None
    delays = random.Random(seed)
    begin = time.perf_counter()
    for n in range(3):
        crash_stages.bake(number=-n, save_seconds=0.01)
    longest = time.perf_counter() - begin
    for kill in range(kills):
        pid = os.fork()
        if pid == 0:
            for n in range(100_000):
                crash_stages.bake(number=1 + n, files=6 + kill, save_seconds=0.01)
            os._exit(0)
        time.sleep(delays.uniform(0, 0.7 * longest))
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
"""


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    (tmp_path / "crash_stages.py").write_text(textwrap.dedent(STAGES))
    (tmp_path / "input.txt").write_text("input")
    return tmp_path


def start(bench: Path, program: str, *arguments: object) -> "subprocess.Popen[str]":
    """Start a Python program in the bench's folder, its output captured."""
    path = f"{ROOT}{os.pathsep}{bench}"
    return subprocess.Popen(
        [sys.executable, "-B", "-c", textwrap.dedent(program), *map(str, arguments)],
        cwd=bench,
        env=os.environ | {"PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finished(
    process: "subprocess.Popen[str]", status: int = 0, seconds: float = 30
) -> tuple[str, str]:
    try:
        out, err = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise
    assert process.returncode == status, err
    return out, err


def bake_call(**params: Any) -> str:
    return f"import crash_stages; e = crash_stages.bake(**{params!r}); print(e.hit, e.key)"


def leftovers(bench: Path) -> list[Path]:
    return sorted((bench / "store").glob(".tmp-*"))


def wait_for(path: Path, seconds: float = 20) -> None:
    end = time.monotonic() + seconds
    while not path.exists():
        assert time.monotonic() < end, f"{path} never came"
        time.sleep(0.005)


def test_kill_9_at_random_points_leaves_no_half_written_name(bench: Path) -> None:
    finished(start(bench, KILLED_BAKES, 1, 24, "as it is"))
    entries = list((bench / "store").glob("crash_stages.blob-*"))
    assert Store(bench / "store").verify() == []
    for entry in entries:
        number = json.loads((entry / "report.json").read_text())["number"]
        blobs = list(entry.glob("*.bin"))
        assert len(blobs) >= 6
        assert {path.read_bytes() for path in blobs} == {bytes([number % 256]) * 20_000}
    # The kills did hit bakes half way, and bakes did end in between
    assert len(leftovers(bench)) > 4
    assert len(entries) > 4
    # A day later the next bake sweeps what they left
    for path in leftovers(bench):
        os.utime(path, (0, 0))
    finished(start(bench, bake_call(number=-2)))
    assert leftovers(bench) == []


def test_the_same_kills_do_damage_a_store_that_writes_in_place(bench: Path) -> None:
    """The control: the test above can fail."""
    finished(start(bench, KILLED_BAKES, 1, 8, "in_place"))
    assert len(Store(bench / "store").verify()) > 2


@pytest.mark.parametrize("patience", [60.0, 0.0])
def test_two_processes_bake_the_same_key_at_once(bench: Path, patience: float) -> None:
    """With the lock one of them works; without it both do, and the first rename wins."""
    program = """
        import sys, crash_stages
        from bake import store
        store.Store.__init__.__kwdefaults__["patience_seconds"] = float(sys.argv[1])
        said = []
        entry = crash_stages.bake(say=said.append, work_seconds=0.5, save_seconds=0.2)
        print(entry.hit, entry.key, len(said))
    """
    processes = [start(bench, program, patience) for _ in range(2)]
    told = sorted(finished(process)[0].split() for process in processes)
    work = (bench / "calls.txt").read_text().count("call")
    waited = sum(int(words[2]) for words in told)
    assert told[0][1] == told[1][1]
    assert waited == 1
    if patience:
        assert (work, told[0][0], told[1][0]) == (1, "False", "True")
    else:
        assert (work, told[0][0], told[1][0]) == (2, "False", "False")
    assert Store(bench / "store").verify() == []
    assert leftovers(bench) == []


def test_two_processes_that_bake_many_keys_at_once(bench: Path) -> None:
    """Same keys in another order, and a third process that collects garbage all the while."""
    program = """
        import random, sys, crash_stages
        numbers = list(range(12))
        random.Random(int(sys.argv[1])).shuffle(numbers)
        for number in numbers:
            crash_stages.bake(number=number, bytes=100)
    """
    collector = """
        import time
        from pathlib import Path
        from bake.store import Store
        end = time.monotonic() + 1
        while time.monotonic() < end:
            Store(Path("store")).gc(())
    """
    processes = [start(bench, program, 1), start(bench, program, 2), start(bench, collector)]
    for process in processes:
        assert finished(process)[1] == ""
    assert Store(bench / "store").verify() == []
    assert leftovers(bench) == []


INTERRUPTED = [
    pytest.param({"work_seconds": 30.0}, id="in the stage"),
    pytest.param({"tiles": 10_000}, id="in tiles on threads"),
    pytest.param({"save_seconds": 30.0}, id="while saving"),
]


@pytest.mark.parametrize("params", INTERRUPTED)
def test_ctrl_c_ends_a_bake_promptly_and_leaves_nothing(
    bench: Path, params: dict[str, Any]
) -> None:
    process = start(bench, bake_call(**params))
    wait_for(bench / "begun")
    if "save_seconds" in params:
        while not leftovers(bench):
            time.sleep(0.005)
    time.sleep(0.1)
    begin = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, err = finished(process, -signal.SIGINT, seconds=5)
    assert time.monotonic() - begin < 2
    assert err.rstrip().endswith("KeyboardInterrupt")
    assert leftovers(bench) == []
    assert Store(bench / "store").verify() == []
    # The lock is free again
    assert finished(start(bench, bake_call()))[0].startswith("False")


def test_a_killed_process_frees_its_lock(bench: Path) -> None:
    process = start(bench, bake_call(work_seconds=0.3))
    wait_for(bench / "begun")
    process.kill()
    process.communicate()
    out, _ = finished(start(bench, bake_call(work_seconds=0.3)))
    assert out.startswith("False"), "no word about waiting"


@pytest.mark.parametrize("stage", ["blob", "exr"])
def test_a_full_disk_is_one_line_and_leaves_nothing(bench: Path, stage: str) -> None:
    """A limit of 8 KB on the size of files stands in for the disk: the same OSError, at the same
    calls, in our own writers and in OpenEXR's C++."""
    program = """
        import resource, sys, crash_stages
        from formats.errors import MachineError
        if sys.argv[1] == "exr":
            import numpy, OpenEXR
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))
        try:
            crash_stages.bake(getattr(crash_stages, sys.argv[1]))
        except MachineError as error:
            print(error)
            sys.exit(error.exit_code)
    """
    out, _ = finished(start(bench, program, stage), status=3)
    assert len(out.splitlines()) == 1
    assert re.search(r"store: write: File too large after \d+ bytes, \d+ bytes free", out)
    assert out.endswith("free some space, or raise the quota or file size limit\n")
    assert {path.name for path in (bench / "store").iterdir()} <= {".locks", ".syntax.json"}
    assert Store(bench / "store").verify() == []
