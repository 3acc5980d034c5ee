"""`basecal`, and `python -m basecal`: the command line, interruptible from its first import on."""

import gc
import os
import sys

# More than a calibration loads and makes: that stays, and a whole capture leaves some thousand objects in cycles.
_OBJECTS_BETWEEN_SEARCHES = 200_000


def run() -> int:
    """Run the command of this process and give its exit code."""
    # Libraries write to it as they are imported, even where whoever began this process closed it.
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    gc.set_threshold(_OBJECTS_BETWEEN_SEARCHES)
    try:
        from basecal.cli import main

        code = main()
    except KeyboardInterrupt:
        print("basecal: error: interrupted", file=sys.stderr)
        code = 130
    _end_threads(code)
    gc.freeze()  # else all is searched for cycles as Python ends, which takes a tenth of a calibration
    return code


def _end_threads(code: int) -> None:
    """End the process here if threads of it still run: Python would end them inside of C++ libraries, which abort."""
    threads = sys.modules.get("threading")
    if threads is not None and any(thread.daemon for thread in threads.enumerate()):
        for stream in filter(None, (sys.stdout, sys.stderr)):
            try:
                stream.flush()
            except OSError:  # the exit code counts
                continue
        os._exit(code)


if __name__ == "__main__":
    sys.exit(run())
