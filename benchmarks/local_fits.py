"""Whether the better of a local and the global calibration is recommended, on simulated cells.

Two arms with known mounts see a light rig of points over a wide workspace: 60 samples to calibrate the base, 60 more to
judge by. In half of the cells the hand's flange is off by a wave over the workspace, of 0.3 to 3 mm; in the others
there is the noise of stops alone. A part's truth is the root of the mean square by which targets of the later samples
in it, seen without noise, are off: a recommendation is wrong where the calibration that is not recommended has less
than `CLEARLY` of the recommended one's.
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
CLEARLY = 0.9
RIGHT = 0.95
_KEYS = ("local_m", "global_m")
HEAD = ("cells", "parts", "recommended local", "right", "error of the recommended to the better, median")
_SCENARIO = Scenario(
    samples=SAMPLES + LATER,
    target="points",
    position_m=0.4,
    robot_noise=(1e-4, 2e-4),
    camera_mount="fixed",
    target_mount="fixed",
)


def bent(sample: Sample, metres: float) -> Sample:
    """A sample whose hand says to be where it is not."""
    pose = sample.robots["hand"].base_from_flange
    assert pose is not None
    off = metres * np.array([*np.sin(pose.translation / PERIOD_M), 0.0, 0.0, 0.0])
    return replace(sample, robots={**sample.robots, "hand": RobotState(pose @ SE3.exp(off))})


def measured(seed: int) -> list[dict[str, Any]]:
    """One cell: for each part what was recommended, and the true error of both."""
    made = simulate(_SCENARIO, 60_000 + seed)
    low, high = np.log(WAVE_M)
    wave = float(np.exp(np.random.default_rng([seed, 17]).uniform(low, high))) if seed % 2 else 0.0
    samples = [bent(sample, wave) for sample in made.recording.samples]
    solution = solve(made.cell, Recording(tuple(samples[:SAMPLES])))
    parts = local_fits(solution, [BASE])
    places = _targets(made)
    nearest = np.argmin([np.linalg.norm(places - part.centre_m, axis=1) for part in parts], axis=0)
    told = []
    for number, part in enumerate(parts):
        mine = [k for k in range(SAMPLES, SAMPLES + LATER) if nearest[k] == number]
        if not mine:
            continue
        errors = [
            _error_m(made, samples, mine, base) for base in (solution.state.transforms[BASE], part.transforms[BASE])
        ]
        of = {"global_m": errors[0], "local_m": errors[1]}
        told.append({"wave_m": wave, "is_better": part.is_better, "chance": part.chance, **of})
    return told


def _targets(made: SimulatedCell) -> np.ndarray:
    """Where the target truly was in all samples, (n, 3) [m]."""
    hand = made.truth[BASE] @ made.true_base_from_flange["hand"] @ made.truth["hand_flange_from_board"]
    return np.asarray(hand.translation)


def _error_m(made: SimulatedCell, samples: Sequence[Sample], numbers: Sequence[int], base: SE3) -> float:
    """By how far targets are off that are predicted by what robots say, root of the mean square [m]."""
    truth: Mapping[str, SE3] = made.truth
    squares = []
    for number in numbers:
        said = samples[number].robots["hand"].base_from_flange
        assert said is not None
        predicted = base @ said @ truth["hand_flange_from_board"]
        true = truth[BASE] @ made.true_base_from_flange["hand"][number] @ truth["hand_flange_from_board"]
        squares.append(np.sum((predicted.translation - true.translation) ** 2))
    return float(np.sqrt(np.mean(squares)))


def row(name: str, found: Sequence[dict[str, Any]]) -> tuple[object, ...]:
    """A line of the table with `HEAD`."""
    of = [tuple(each[key] for key in (_KEYS if each["is_better"] else _KEYS[::-1])) for each in found]
    right = np.mean([other >= CLEARLY * chosen for chosen, other in of])
    to_better = np.median([chosen / min(chosen, other) for chosen, other in of])
    local = np.mean([each["is_better"] for each in found])
    return name, len(found), f"{100 * local:.0f} %", f"{100 * right:.1f} %", f"{to_better:.3f}"


def rows(found: Sequence[dict[str, Any]]) -> list[tuple[object, ...]]:
    """Lines of the table: noise alone, waves, and all."""
    still, waves = ([e for e in found if bool(e["wave_m"]) == bent] for bent in (False, True))
    return [row(name, part) for name, part in (("noise", still), ("waves", waves), ("all", found)) if part]


def section(result: dict[str, Any]) -> str:
    """Of docs/benchmarks.md."""
    about = f"""\
Parts of a workspace are calibrated separately or from all samples. The robots have noise alone, or also errors in the
form of a wave over the workspace. A recommendation is right if the true error of the other calibration is at least
{CLEARLY:g} times that of the recommended one. Required: {100 * RIGHT:g} %."""
    return f"{about}\n\n{table(HEAD, rows(result['rows']))}"


def main(arguments: Sequence[str]) -> None:
    """Draw and print; of all cells results/local_fits.json too."""
    run_cells("local_fits", arguments, CELLS, measured, lambda found: table(HEAD, rows(found)))


if __name__ == "__main__":
    main(sys.argv[1:])
