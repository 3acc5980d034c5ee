"""Verbs killed, or told of a fault, at their system calls that write, by strace: as the kernel would, not Python.

`python -m torment.system_calls` kills every verb at each of its calls that write, once, and prints what came of it.

A verb runs in a process that is forked from this one, which has everything imported, and waits until strace holds it.
Its calls are counted once without a fault; then each trial has one of them end the process, or fail.
"""

from __future__ import annotations

import argparse
import errno
import os
import re
import shutil
import subprocess
import sys
import time
from collections import Counter
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple

from basecal.cli import main
from torment.outcome import TrialFailed, longest_s, run_command
from torment.record import table
from torment.verbs import VERBS, check_after, files, prepared

WRITING = "openat,write,pwrite64,rename,renameat,renameat2,mkdir,mkdirat,unlink,unlinkat,rmdir,fsync,ftruncate,fchmod"
_LINE = re.compile(r"^(?:\d+ +)?(\w+)\((.*)$", re.M)
_READS = re.compile(r"O_RDONLY")
_ERRORS = ("ENOSPC", "EIO", "EROFS", "EDQUOT", "EACCES")
_STEP_S = 0.005  # between looks at whether strace holds a process
KILLED = -9
LOST = errno.ENOTRECOVERABLE  # exit code of a process that never came to the command's end


class Site(NamedTuple):
    """A system call: its name, and the how manieth of this name it is."""

    call: str
    number: int


def is_possible() -> bool:
    """Whether there is a strace that may hold other processes."""
    return shutil.which("strace") is not None and _holds()


@cache
def _holds() -> bool:
    return subprocess.run(["strace", "-qq", "-o", os.devnull, "true"], capture_output=True, check=False).returncode == 0


def kill(chance: Random, folder: Path) -> str:
    """A verb killed as it enters one of its system calls that write."""
    return _trial(chance, folder, "signal=SIGKILL")


def fault(chance: Random, folder: Path) -> str:
    """A verb whose one system call that writes fails: a disk that is full, broken, read-only, or not for this user."""
    return _trial(chance, folder, f"error={chance.choice(_ERRORS)}")


def _trial(chance: Random, folder: Path, injected: str) -> str:
    if not is_possible():
        return "no strace"
    verb = chance.choice(list(VERBS))
    return _inject(verb, chance.choice(sites(verb)), injected, folder)


def _inject(verb: str, site: Site, injected: str, folder: Path) -> str:
    """What came of a verb with a fault at one system call.

    Raises:
        TrialFailed: if it ended as none may, or the same command again is not right.
    """
    words = prepared(verb, folder)
    before = files(folder)
    code = traced(words, folder, ["-e", f"inject={site.call}:{injected}:when={site.number}"], folder / "trace")
    happened = "INJECTED" in (folder / "trace").read_text() or code == KILLED
    (folder / "trace").unlink()
    if code not in (KILLED, 0, 1, 3, 4):
        raise TrialFailed(f"{verb}, {site.call} {site.number}, {injected}: exit code {code}")
    check_after(verb, folder, words, before)
    return "no fault" if not happened else "killed" if code == KILLED else "refused" if code == 3 else "answered"


@cache
def sites(verb: str) -> list[Site]:
    """Every system call of a verb that writes to files."""
    with TemporaryDirectory(prefix="torment-") as name:
        run_command(prepared(verb, Path(name)))  # imports modules here, so that all later calls have their numbers
    with TemporaryDirectory(prefix="torment-") as name:
        folder = Path(name)
        code = traced(prepared(verb, folder), folder, [], folder / "trace")
        lines = _LINE.findall((folder / "trace").read_text())
    if code not in (0, 1, 4):
        raise RuntimeError(f"{verb} without a fault ended with {code}")
    counts: Counter[str] = Counter()
    found = []
    for call, arguments in lines:
        counts[call] += 1
        to_terminal = call == "write" and arguments.startswith(("1,", "2,"))
        if not to_terminal and not (call == "openat" and _READS.search(arguments)):
            found.append(Site(call, counts[call]))
    return found


def traced(words: list[str], folder: Path, options: list[str], trace: Path) -> int:
    """Exit code of a command in a process that strace holds; minus the number of a signal that ended it.

    Args:
        words: Of its command line.
        folder: Where it is run.
        options: Of strace.
        trace: The file of the trace.
    """
    reading, writing = os.pipe()
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        _command(words, folder, reading)
    os.close(reading)
    tracer = subprocess.Popen(
        ["strace", "-qq", "-p", str(child), "-o", str(trace), "-e", f"trace={WRITING}", *options],
        stderr=subprocess.DEVNULL,
    )
    try:
        _wait_until_held(child)
        os.write(writing, b"x")
        _, status = os.waitpid(child, 0)
    finally:
        os.close(writing)
        tracer.wait()
    return os.waitstatus_to_exitcode(status)


def _command(words: list[str], folder: Path, reading: int) -> None:
    """In the forked process: a command once its parent says so; it does not return."""
    try:
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        os.chdir(folder)
        os.read(reading, 1)
        os._exit(main(words))
    except BaseException:
        os._exit(LOST)


def _wait_until_held(process: int) -> None:
    end = time.monotonic() + longest_s()
    while "TracerPid:\t0\n" in Path(f"/proc/{process}/status").read_text():
        if time.monotonic() > end:
            raise TrialFailed("strace does not come")
        time.sleep(_STEP_S)


def kill_everywhere() -> int:
    """Kill every verb at each of its calls, print a table, and end with 1 after any failure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", action="append", choices=list(VERBS))
    came = {verb: Counter(_kill_once(verb, site) for site in sites(verb)) for verb in parser.parse_args().only or VERBS}
    lines = [(verb, counts.total(), counts["killed"], counts["failed"]) for verb, counts in came.items()]
    print(table(("verb", "calls", "killed", "failed"), lines))
    return 1 if any(counts["failed"] for counts in came.values()) else 0


def _kill_once(verb: str, site: Site) -> str:
    with TemporaryDirectory(prefix="torment-") as folder:
        try:
            return _inject(verb, site, "signal=SIGKILL", Path(folder))
        except TrialFailed as error:
            print(f"{site}: {error}", file=sys.stderr, flush=True)
            return "failed"


if __name__ == "__main__":
    sys.exit(kill_everywhere())
