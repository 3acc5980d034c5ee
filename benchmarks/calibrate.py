"""Time of a whole `calibrate` on every recording at hand, in this process and one thread, without detection in images.

The unit is the time of twenty products of a 200 x 600 matrix with its transpose. It is measured before and after each
run in the same process, so that figures of different machines and days can be compared. Times are CPU times. On one
thread that is the wall time of an idle machine.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median
from typing import Any

from tests.shared.machine_unit import unit_s
from tests.shared.real_recordings import EXAMPLES, data_folder, example, moveit_cell, nao_cell

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Cell, Recording
from basecal.cell.files import read_cell, read_recording
from basecal.errors import DatasetError
from basecal.estimation.settings import Settings
from basecal.estimation.stages import Stages
from basecal.simulation import Scenario, simulate
from basecal.vision.detect import detect
from benchmarks.common import on_one_core, table, write

REPEATS = 5
LONG_S = 5.0
# Required units: for recordings of up to a hundred views, and for the larger ones.
MOST_UNITS = 60.0
MOST_UNITS_OF = {"nao_dual_axbycz": 150.0, "motoman_dual_joints": 250.0}
# A board seen ten thousand times, nothing stated. Required are 15 s if a unit takes 8 ms.
SIMULATED = Scenario(
    samples=10_000,
    target="chessboard",
    robot_noise=(3e-4, 5e-4),
    state_pixel_noise=False,
    state_robot_noise=False,
)
SIMULATED_NAME = "simulated, 10,000 samples"
MOST_UNITS_OF[SIMULATED_NAME] = 15 / 0.008
# Units of the same recordings before starts, checks and outliers were batched.
EARLIER_UNITS = {
    "ur5e_dual": 1172,
    "ur5e_images": 1516,
    "rct_charuco": 280,
    "kuka_1_chessboard": 320,
    "rct_10x10": 791,
    "ur3e_88_images": 768,
    "visp_franka_in_hand": 435,
    "visp_franka_to_hand": 137,
    "motoman_dual_joints": 2651,
}

Reader = Callable[[], tuple[Cell, Recording]]


def _detected_example(name: str) -> tuple[Cell, Recording]:
    """An example with the detections of its images."""
    cell, recording = example(name)
    return cell, detect(cell, recording)


def _published_cell(name: str) -> tuple[Cell, Recording]:
    """A published recording in the folder of a cell, with the detections of its images."""
    folder = data_folder() / name
    if not (folder / "cell.yaml").exists():
        raise DatasetError(str(folder), "does not exist: set BASECAL_DATA to the folder of the published recordings")
    cell = read_cell(folder)
    return cell, detect(cell, read_recording(folder, cell))


def _simulated() -> tuple[Cell, Recording]:
    made = simulate(SIMULATED, 1)
    return made.cell, made.recording


def recordings() -> dict[str, Reader]:
    """Readers by name: of the examples, published cells, the recordings of `benchmarks.real`, and a simulated cell."""
    shipped = sorted(path.parent.name for path in EXAMPLES.glob("*/recording/") if any(path.glob("samples.jsonl")))
    published = [name for name in EARLIER_UNITS if name not in shipped]
    return {
        **{name: lambda name=name: _detected_example(name) for name in shipped},
        **{name: lambda name=name: _published_cell(name) for name in published},
        "moveit_pose_samples": moveit_cell,
        "nao_dual_axbycz": nao_cell,
        SIMULATED_NAME: _simulated,
    }


def measure(name: str, cell: Cell, recording: Recording) -> dict[str, Any]:
    """Units of the whole calibration and of each stage, medians of several runs, or of one run if it takes long."""
    runs: list[tuple[float, dict[str, float]]] = []
    calibration: Calibration | None = None
    before = unit_s()
    for _ in range(REPEATS):
        stages = Stages(clock=time.process_time)
        began = time.process_time()
        calibration = calibrate(cell, recording, replace(Settings(), stages=stages))
        took, after = time.process_time() - began, unit_s()
        unit = 0.5 * (before + after)
        before = after
        runs.append((took / unit, {stage: s / unit for stage, s in stages.seconds.items()}))
        if took > LONG_S:
            break
    assert calibration is not None
    views = sum(len(sample.observations) for sample in recording.samples)
    whole = median(units for units, _ in runs)
    stage_units = {stage: median(by_stage.get(stage, 0.0) for _, by_stage in runs) for stage in runs[-1][1]}
    return {
        "recording": name,
        "views": views,
        "verdict": calibration.verdict,
        "before": EARLIER_UNITS.get(name),
        "units": whole,
        "most": MOST_UNITS_OF.get(name, MOST_UNITS),
        "seconds": whole * before,
        "stages": stage_units,
    }


HEAD = ("recording", "views", "verdict", "before", "units", "required", "holds", "[ms]", "longest stages, in units")
LONGEST_STAGES = 4


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table with `HEAD`."""
    longest = sorted(result["stages"].items(), key=lambda stage: -stage[1])[:LONGEST_STAGES]
    stages = ", ".join(f"{name} {units:.1f}" for name, units in longest)
    before = "" if result["before"] is None else f"{result['before']:.0f}"
    holds = "yes" if result["units"] <= result["most"] else "NO"
    numbers = before, f"{result['units']:.0f}", f"{result['most']:.0f}", holds, f"{1e3 * result['seconds']:.0f}"
    return result["recording"], str(result["views"]), result["verdict"], *numbers, stages


def main(arguments: list[str]) -> None:
    """Measure and print; if all were measured, write results/calibrate.json too."""
    readers = recordings()
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calibrate", description=__doc__)
    parser.add_argument("--recordings", nargs="*", default=list(readers), choices=list(readers), metavar="NAME")
    asked = parser.parse_args(arguments)
    on_one_core()
    rows = []
    for name in asked.recordings:
        try:
            rows.append(measure(name, *readers[name]()))
        except DatasetError as error:
            print(f"left out: {error}")
    print(table(HEAD, map(row, rows)))
    if [result["recording"] for result in rows] == list(readers):
        write("calibrate", {"rows": rows})


if __name__ == "__main__":
    main(sys.argv[1:])
