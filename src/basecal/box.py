"""Sandbox for untrusted files: they are read in a separate process with limits of memory, time and output.

The process is `python -m basecal.box MODULE SECONDS BYTES WORDS...`. The module's `read_frames(words)` yields frames,
which are plain data and bytes, and are written to standard output. The process ends when its parent ends, also by
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

_MEMORY_BYTES = 3 * 2**28  # 768 MiB in addition to the memory mapped by libraries
_ORPHAN_S = 1.0  # time of a process to end after its parent
_LEAST_LIMIT_S, _LEAST_BYTES_PER_S = 20, 4e6  # CPU time for any file, and the least reading speed of large files
_LEAST_OUTPUT_BYTES, _OUTPUT_FACTOR = 2**30, 50  # limit of the output: 1 GiB, or 50 times the size of the file
_LENGTHS = struct.Struct("<II")
_OWN_PACKAGES = ("basecal", "__main__")  # top-level packages of this project; `__main__` is this module as a process

Frame = tuple[Any, bytes]
"""Plain data that JSON can represent, and bytes."""


class BoxError(InputError):
    """The sandboxed process exceeded a limit, or crashed; the message does not name the file."""


class LibraryError(InputError):
    """A library in the sandbox could not read the file; the message does not name the file."""


class BoxFault(RuntimeError):
    """An internal error of this package in the sandbox; its traceback is added as a note."""


_ERRORS: dict[Any, type[BasecalError]] = {each.exit_code: each for each in (UsageError, InputError)}


def frames(
    module: str, words: Sequence[str], size: int, ending_s: float = 0.0, silence_s: float = math.inf
) -> Iterator[Frame]:
    """Yield the frames of a module's `read_frames`, run in the sandbox.

    Args:
        module: Full name of the module.
        words: Arguments of `read_frames`.
        size: Size of the files to read [bytes]; the limits of time and output increase with it.
        ending_s: Time of the process to end after an interrupt, before it is killed [s].
        silence_s: Timeout of a frame, after which the process is ended [s].

    Raises:
        InputError: if the module cannot read the files, or exceeds a limit. The message does not name the file.
        BoxFault: if the module has an internal error.
    """
    seconds, most_bytes = int(_LEAST_LIMIT_S + size / _LEAST_BYTES_PER_S), _LEAST_OUTPUT_BYTES + _OUTPUT_FACTOR * size
    command = [sys.executable, "-m", "basecal.box", module, str(seconds), str(most_bytes), *words]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"}
    devnull = subprocess.DEVNULL
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=devnull, env=environment, start_new_session=True
    ) as process:
        assert process.stdout is not None
        try:
            while (frame := _read_in_time(process, process.stdout, silence_s, ending_s)) is not None:
                yield frame
            code = process.wait()
        finally:
            _end(process, ending_s)
    if code == -getattr(signal, "SIGXCPU", 0):
        raise BoxError(f"takes more than {seconds} s to read, the limit for its size")
    if code:
        raise BoxError(f"ends the process that reads it ({code})")


def _read_in_time(
    process: subprocess.Popen[bytes], stream: IO[bytes], silence_s: float, ending_s: float
) -> Frame | None:
    """Read the next frame before a timeout; None at the end.

    Raises:
        BoxError: if there is no frame before the timeout.
        InputError: if the file could not be read; the message is the reason.
    """
    if math.isinf(silence_s):
        return _read(stream)
    is_late = threading.Event()

    def end() -> None:
        """End a silent process, and thereby its stream; the interrupt lets a driver stop its arm first."""
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
    """Interrupt a process if it has time to end, then kill it."""
    if ending_s and process.poll() is None:
        process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            process.wait(ending_s)
    process.kill()


def _read(stream: IO[bytes]) -> Frame | None:
    """Read the next frame; None at the end.

    Raises:
        InputError: if the file could not be read; the message is the reason.
        BoxFault: if the module has an internal error.
    """
    lengths = stream.read(_LENGTHS.size)
    if len(lengths) < _LENGTHS.size:
        return None
    data_length, content_length = _LENGTHS.unpack(lengths)
    data, content = json.loads(stream.read(data_length)), stream.read(content_length)
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
    """Limit the address space, the CPU time, and the size of written files of this process."""
    if sys.platform == "win32":
        return
    import resource

    for kind, value in (
        (resource.RLIMIT_AS, _address_space_bytes() + _MEMORY_BYTES),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_FSIZE, most_bytes),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


def _address_space_bytes() -> int:
    """Mapped address space of this process [bytes]; 8 GiB if the system does not report it."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 2**33


def _run(module: str, seconds: int, most_bytes: int, words: Sequence[str], output: IO[bytes]) -> None:
    task = import_module(module)
    limit(seconds, most_bytes)
    written_bytes = 0
    with closing(task.read_frames(words)) as frames_of_module:
        for frame in frames_of_module:
            written_bytes += _write(frame, output)
            if written_bytes > most_bytes:
                raise InputError(f"gives more than {most_bytes / 2**20:.0f} MB, the limit for its size")


def _end_with_parent() -> None:
    """Wait for the end of the parent process, then interrupt this process, so that a moving arm is stopped."""
    os.read(0, 1)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(_ORPHAN_S)
    os.kill(os.getpid(), signal.SIGKILL)


def is_own_fault(error: Exception) -> bool:
    """Whether an error is internal to this package: a built-in exception raised by code of this package.

    Exceptions raised by a library's code, or of a library's own types, are attributed to the file.
    """
    if isinstance(error, BoxFault):
        return True
    if type(error).__module__ != "builtins" or isinstance(error, OSError | EOFError):
        return False
    frames_of_error = reversed([frame for frame, _ in traceback.walk_tb(error.__traceback__)])
    packages = [str(frame.f_globals.get("__name__", "")).partition(".")[0] for frame in frames_of_error]
    raised_by = next((package for package in packages if package not in sys.stdlib_module_names), _OWN_PACKAGES[0])
    return raised_by in _OWN_PACKAGES


def _answer(module: str, seconds: int, most_bytes: int, words: Sequence[str], output: IO[bytes]) -> None:
    """Write the frames of a module, and the error if it fails."""
    try:
        _run(module, seconds, most_bytes, words, output)
    except MemoryError:
        _write(({"refused": "needs more memory to read than the limit", "code": InputError.exit_code}, b""), output)
    except BasecalError as error:
        _write(({"refused": str(error), "code": error.exit_code}, b""), output)
    except Exception as error:
        message = " ".join(f"{type(error).__name__} {error}".split())
        fault = {"fault": message, "traceback": "".join(traceback.format_exception(error))}
        answer = fault if is_own_fault(error) else {"refused": message}
        _write((answer, b""), output)


def main() -> None:
    """Run the module named by the arguments of this process; the output of libraries is discarded."""
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    module, seconds, most_bytes, *words = sys.argv[1:]
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _answer(module, int(seconds), int(most_bytes), words, output)


if __name__ == "__main__":
    main()
