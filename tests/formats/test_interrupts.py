"""Ctrl-C kept back is not lost."""

import signal

import pytest

from formats import interrupts


def _interrupted_inside() -> None:
    with interrupts.held():
        try:
            signal.raise_signal(signal.SIGINT)
        except BaseException as error:
            raise AssertionError("it came early") from error


def test_a_swallowed_interrupt_arrives_when_the_block_ends() -> None:
    with pytest.raises(KeyboardInterrupt):
        _interrupted_inside()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_without_an_interrupt_nothing_happens() -> None:
    with interrupts.held():
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
