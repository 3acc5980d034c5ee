"""Generate docs/scale.md from results/*.json: estimated costs of a million cells or a thousand robots."""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.common import RESULTS, table

PAGE = Path(__file__).parents[1] / "docs" / "scale.md"
CORE_HOUR = 0.05  # US dollars, a round price of a rented core
CELLS, TRIALS, ROBOTS = 1_000_000, 100_000_000, 1000
SAMPLES_PER_ROBOT = 100
COLUMNS = 18  # of a robot with a camera and a board: its base and two mounts
ROW_BYTES = 2273  # of a cell's row with a sentence in memory, by tracemalloc
BYTES = 8


def _result(name: str) -> dict[str, Any]:
    result: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    return result


def _hours_and_price(seconds: float) -> tuple[str, str]:
    """Core hours and their price, formatted."""
    hours = seconds / 3600
    return f"{hours:,.1f}", f"{hours * CORE_HOUR:,.2f}"


def _seconds(robots: dict[str, Any]) -> float:
    """Estimated time of a thousand robots, by the largest ring measured and the slope [s]."""
    last = robots["by_robots"][-1]
    return float(last["seconds"] * (ROBOTS / last["robots"]) ** robots["slopes"]["seconds over robots"])


def _peak_bytes(robots: dict[str, Any]) -> float:
    """Estimated memory of a thousand robots [bytes].

    Views grow with the number of robots, and the covariance of bases with its square.
    """
    last = robots["by_robots"][-1]
    return float(
        (last["peak_bytes"] - _covariance_bytes(last["robots"])) * ROBOTS / last["robots"] + _covariance_bytes(ROBOTS)
    )


def _covariance_bytes(robots: int) -> int:
    """Memory of the covariance of all bases, for the largest number of copies that exist at once [bytes]."""
    return 3 * (6 * (robots - 1)) ** 2 * BYTES


def page() -> str:
    """The text of docs/scale.md."""
    study, calibrate, robots, rings = (_result(name) for name in ("study", "calibrate", "robots", "ring"))
    rate = {row["solver"]: row["rate"] / row["workers"] for row in study["rows"]}
    cell = median(row["seconds"] for row in calibrate["rows"])
    ring, slopes = robots["by_robots"][-1], robots["slopes"]
    seconds, peak = _seconds(robots), _peak_bytes(robots)
    rows = [
        (
            f"{TRIALS:,} simulated trials of 30 samples",
            f"{1e3 / rate['maximum_likelihood']:.2f} ms",
            *_hours_and_price(TRIALS / rate["maximum_likelihood"]),
        ),
        (
            f"{CELLS:,} cells calibrated, as the recordings of `benchmarks.calibrate`",
            f"{cell:.2f} s",
            *_hours_and_price(CELLS * cell),
        ),
        (
            f"{ROBOTS:,} robots in a ring, {ROBOTS * SAMPLES_PER_ROBOT:,} samples",
            f"{seconds:.0f} s",
            *_hours_and_price(seconds),
        ),
    ]
    slope_texts = (
        f"{slopes[f'{field} over {name}']:.2f}" for field in ("seconds", "peak_bytes") for name in ("robots", "samples")
    )
    dense = (COLUMNS * ROBOTS) ** 2 * BYTES / 1e9
    costs = table(("what", "each, on one core", "core hours", "US dollars"), rows)
    measured = f"{ring['robots']} robots with {ring['samples']:,} samples took {ring['seconds']:.1f} s of a core"
    ring_table = table(
        ("robots", "their noise", "time of a core", "largest memory"),
        [
            (row["robots"], row["noise"], f"{row['processor_s']:.0f} s", f"{row['peak_bytes'] / 1e9:.1f} GB")
            for row in rings["rows"]
        ],
    )
    took = f"{measured} and {ring['peak_bytes'] / 1e6:.0f} MB"
    return f"""\
# Scale

This page estimates the cost of a million cells or a thousand robots from what [benchmarks](benchmarks.md) measured.
`python -m benchmarks.scale` computes it from their results. A core hour is assumed to cost {CORE_HOUR:g} US dollars:
put in your own price.

{costs}

Cells, and the chunks of a study, are independent of one another. Twice the cores take half the time, until the disk is
the limit. Images that no one has searched yet take longer than the calibration.

A ring of robots is one problem. {took}.
The slopes of the logarithms are {", ".join(slope_texts)}: time over robots, each with as many samples,
and over samples alone; then memory likewise. A thousand would take {peak / 1e9:.1f} GB, as the covariance of all bases
grows with the square. That is the start, the maximum-likelihood state and the covariance of every base relative to
every other, as `benchmarks.robots` asks for them.

## What breaks first

- **Many cells: memory of the command that asks.** It holds the rows of all cells for the table, some
  {CELLS * ROW_BYTES / 1e9:.0f} GB for a million. Then the files: two small ones for each cell. Give each hundred
  thousand cells a folder of their own.
- **Many robots: the covariance of everything.** `basecal.solve` gives that of all unknowns together, {COLUMNS} for each
  robot with a camera and a board. It takes {dense:.1f} GB for a thousand robots, and grows with the square.
- **Many robots: `calibration.json`.** It holds that covariance as text: some 80 MB for a hundred robots, and a file of
  more than 256 MB is not read back.
- **Many robots: what `basecal calibrate` does besides.** The tests of conventions go pair by pair. Unstated noise is
  estimated by the views that each robot takes part in. Both grow as the robots do. The tests of residuals, and of
  held-out samples, invert the matrix of all unknowns once or a few times. Their time grows with the cube of the
  unknowns, and is a small part for a hundred robots. Stops that several views share keep dense blocks.

The whole command took:

{ring_table}
"""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"written: {PAGE.name}")
