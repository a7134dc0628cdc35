"""Work in a process beside: the newest counts, errors are a line, nothing outlives its owner."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipelines.beside import Beside, Ended
from tests.pipelines.errands import count

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def one():
    """One process for the tests that do not end it: starting one takes half a second."""
    made = Beside(count)
    yield made
    made.stop()


def all_of(beside, seconds=30.0):
    """What is told until the work has ended, and its error."""
    found, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        for message in beside.poll():
            if isinstance(message, Ended):
                return found, message.error
            found.append(message)
        time.sleep(0.005)
    raise AssertionError("it did not end in time")


def alive(pid):
    """Whether a process runs, zombies left out."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def gone_soon(pid, seconds=10.0):
    end = time.monotonic() + seconds
    while alive(pid) and time.monotonic() < end:
        time.sleep(0.02)
    return not alive(pid)


def test_messages_come_in_order_from_another_process(one):
    one.ask(5)
    told, error = all_of(one)
    assert [number for number, _ in told] == [0, 1, 2, 3, 4]
    assert error is None
    assert {pid for _, pid in told} != {os.getpid()}
    assert one.poll() == []


def test_it_stays_from_request_to_request(one):
    one.ask("memory")
    (first,), _ = all_of(one)
    one.ask("memory")
    assert all_of(one) == ([first + 1], None)


def test_the_newest_request_drops_the_one_under_way(one):
    started = time.monotonic()
    for request in (60.0, 60.0, 3):
        one.ask(request)
        time.sleep(0.05)
    told, _ = all_of(one)
    assert [number for number, _ in told] == [0, 1, 2]
    assert time.monotonic() - started < 30


def test_what_is_dropped_ends_without_a_word(one):
    one.ask(60.0)
    one.drop()
    assert one.poll() == []
    one.ask(1)
    assert len(all_of(one)[0]) == 1
    idle = Beside(count)
    idle.drop()
    assert idle.poll() == []


@pytest.mark.parametrize(
    ("request_", "error"),
    [(Path("a.toml"), "a.toml: field: 3 -- write 4"), ("fail", "ValueError: two lines")],
)
def test_an_error_is_one_line_and_not_the_end(one, request_, error):
    one.ask(request_)
    assert all_of(one) == ([], error)
    one.ask(1)
    assert len(all_of(one)[0]) == 1


def test_a_process_that_dies_is_told_and_started_again():
    beside = Beside(count)
    beside.ask("die")
    assert all_of(beside) == ([], "the process beside the window ended with code 7")
    beside.ask(2)
    told, error = all_of(beside)
    assert len(told) == 2
    assert error is None
    pid = told[0][1]
    # Ctrl-C of the terminal reaches it too, and is for the window alone
    os.kill(pid, signal.SIGINT)
    time.sleep(0.1)
    assert alive(pid)
    beside.ask(60.0)
    started = time.monotonic()
    beside.stop()
    assert time.monotonic() - started < 5
    assert not alive(pid)
    assert beside.poll() == []
    beside.stop()


def test_it_does_not_outlive_a_killed_owner():
    code = (
        "import sys, time\n"
        "from pipelines.beside import Beside\n"
        "from tests.pipelines.errands import count\n"
        "if __name__ == '__main__':\n"
        "    beside = Beside(count)\n"
        "    beside.ask(1)\n"
        "    while not (told := beside.poll()): time.sleep(0.01)\n"
        "    print(told[0][1], flush=True)\n"
        "    beside.ask(60.0)\n"
        "    time.sleep(60)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as owner:
        try:
            assert owner.stdout is not None
            pid = int(owner.stdout.readline())
            assert alive(pid)
        finally:
            owner.kill()
    assert gone_soon(pid)
