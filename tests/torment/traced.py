"""Commands under a tracer, forked one after another from one process that it holds from the start.

Only calls that are traced stop a process (strace's `--seccomp-bpf`, which needs that), and all imports are made once.
The server is `python -m torment.traced`: it reads requests and answers them, a line of JSON each.
"""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from torment.outcome import TrialFailed, longest_s

COMMAND = "basecal.cli:main"
_NEW_NETWORK = 0x40000000  # CLONE_NEWNET
_ROOT = Path(__file__).parents[2]
_STEP_S = 0.002  # between looks whether a trace is whole


class TracedServer:
    """A process that runs commands in a network namespace that has nothing but itself."""

    def __init__(self) -> None:
        self._folder = TemporaryDirectory(prefix="torment-")
        self._trace = Path(self._folder.name) / "trace"
        tracer = ["strace", "-q", "-ff", "--seccomp-bpf", "-y", "-s", "4096", "-e", "trace=%file,%network"]
        paths = [str(_ROOT / each) for each in ("src", ".", "tests")]
        self._process = subprocess.Popen(
            [*tracer, "-o", str(self._trace), sys.executable, "-m", "torment.traced"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self._own = self._trace.with_suffix(f".{self._answer()['process']}")

    def prepare(self, words: Sequence[str], folder: Path) -> None:
        """Run a command in the server itself, which imports what it needs."""
        self._ask(words=words, folder=str(folder), main=COMMAND, is_forked=False)

    def run(self, words: Sequence[str], folder: Path, main: str = COMMAND) -> tuple[int, str]:
        """Exit code of a command, and the calls of it and of all its processes.

        Args:
            words: Of its command line.
            folder: Where it is run.
            main: What runs them, `module:function`.
        """
        for path in self._traces():
            path.unlink()
        said = self._ask(words=words, folder=str(folder), main=main, is_forked=True)
        self._wait_until_whole(self._trace.with_suffix(f".{said['process']}"))
        calls = "".join(path.read_text(errors="replace") for path in self._traces())
        return os.waitstatus_to_exitcode(said["status"]), calls

    def _traces(self) -> list[Path]:
        """Traces of all processes but of the server."""
        found = sorted(self._trace.parent.iterdir(), key=lambda path: path.stat().st_ctime_ns)
        return [path for path in found if path != self._own]

    def _ask(self, **request: Any) -> dict[str, int]:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, int]:
        assert self._process.stdout is not None
        answer: dict[str, int] = json.loads(self._process.stdout.readline())
        return answer

    def _wait_until_whole(self, trace: Path) -> None:
        end = time.monotonic() + longest_s()
        while not (trace.exists() and b"+++ " in trace.read_bytes()[-80:]):
            if time.monotonic() > end:
                raise TrialFailed("strace does not end its trace")
            time.sleep(_STEP_S)


def _run(words: Sequence[str], folder: str, main: str) -> int:
    os.chdir(folder)
    module, _, name = main.partition(":")
    code: int = getattr(import_module(module), name)(list(words))
    return code


def _run_forked(words: Sequence[str], folder: str, main: str) -> None:
    """In the forked process: leave the network and run; it does not return."""
    with suppress(BaseException):
        if ctypes.CDLL(None).unshare(_NEW_NETWORK) == 0:
            os._exit(_run(words, folder, main))
    os._exit(_LOST)


_LOST = 131  # exit code of a process that never came to the command's end


def _serve() -> None:
    """Answer requests until they end; what commands print goes nowhere."""
    answers = os.fdopen(os.dup(1), "w")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    print(json.dumps({"process": os.getpid()}), file=answers, flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        words, folder, main = request["words"], request["folder"], request["main"]
        process, status = 0, 0
        if request["is_forked"]:
            process = os.fork()
            if process == 0:
                os.dup2(nowhere, 0)
                _run_forked(words, folder, main)
            _, status = os.waitpid(process, 0)
        else:
            _run(words, folder, main)
            os.chdir("/")
        print(json.dumps({"process": process, "status": status}), file=answers, flush=True)


if __name__ == "__main__":
    _serve()
