"""`basecal`, and `python -m basecal`: the command line, interruptible from its first import on."""

import os
import sys


def run() -> int:
    """Run the command of this process and give its exit code."""
    # Libraries write to it as they are imported, even where whoever began this process closed it.
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    try:
        from basecal.cli import main

        return main()
    except KeyboardInterrupt:
        print("basecal: error: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(run())
