"""One box for untrusted files: who reads them runs in a process of its own, within memory, time and bytes.

The process is `python -m basecal.box MODULE SECONDS BYTES WORDS...`: the module's `read_frames(words)` gives frames,
which are some plain data and some bytes, and are written to standard output. It ends with whoever started it, also by
Ctrl-C.
"""

from __future__ import annotations

import json
import math
import os
import signal
import struct
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from importlib import import_module
from typing import IO, Any

from basecal.errors import BasecalError, InputError, UsageError

_MEMORY_BYTES = 3 * 2**28  # 768 MiB beyond what libraries have mapped
_ORPHAN_S = 1.0  # that a process has to end after its parent
_LEAST_S, _BYTES_PER_S = 20, 4e6  # of the processor: for any file, and how slowly a large one may be read
_LEAST_BYTES, _TIMES = 2**30, 50  # that may come of a file: 1 GiB, or so many times its own
_LENGTHS = struct.Struct("<II")
_OWN = ("basecal", "__main__")  # rooms of modules: `__main__` is this one, where it is a process

Frame = tuple[Any, bytes]
"""Plain data, as JSON has it, and bytes."""


class BoxError(InputError):
    """The process in the box took more than it may, or crashed; without the name of what it read."""


class LibraryError(InputError):
    """A library in the box could not read the file; without the file's name."""


class BoxFault(RuntimeError):
    """A fault of this package in the box, which no file excuses; its traceback there is a note of it."""


_ERRORS: dict[Any, type[BasecalError]] = {each.exit_code: each for each in (UsageError, InputError)}


def frames(
    module: str, words: Sequence[str], size: int, ending_s: float = 0.0, silence_s: float = math.inf
) -> Iterator[Frame]:
    """Frames of a module's `read_frames`, one after another.

    Args:
        module: Its full name.
        words: Words of its request.
        size: Of the files that it reads [bytes]: time and bytes that it may take grow with it.
        ending_s: That it has to end after an interrupt, before it is killed [s].
        silence_s: After which it is ended if it gives no frame [s].

    Raises:
        InputError: if it cannot read them, or takes more than it may; without the name of the file.
        BoxFault: if the module is at fault.
    """
    seconds, most = int(_LEAST_S + size / _BYTES_PER_S), _LEAST_BYTES + _TIMES * size
    command = [sys.executable, "-m", "basecal.box", module, str(seconds), str(most), *words]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"}
    none = subprocess.DEVNULL
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=none, env=environment, start_new_session=True
    ) as process:
        assert process.stdout is not None
        try:
            while (frame := _read_in_time(process, process.stdout, silence_s, ending_s)) is not None:
                yield frame
            code = process.wait()
        finally:
            _end(process, ending_s)
    if code == -getattr(signal, "SIGXCPU", 0):
        raise BoxError(f"takes more than {seconds} s to read, no such file does")
    if code:
        raise BoxError(f"ends the process that reads it ({code})")


def _read_in_time(
    process: subprocess.Popen[bytes], stream: IO[bytes], silence_s: float, ending_s: float
) -> Frame | None:
    """The next frame; None at the end.

    Raises:
        BoxError: if it does not come in time.
        InputError: with the reason, if it could not be read.
    """
    if math.isinf(silence_s):
        return _read(stream)
    is_late = threading.Event()

    def end() -> None:
        """End what is silent, and its stream with it: an arm is stopped first."""
        is_late.set()
        _end(process, ending_s)

    timer = threading.Timer(silence_s, end)
    timer.daemon = True
    timer.start()
    try:
        frame = _read(stream)
    finally:
        timer.cancel()
    if frame is None and is_late.is_set():
        raise BoxError(f"gave no answer within {silence_s:g} s")
    return frame


def _end(process: subprocess.Popen[bytes], ending_s: float) -> None:
    """Interrupt a process that has time to end, then kill it."""
    if ending_s and process.poll() is None:
        process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            process.wait(ending_s)
    process.kill()


def _read(stream: IO[bytes]) -> Frame | None:
    """The next frame; None at the end.

    Raises:
        InputError: with the reason, if it could not be read.
        BoxFault: if the module is at fault.
    """
    lengths = stream.read(_LENGTHS.size)
    if len(lengths) < _LENGTHS.size:
        return None
    first, second = _LENGTHS.unpack(lengths)
    data, content = json.loads(stream.read(first)), stream.read(second)
    if isinstance(data, dict) and "fault" in data:
        fault = BoxFault(data["fault"])
        fault.add_note(data["traceback"])
        raise fault
    if isinstance(data, dict) and "refused" in data:
        raise _ERRORS.get(data.get("code"), LibraryError)(data["refused"])
    return data, content


def _write(frame: Frame, stream: IO[bytes]) -> int:
    data = json.dumps(frame[0]).encode()
    stream.write(_LENGTHS.pack(len(data), len(frame[1])))
    stream.write(data)
    stream.write(frame[1])
    stream.flush()
    return len(data) + len(frame[1])


def limit(seconds: int, most_bytes: int) -> None:
    """Bound this process: address space, time of the processor, and the size of files it writes."""
    if sys.platform == "win32":
        return
    import resource

    for kind, most in (
        (resource.RLIMIT_AS, _address_space_bytes() + _MEMORY_BYTES),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_FSIZE, most_bytes),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _address_space_bytes() -> int:
    """Mapped address space of this process [bytes]; an upper bound for libraries if the system does not report it."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 2**33


def _run(module: str, seconds: int, most_bytes: int, words: Sequence[str], output: IO[bytes]) -> None:
    task = import_module(module)
    limit(seconds, most_bytes)
    given = 0
    with closing(task.read_frames(words)) as given_frames:
        for frame in given_frames:
            given += _write(frame, output)
            if given > most_bytes:
                raise InputError(f"gives more than {most_bytes / 2**20:.0f} MB, no such file does")


def _end_with_parent() -> None:
    """Interrupt this process once its parent has ended, however it did: an arm that moves is stopped."""
    os.read(0, 1)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(_ORPHAN_S)
    os.kill(os.getpid(), signal.SIGKILL)


def is_own_fault(error: Exception) -> bool:
    """Whether an error is a fault of this package: of a kind of Python's own, and raised by a line of this package.

    What a library raises, in its own lines or by a kind of its own, is of the file that it reads.
    """
    if isinstance(error, BoxFault):
        return True
    if type(error).__module__ != "builtins" or isinstance(error, OSError | EOFError):
        return False
    frames_of_error = reversed([frame for frame, _ in traceback.walk_tb(error.__traceback__)])
    rooms = [str(frame.f_globals.get("__name__", "")).partition(".")[0] for frame in frames_of_error]
    return next((room for room in rooms if room not in sys.stdlib_module_names), _OWN[0]) in _OWN


def _answer(module: str, seconds: int, most_bytes: int, words: Sequence[str], output: IO[bytes]) -> None:
    """Write the frames of a module, and at the end why there are no more."""
    try:
        _run(module, seconds, most_bytes, words, output)
    except MemoryError:
        _write(({"refused": "needs more memory than such a file does", "code": InputError.exit_code}, b""), output)
    except BasecalError as error:
        _write(({"refused": str(error), "code": error.exit_code}, b""), output)
    except Exception as error:
        what = " ".join(f"{type(error).__name__} {error}".split())
        is_own = is_own_fault(error)
        told = {"fault": what, "traceback": "".join(traceback.format_exception(error))} if is_own else {"refused": what}
        _write((told, b""), output)


def main() -> None:
    """Run the task that the words of this process name; what libraries print goes nowhere."""
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    module, seconds, most_bytes, *words = sys.argv[1:]
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _answer(module, int(seconds), int(most_bytes), words, out)


if __name__ == "__main__":
    main()
