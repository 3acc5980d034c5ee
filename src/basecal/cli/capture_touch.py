"""`basecal capture --touch`: a person guides tips to marks."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from basecal.cli.connecting import ConnectionOptions, allowed_rig
from basecal.cli.terminal import print_json, quote_path, say, say_next
from basecal.errors import UsageError


def capture_touches(cell: Path, connecting: ConnectionOptions, json: bool, other_options: Sequence[object]) -> int:
    """Record touches until the person ends, and return the exit code.

    Raises:
        UsageError: if any of the options for other ways to take samples is given.
    """
    from basecal.acquisition.hand_guided_touches import take_touches
    from basecal.cell.files import read_cell

    if any(other_options):
        raise UsageError("--touch only records touches: leave out options of plans, of motion and of the page")
    described, taken = read_cell(cell), list[int]()
    with allowed_rig(described, cell, connecting) as rig:
        for sample in take_touches(rig, described, cell, sys.stdin.readline, lambda words: say(words, sys.stderr)):
            taken.append(sample.sample)
            for touch in sample.observations if not json else ():
                say(f"sample {sample.sample}: {touch.camera} at {touch.target}")
    if json:
        print_json({"cell": str(cell), "captured": taken})
    else:
        say(f"{len(taken)} touches taken")
        say_next(f"basecal calibrate {quote_path(cell)}")
    return 0 if taken else 1
