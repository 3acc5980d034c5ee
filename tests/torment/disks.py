"""Verbs on a slow disk, and in folders that their user may read but not write."""

from __future__ import annotations

import ctypes
import os
import stat
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from basecal.cli import main
from torment import system_calls
from torment.outcome import TrialFailed, run_command
from torment.verbs import VERBS, check_after, files, prepared

_DELAYS_US = (1_000, 20_000)  # of each call that writes: a card, and a share over a bad network
_MOST_DELAYED = 300  # calls, which bounds the time
_CAPABILITIES = 0x20080522  # the version of what is told to the kernel
_NO_WRITING = ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH)


def slow_disk(chance: Random, folder: Path) -> str:
    """A verb whose every call that writes takes long: it ends as ever, and may be killed meanwhile as ever."""
    if not system_calls.is_possible():
        return "no strace"
    verb, delay = chance.choice(list(VERBS)), chance.choice(_DELAYS_US)
    words = prepared(verb, folder)
    before = files(folder)
    delayed = ["-e", f"inject={system_calls.WRITING}:delay_enter={delay}:when=1..{_MOST_DELAYED}"]
    site = chance.choice(system_calls.sites(verb)) if chance.random() < 0.5 else None
    killed = [] if site is None else ["-e", f"inject={site.call}:signal=SIGKILL:when={site.number}"]
    code = system_calls.traced(words, folder, [*delayed, *killed], folder / "trace")
    (folder / "trace").unlink()
    if code not in (0, 1, 4) and (site is None or code != system_calls.KILLED):
        raise TrialFailed(f"{verb}, {delay} us a call: exit code {code}")
    check_after(verb, folder, words, before)
    return "killed" if code == system_calls.KILLED else "answered"


def read_only(chance: Random, folder: Path) -> str:
    """A verb in folders that may not be written: an answer or a line that says so, and nothing is changed."""
    if not sys.platform.startswith("linux"):
        return "no Linux"
    verb = chance.choice(list(VERBS))
    with TemporaryDirectory(prefix="torment-") as name:
        run_command(prepared(verb, Path(name)))  # imports what it needs here: elsewhere it might not be let to
    words = prepared(verb, folder)
    before = files(folder)
    where = [path for path in (folder, *folder.rglob("*")) if path.is_dir() or chance.random() < 0.5]
    modes = {path: path.stat().st_mode for path in where}
    for path, mode in modes.items():
        path.chmod(mode & _NO_WRITING)
    try:
        code, said = _unprivileged(words, folder)
        after = files(folder)
    finally:
        for path, mode in modes.items():
            path.chmod(mode)
    if code not in (0, 1, 3, 4) or (code == 3 and said.count("\n") != 1):
        raise TrialFailed(f"{verb} where nothing may be written: exit code {code}, {said[-300:]!r}")
    if after != before:
        raise TrialFailed(f"{verb} wrote where nothing may be written")
    check_after(verb, folder, words, before)
    return "refused" if code == 3 else "answered"


def _unprivileged(words: list[str], folder: Path) -> tuple[int, str]:
    """Exit code of a command in a forked process that has no more rights than its files give it, and its stderr."""
    with TemporaryDirectory(prefix="torment-") as name:
        said = Path(name) / "said"
        sys.stdout.flush()
        sys.stderr.flush()
        child = os.fork()
        if child == 0:
            code = system_calls.LOST
            try:
                with said.open("w") as err, open(os.devnull, "w") as out, redirect_stdout(out), redirect_stderr(err):
                    os.chdir(folder)
                    _drop_capabilities()
                    code = main(words)
            finally:
                os._exit(code)
        _, status = os.waitpid(child, 0)
        return os.waitstatus_to_exitcode(status), said.read_text(errors="replace")


def _drop_capabilities() -> None:
    """Root without capabilities may do what the owner of files may do."""
    header, none = (ctypes.c_uint32 * 2)(_CAPABILITIES, 0), (ctypes.c_uint32 * 6)()
    if ctypes.CDLL(None, use_errno=True).capset(header, none) != 0:
        raise OSError(ctypes.get_errno(), "capset")
