"""`basecal`, and `python -m basecal`: the command line, interruptible from its first import on."""

import sys


def run() -> int:
    """Run the command of this process and give its exit code."""
    try:
        from basecal.cli import main

        return main()
    except KeyboardInterrupt:
        if sys.stderr is not None:
            print("basecal: error: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(run())
