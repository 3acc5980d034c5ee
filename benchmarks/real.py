"""Real recordings: what the project asks of each, beside what is measured."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from tests.shared.real_recordings import RECORDINGS

from basecal.errors import DatasetError
from benchmarks.common import label, table, write

HEAD = ("recording", "what", "measured", "required", "holds")


def row(found: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    limit = f"{found['sense']} {found['required']:g}"
    return (
        label(found["recording"]),
        found["what"],
        f"{found['measured']:.3g}",
        limit,
        "yes" if found["holds"] else "NO",
    )


def main(arguments: list[str]) -> None:
    """Measure and print; where all were measured, write results/real.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.real", description=__doc__)
    parser.add_argument("--recordings", nargs="*", default=list(RECORDINGS), choices=list(RECORDINGS), metavar="NAME")
    asked = parser.parse_args(arguments)
    found: list[dict[str, Any]] = []
    measured = []
    for name in asked.recordings:
        try:
            found += [{**figure._asdict(), "holds": figure.holds} for figure in RECORDINGS[name]()]
            measured.append(name)
        except DatasetError as error:
            print(f"left out: {error}")
    print(table(HEAD, map(row, found)))
    if measured == list(RECORDINGS):
        write("real", {"figures": found})


if __name__ == "__main__":
    main(sys.argv[1:])
