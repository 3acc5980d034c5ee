"""Command line `basecal`, or `python -m basecal`, which can be interrupted from its first import on."""

import gc
import os
import sys

# More objects than a calibration creates: they stay alive, and a whole capture leaves only some thousand in cycles.
_OBJECTS_BETWEEN_COLLECTIONS = 200_000


def run() -> int:
    """Run the command of this process and return its exit code."""
    # Libraries write to stderr when they are imported, even if the parent process closed it.
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS)
    try:
        from basecal.cli import main

        code = main()
    except KeyboardInterrupt:
        print("basecal: error: interrupted", file=sys.stderr)
        code = 130
    _end_threads(code)
    gc.freeze()  # otherwise Python collects all objects at exit, which takes 10 % of a calibration
    return code


def _end_threads(code: int) -> None:
    """Exit the process now if daemon threads still run: C++ libraries abort if Python ends threads inside them."""
    threads = sys.modules.get("threading")
    if threads is not None and any(thread.daemon for thread in threads.enumerate()):
        for stream in filter(None, (sys.stdout, sys.stderr)):
            try:
                stream.flush()
            except OSError:  # only the exit code matters
                continue
        os._exit(code)


if __name__ == "__main__":
    sys.exit(run())
