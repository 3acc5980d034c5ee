"""Processes forked from one that has imported what they need, so that no trial waits for a start of Python.

A box's process is `python -m basecal.box` else; what it does, its limits and its end are the same.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from multiprocessing.context import ForkServerContext
from types import SimpleNamespace
from typing import Any
from unittest import mock

import cv2

from basecal import box
from shared.ros2_domain import LOOPBACK

cv2.setNumThreads(1)  # a fork has none of its parent's threads, and OpenCV would wait for them
_FORK = multiprocessing.get_context("fork")
_MODULE_AT = 3  # of the words of a box's process: the first after `python -m basecal.box`
_PRELOADED = ["basecal.cli.driver_check", "basecal.acquisition.driver_check.check_process", "basecal.cell.files"]
_PRELOADED += [f"basecal.acquisition.drivers.{kind}" for kind in ("ur", "opcua", "ros2", "opencv", "simulated")]
_PRELOADED += ["rtde_receive", "rtde_control", "asyncua.sync", "cyclonedds.sub", "torment.ros2_liar", "torment.warm"]


@cache
def server() -> ForkServerContext:
    """Where processes of sessions come from; what they say in ROS 2 stays on this machine."""
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    return context


class ForkedBox:
    """Stands for the `subprocess.Popen` of a box."""

    def __init__(self, command: Sequence[str], **_: Any) -> None:
        stdin, self._held = os.pipe()
        output, stdout = os.pipe()
        self._reaping = threading.Lock()  # of two threads that wait for a fork, one learns nothing of its end
        ours = (self._held, output)
        self._process = _FORK.Process(target=_run, args=(command[_MODULE_AT:], stdin, stdout, ours))
        with _without_interrupts():
            self._process.start()
        self.stdout = os.fdopen(output, "rb")
        os.close(stdin)
        os.close(stdout)

    def __enter__(self) -> ForkedBox:
        return self

    def __exit__(self, *_: object) -> None:
        self.stdout.close()
        os.close(self._held)
        self.wait()

    def poll(self) -> int | None:
        """Its exit code, once it has ended."""
        with self._reaping:
            return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Its exit code, as it ends.

        Raises:
            TimeoutExpired: if it does not in time [s].
        """
        with self._reaping:
            self._process.join(timeout)
            if self._process.exitcode is None:
                raise subprocess.TimeoutExpired("box", timeout or 0.0)
            return self._process.exitcode

    def send_signal(self, number: int) -> None:
        """Send it a signal, if it runs."""
        if self.poll() is None:
            os.kill(self._process.pid or 0, number)

    def kill(self) -> None:
        """End it."""
        self._process.kill()


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """A context that Ctrl-C does not interrupt before its end: in what Python does about a fork it would be lost."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _run(words: Sequence[str], stdin: int, stdout: int, parents: Sequence[int]) -> None:
    """In the forked process: what `python -m basecal.box` does."""
    os.setsid()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for each in parents:
        os.close(each)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for file, stream in ((stdin, 0), (stdout, 1), (nowhere, 2)):
        os.dup2(file, stream)
        os.close(file)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    sys.argv = ["box", *words]
    box.main()


@contextmanager
def boxes() -> Iterator[None]:
    """A context in which boxes are forked from this process."""
    names = {name: getattr(subprocess, name) for name in ("PIPE", "DEVNULL", "TimeoutExpired")}
    with mock.patch.object(box, "subprocess", SimpleNamespace(Popen=ForkedBox, **names)):
        yield
