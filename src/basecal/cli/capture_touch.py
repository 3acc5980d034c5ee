"""`basecal capture --touch`: a person guides tips to marks."""

from __future__ import annotations

import sys
from pathlib import Path

from basecal.cli.connecting import ConnectionOptions, allowed_rig
from basecal.cli.terminal import print_json, quote_path, say, say_next
from basecal.errors import count_text


def capture_touches(cell: Path, connecting: ConnectionOptions, json: bool) -> int:
    """Record touches until the person ends, and return the exit code."""
    from basecal.acquisition.hand_guided_touches import take_touches
    from basecal.cell.files import read_cell

    described, taken = read_cell(cell), list[int]()
    with allowed_rig(described, cell, connecting) as rig:
        for sample in take_touches(rig, described, cell, sys.stdin.readline, lambda words: say(words, sys.stderr)):
            taken.append(sample.sample)
            for touch in sample.observations if not json else ():
                say(f"sample {sample.sample}: {touch.camera} at {touch.target}")
    if json:
        print_json({"cell": str(cell), "captured": taken})
    else:
        say(f"{count_text(len(taken), 'touch', 'touches')} taken")
        say_next(f"basecal calibrate {quote_path(cell)}")
    return 0 if taken else 1
