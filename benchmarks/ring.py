"""`basecal calibrate` of a ring of robots in a cell folder: the whole command, from the files to the page.

Each robot sees the next and the next but one, with a hundred samples for each robot. Noise of robots and pixels is
stated or unstated. The CPU time and the peak memory of the command are measured. Sizes that are not measured anew
keep their results.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any

import basecal
from basecal.cli import main as command
from benchmarks.common import RESULTS, table, write
from benchmarks.robots import make_ring

ROBOTS = (20, 100)
SAMPLES_PER_ROBOT = 100
NOISE = ("stated", "estimated")
HEAD = ("robots", "samples", "noise", "CPU time [s]", "wall time [s]", "peak memory [MB]", "exit code")


def _calibrate(folder: Path, answer: Any) -> None:
    """Run the command in this process, and put its exit code, times and memory into a queue."""
    begin = time.perf_counter()
    with (folder / "said.txt").open("w", encoding="utf-8") as output, redirect_stdout(output), redirect_stderr(output):
        code = command(["calibrate", str(folder / "cell"), "--verbose"])
    wall, used = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_SELF)
    answer.put((code, wall, used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss))


def measure(robots: int, noise: str) -> dict[str, Any]:
    """Measure one ring."""
    simulated = make_ring(robots, SAMPLES_PER_ROBOT * robots)
    cell = simulated.cell
    if noise == "estimated":
        unstated = {name: replace(robot, noise=None) for name, robot in cell.robots.items()}
        cell = replace(cell, robots=unstated, pixel_px=None)
    spawn = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cell").mkdir()
        basecal.write_cell(cell, folder / "cell")
        basecal.write_recording(simulated.recording, folder / "cell")
        answer: Any = spawn.Queue()
        process = spawn.Process(target=_calibrate, args=(folder, answer))
        process.start()
        code, wall, processor, peak = answer.get()
        process.join()
    sizes = {"robots": robots, "samples": SAMPLES_PER_ROBOT * robots, "noise": noise}
    return {**sizes, "processor_s": processor, "wall_s": wall, "peak_bytes": peak, "exit_code": code}


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    times = f"{result['processor_s']:.0f}", f"{result['wall_s']:.0f}"
    memory = f"{result['peak_bytes'] / 1e6:.0f}"
    return str(result["robots"]), f"{result['samples']:,}", result["noise"], *times, memory, str(result["exit_code"])


def main(arguments: list[str]) -> None:
    """Measure, print, write results/ring.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ring", description=__doc__)
    parser.add_argument("--robots", type=int, nargs="*", default=list(ROBOTS))
    parser.add_argument("--noise", nargs="*", choices=NOISE, default=list(NOISE))
    asked = parser.parse_args(arguments)
    path = RESULTS / "ring.json"
    before = json.loads(path.read_text(encoding="utf-8"))["rows"] if path.exists() else []
    rows = {(each["robots"], each["noise"]): each for each in before}
    for robots in asked.robots:
        for noise in asked.noise:
            rows[robots, noise] = measure(robots, noise)
            write("ring", {"rows": [rows[key] for key in sorted(rows)]})
    print(table(HEAD, [row(rows[key]) for key in sorted(rows)]))


if __name__ == "__main__":
    main(sys.argv[1:])
