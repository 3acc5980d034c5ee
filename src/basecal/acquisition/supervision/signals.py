"""Signals during a capture: the system notifies the supervisor at once, and the main thread is interrupted."""

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
    """Context of the read end of a pipe into which the system writes signal numbers, even while Python is blocked.

    In the main thread, SIGTERM and SIGHUP raise `KeyboardInterrupt` like SIGINT, and `interrupt_main_thread` raises a
    `DriverError`. A SIGINT that is ignored raises it, too: a shell ignores it for commands in the background of a
    script, whose arms would go on. If another thread enters the context, the signal handlers do not change.

    Args:
        reason: Returns the message of that error; empty if the main thread is not to be interrupted.
    """
    read_fd, write_fd = os.pipe()
    os.set_blocking(write_fd, False)

    def raise_reason(number: int, frame: object) -> None:
        """Interrupt the main thread, if there is a reason."""
        if words := reason():
            raise DriverError(words)

    is_main = threading.current_thread() is threading.main_thread()
    is_ignored = signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    ending_signals = (*_ENDING_SIGNALS, signal.SIGINT) if is_ignored else _ENDING_SIGNALS
    handlers = dict.fromkeys(ending_signals, signal.default_int_handler) | {_INTERRUPT: raise_reason}
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
    """Make the main thread raise the error of `routed_signals`; do nothing outside that context."""
    main = threading.main_thread().ident
    if main is not None and signal.getsignal(_INTERRUPT) not in (signal.SIG_DFL, signal.SIG_IGN, None):
        signal.pthread_kill(main, _INTERRUPT)
