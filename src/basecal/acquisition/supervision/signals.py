"""Signals during a capture: the system informs the supervisor at once, and the main thread leaves what it waits for."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from basecal.errors import DriverError

_INTERRUPT = signal.SIGUSR1
_ENDING_SIGNALS = (signal.SIGTERM, signal.SIGHUP)


@contextmanager
def routed_signals(reason: Callable[[], str]) -> Iterator[int]:
    """Give the read end of a pipe into which the system writes the number of each signal, whatever Python does.

    In the main thread SIGTERM and SIGHUP become `KeyboardInterrupt`, as SIGINT is, and `interrupt_main_thread` raises
    a `DriverError` there; other threads leave the process's signals alone.

    Args:
        reason: Why the main thread is interrupted, in words; empty if it is not to be.
    """
    read_fd, write_fd = os.pipe()
    os.set_blocking(write_fd, False)

    def raise_reason(number: int, frame: object) -> None:
        """Interrupt the main thread, if there is a reason."""
        if words := reason():
            raise DriverError(words)

    is_main = threading.current_thread() is threading.main_thread()
    handlers = dict.fromkeys(_ENDING_SIGNALS, signal.default_int_handler) | {_INTERRUPT: raise_reason}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()} if is_main else {}
    former_fd = signal.set_wakeup_fd(write_fd, warn_on_full_buffer=False) if is_main else -1
    try:
        yield read_fd
    finally:
        if is_main:
            signal.set_wakeup_fd(former_fd)
            for number, handler in before.items():
                signal.signal(number, handler)
        os.close(read_fd)
        os.close(write_fd)


def interrupt_main_thread() -> None:
    """Have the main thread raise what `routed_signals` was given, if it is routed."""
    main = threading.main_thread().ident
    if main is not None and signal.getsignal(_INTERRUPT) not in (signal.SIG_DFL, signal.SIG_IGN, None):
        signal.pthread_kill(main, _INTERRUPT)
