"""A module of the tests that runs in a separate process, like a robot's controller or another computer."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

TESTS = Path(__file__).parents[1]
_COUNT = itertools.count(1)


class SecondProcess:
    """A process that obeys lines on its standard input, and answers each with a line."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process

    def tell(self, *words: object) -> str:
        """Send a line of words, and return the answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()
        return self.line()

    def line(self) -> str:
        """The next line of its output."""
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()


@contextmanager
def second_process(
    module: str, *words: object, pass_fds: tuple[int, ...] = (), **environment: str
) -> Iterator[SecondProcess]:
    """Run the module, ready to obey; its standard input ends with the context, and so does the process."""
    command = [sys.executable, "-m", module, *map(str, words)]
    surroundings = {**os.environ, "PYTHONPATH": f"{TESTS.parent / 'src'}:{TESTS.parent}", **environment}
    with subprocess.Popen(
        command,
        cwd=TESTS,
        env=surroundings,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        pass_fds=pass_fds,
    ) as process:
        second = SecondProcess(process)
        try:
            assert second.line() == "ready"
            yield second
        finally:
            assert process.stdin is not None
            with suppress(BrokenPipeError):
                process.stdin.close()
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()


def own_host() -> str:
    """A loopback address that no other test uses, for protocols with a fixed port."""
    process = os.getpid() % 65536
    return f"127.{1 + next(_COUNT) % 250}.{process >> 8}.{1 + process % 250}"
