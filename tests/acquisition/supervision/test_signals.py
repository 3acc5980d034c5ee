"""Tests of signals while arms are supervised."""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest

from basecal.acquisition.supervision.signals import interrupt_main_thread, routed_signals
from basecal.errors import DriverError

pytestmark = pytest.mark.timed


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_signals_interrupt_and_are_written_to_the_pipe(number):
    """Each acts like Ctrl-C, and its number is in the pipe before Python handles it."""
    with routed_signals(lambda: "") as read_fd:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
        assert os.read(read_fd, 8) == bytes([number])
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_ignored_ctrl_c_is_not_ignored_while_arms_are_open():
    """A shell makes commands in the background of a script ignore it; afterwards it is ignored again."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with routed_signals(lambda: "") as read_fd:
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            assert os.read(read_fd, 8) == bytes([signal.SIGINT])
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_main_thread_can_be_interrupted():
    """Another thread interrupts a wait with a reason; without a reason there is no effect."""
    why = [""]
    with routed_signals(lambda: why[0]):
        interrupt_main_thread()
        why[0] = "right: protective stop"
        threading.Timer(0.05, interrupt_main_thread).start()
        began_s = time.monotonic()
        with pytest.raises(DriverError, match="right: protective stop"):
            time.sleep(5)
    assert time.monotonic() - began_s < 2
    interrupt_main_thread()


def test_other_threads_do_not_change_handlers():
    """In a library used from another thread, signal handlers are unchanged."""
    found = []

    def use():
        with routed_signals(lambda: "") as read_fd:
            found.append((read_fd > 0, signal.getsignal(signal.SIGTERM)))

    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert found == [(True, signal.SIG_DFL)]
