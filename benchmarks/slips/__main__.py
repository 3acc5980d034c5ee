"""Each slip through the command line: what is said, whether a wrong answer passes, and what `basecal fix` makes of it.

Command: python -m benchmarks.slips [--draws 3] [--only NUMBER ...] [--show] [--keep FILE].
"""

from __future__ import annotations

import sys

from benchmarks.slips.trial import main

if __name__ == "__main__":
    main(sys.argv[1:])
