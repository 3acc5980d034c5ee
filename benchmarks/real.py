"""Real recordings: requirements of the project beside measured values."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from tests.shared.real_recordings import RECORDINGS

from basecal.errors import DatasetError
from benchmarks.common import label, table, write

HEAD = ("recording", "what", "measured", "required", "holds")


def row(figure: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    limit = f"{figure['sense']} {figure['required']:g}"
    return (
        label(figure["recording"]),
        figure["what"],
        f"{figure['measured']:.3g}",
        limit,
        "yes" if figure["holds"] else "NO",
    )


def main(arguments: list[str]) -> None:
    """Measure and print; if all were measured, write results/real.json too."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.real", description=__doc__)
    parser.add_argument("--recordings", nargs="*", default=list(RECORDINGS), choices=list(RECORDINGS), metavar="NAME")
    asked = parser.parse_args(arguments)
    figures: list[dict[str, Any]] = []
    recordings = []
    for name in asked.recordings:
        try:
            figures += [{**figure._asdict(), "holds": figure.holds} for figure in RECORDINGS[name]()]
            recordings.append(name)
        except DatasetError as error:
            print(f"left out: {error}")
    print(table(HEAD, map(row, figures)))
    if recordings == list(RECORDINGS):
        write("real", {"figures": figures})


if __name__ == "__main__":
    main(sys.argv[1:])
