"""Whether the better of a local and the global calibration is recommended, on simulated cells.

Two arms with known mounts see an LED rig of points over a wide workspace: 60 samples for the calibration of the base,
and 60 more for the test. In half of the cells the hand's flange is off by a wave over the workspace, of 0.3 to 3 mm.
The other cells have only the noise of stops. The true error of a part is the rms distance of predicted targets, over
the test samples in it, without noise. A recommendation is wrong if the true error of the other calibration is less
than `CLEAR_RATIO` of the recommended one's.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from basecal.accuracy.task.local_fits import local_fits
from basecal.cell import Recording, RobotState, Sample
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, SimulatedCell, simulate
from benchmarks.common import run_cells, table

BASE = "eye_base_from_hand_base"
CELLS = 50  # of four parts: 200 recommendations
SAMPLES, LATER = 60, 60
WAVE_M = (3e-4, 3e-3)  # least and most, log-uniform
PERIOD_M = 0.25  # [m/rad] of the wave
CLEAR_RATIO = 0.9
RIGHT = 0.95
_LOCAL_FIRST = ("local_m", "global_m")
HEAD = ("cells", "parts", "recommended local", "right", "error of the recommended to the better, median")
_SCENARIO = Scenario(
    samples=SAMPLES + LATER,
    target="points",
    position_m=0.4,
    robot_noise=(1e-4, 2e-4),
    camera_mount="fixed",
    target_mount="fixed",
)


def with_wave(sample: Sample, metres: float) -> Sample:
    """A sample whose hand has a recorded pose that is off by the wave."""
    pose = sample.robots["hand"].base_from_flange
    assert pose is not None
    off = metres * np.array([*np.sin(pose.translation / PERIOD_M), 0.0, 0.0, 0.0])
    return replace(sample, robots={**sample.robots, "hand": RobotState(pose @ SE3.exp(off))})


def measure(seed: int) -> list[dict[str, Any]]:
    """Rows of the parts of one cell: the recommendation, and the true errors of both calibrations."""
    simulated = simulate(_SCENARIO, 60_000 + seed)
    low, high = np.log(WAVE_M)
    wave = float(np.exp(np.random.default_rng([seed, 17]).uniform(low, high))) if seed % 2 else 0.0
    samples = [with_wave(sample, wave) for sample in simulated.recording.samples]
    solution = solve(simulated.cell, Recording(tuple(samples[:SAMPLES])))
    parts = local_fits(solution, [BASE])
    places = _targets(simulated)
    nearest = np.argmin([np.linalg.norm(places - part.centre_m, axis=1) for part in parts], axis=0)
    rows = []
    for number, part in enumerate(parts):
        part_samples = [k for k in range(SAMPLES, SAMPLES + LATER) if nearest[k] == number]
        if not part_samples:
            continue
        errors = [
            _error_m(simulated, samples, part_samples, base)
            for base in (solution.state.transforms[BASE], part.transforms[BASE])
        ]
        both_errors = {"global_m": errors[0], "local_m": errors[1]}
        rows.append({"wave_m": wave, "is_better": part.is_better, "chance": part.chance, **both_errors})
    return rows


def _targets(simulated: SimulatedCell) -> np.ndarray:
    """Where the target truly was in all samples, (n, 3) [m]."""
    hand = simulated.truth[BASE] @ simulated.true_base_from_flange["hand"] @ simulated.truth["hand_flange_from_board"]
    return np.asarray(hand.translation)


def _error_m(simulated: SimulatedCell, samples: Sequence[Sample], numbers: Sequence[int], base: SE3) -> float:
    """Rms distance of targets predicted by recorded poses from the true ones [m]."""
    truth: Mapping[str, SE3] = simulated.truth
    squares = []
    for number in numbers:
        recorded = samples[number].robots["hand"].base_from_flange
        assert recorded is not None
        predicted = base @ recorded @ truth["hand_flange_from_board"]
        true = truth[BASE] @ simulated.true_base_from_flange["hand"][number] @ truth["hand_flange_from_board"]
        squares.append(np.sum((predicted.translation - true.translation) ** 2))
    return float(np.sqrt(np.mean(squares)))


def row(name: str, parts: Sequence[dict[str, Any]]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    errors = [tuple(each[key] for key in (_LOCAL_FIRST if each["is_better"] else _LOCAL_FIRST[::-1])) for each in parts]
    right = np.mean([rival >= CLEAR_RATIO * chosen for chosen, rival in errors])
    to_better = np.median([chosen / min(chosen, rival) for chosen, rival in errors])
    local = np.mean([each["is_better"] for each in parts])
    return name, len(parts), f"{100 * local:.0f} %", f"{100 * right:.1f} %", f"{to_better:.3f}"


def rows(parts: Sequence[dict[str, Any]]) -> list[tuple[object, ...]]:
    """Lines of the table: noise alone, waves, and all."""
    still, waves = ([e for e in parts if bool(e["wave_m"]) == has_wave] for has_wave in (False, True))
    return [row(name, part) for name, part in (("noise", still), ("waves", waves), ("all", parts)) if part]


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    about = f"""\
Parts of a workspace are calibrated separately or from all samples. The robots have noise alone, or also errors in the
form of a wave over the workspace. A recommendation is right if the true error of the other calibration is at least
{CLEAR_RATIO:g} times that of the recommended one. Required: {100 * RIGHT:g} %."""
    return f"{about}\n\n{table(HEAD, rows(result['rows']))}"


def main(arguments: Sequence[str]) -> None:
    """Draw and print; with all cells write results/local_fits.json too."""
    run_cells("local_fits", arguments, CELLS, measure, lambda found: table(HEAD, rows(found)))


if __name__ == "__main__":
    main(sys.argv[1:])
