"""Whether each image of a capture belongs to the pose beside it: cameras that buffer, streams, folders."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from tests.shared.pose_trial import SIGMAS, sources, trial

from benchmarks.common import label, table, write


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    rows = [*_rows(result["rows"], {row["source"]: row for row in result["earlier"]})]
    taken, wrong = (sum(row[key] for row in result["rows"]) for key in ("taken", "wrong"))
    before = [sum(row[key] for row in result["earlier"]) for key in ("wrong", "taken")]
    sigma = np.median([row["sigma_px"] for row in result["rows"]])
    most = max(row["most_px"] for row in result["rows"])
    about = f"""\
An image belongs to its pose if its points are within {SIGMAS:g} sigma of their places by the recorded pose. The sigma
of a point is {sigma:.3f} px. Moves take 0.3 s, and images come 30 times a second (20 times into folders). A sample
follows the previous one at once or after half a second. Servers and programs that save images run in processes of
their own. OpenCV reads the streams.

Of {taken} samples {wrong} had an image of another pose. The largest difference was {most:.3f} px. The previous version
took a wrong image in {before[0]} of {before[1]} samples."""
    head = ("camera", "samples", "taken", "wrong", "largest difference", "latency (measured)", "wrong before")
    return f"{about}\n\n{table(head, rows)}"


def _rows(rows: list[dict[str, Any]], earlier: dict[str, dict[str, Any]]) -> Iterator[tuple[object, ...]]:
    for row in rows:
        before = earlier.get(row["source"])
        was = f"{before['wrong']} of {before['taken']}" if before else "-"
        measured = row["reports"][0].split("arrive ")[1].split(" after")[0] if row["reports"] else "-"
        most = f"{row['most_px']:.3f} px"
        yield label(row["source"]), row["samples"], row["taken"], row["wrong"], most, measured, was


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and write; return 1 if an image of another pose was taken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=26, help="of each source")
    parser.add_argument("--only", default="", help="part of the names of sources that are tried; nothing is written")
    parser.add_argument("--earlier", type=Path, help="rows that an earlier version printed, kept beside these")
    asked = parser.parse_args(arguments)
    cv2.setNumThreads(1)
    rows = []
    for seed, source in enumerate(each for each in sources() if asked.only in each.name):
        rows.append(trial(source, asked.samples, seed))
        print(json.dumps(rows[-1]), flush=True)
    if not asked.only:
        earlier = [] if asked.earlier is None else json.loads(asked.earlier.read_text(encoding="utf-8"))
        write("images_and_poses", {"rows": rows, "earlier": earlier})
    print(f"{sum(row['wrong'] for row in rows)} wrong of {sum(row['taken'] for row in rows)} taken")
    return int(any(row["wrong"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
