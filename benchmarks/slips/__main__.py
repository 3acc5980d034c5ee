"""Each slip through the command line: whether it is named, whether a wrong answer is called good, and what `fix` fixes.

Command: python -m benchmarks.slips [--draws 3] [--only NUMBER ...] [--show] [--keep FILE].
"""

from __future__ import annotations

import sys

from benchmarks.slips.trial import main

if __name__ == "__main__":
    main(sys.argv[1:])
