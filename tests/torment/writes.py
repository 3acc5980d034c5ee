"""Verbs that write, cut off or failing at each of their writes in turn."""

from __future__ import annotations

import builtins
import errno
import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any

from torment.outcome import TrialFailed, run_command
from torment.verbs import VERBS, check_after, files, prepared

_CALLS = ("open", "mkdir", "replace", "rename", "fsync", "unlink", "rmdir")
_FAULTS = (errno.ENOSPC, errno.EROFS, errno.EIO, errno.EACCES, errno.EDQUOT)


class Killed(BaseException):
    """Nothing of the process is left after this: no other call that writes has an effect."""


class _Faults:
    """Counts calls that write, and fails or kills at one of them."""

    def __init__(self, at: int, fault: int | None) -> None:
        self.at, self.fault = at, fault
        self.count = 0

    def step(self, part: Callable[[], None] = lambda: None) -> None:
        """Count a call; `part` is what it may have done by the time it is cut off."""
        self.count += 1
        if self.fault is None and self.count >= self.at:
            if self.count == self.at:
                part()
            raise Killed
        if self.fault is not None and self.count == self.at:
            part()
            raise OSError(self.fault, os.strerror(self.fault))


@contextmanager
def faulty(at: int, fault: int | None) -> Iterator[_Faults]:
    """Let the call number `at` that writes fail by an error number, or be the last where it is None."""
    faults, real = _Faults(at, fault), {name: getattr(os, name) for name in _CALLS}
    real_open = builtins.open

    def calling(name: str) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            flags = arguments[1] if name == "open" and len(arguments) > 1 else os.O_WRONLY
            if name != "open" or flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
                faults.step()
            return real[name](*arguments, **named)

        return call

    class Raw(io.FileIO):
        """A file whose every write counts; half of one that is cut off is written."""

        def write(self, data: Any) -> int:
            faults.step(lambda: (super(Raw, self).write(bytes(data)[: len(data) // 2]), None)[1])
            return super().write(data)

    def opened(number: int, mode: str = "r", *arguments: Any, **named: Any) -> Any:
        if isinstance(number, int) and mode == "wb":
            return io.BufferedWriter(Raw(number, "wb"))
        return real_open(number, mode, *arguments, **named)

    for name in _CALLS:
        setattr(os, name, calling(name))
    real_fdopen, os.fdopen = os.fdopen, opened
    try:
        yield faults
    finally:
        os.fdopen = real_fdopen
        for name, function in real.items():
            setattr(os, name, function)


def write_fault(chance: Random, folder: Path) -> str:
    """A verb killed, or told that the disk is full or read-only, at one of its writes.

    What was there before is as it was, nothing half is taken for whole, and the same command again is right.
    """
    verb = chance.choice(list(VERBS))
    words = prepared(verb, folder)
    before = files(folder)
    at, fault = chance.randint(1, 20), chance.choice([None, *_FAULTS])
    with faulty(at, fault) as faults, suppress(Killed):
        _, code, _ = run_command(words)
        if faults.count >= at and fault is not None and code not in (0, 1, 3):
            raise TrialFailed(f"{verb}: exit code {code} at write {at}")
    check_after(verb, folder, words, before)
    return "no fault" if faults.count < at else "killed" if fault is None else "refused"
