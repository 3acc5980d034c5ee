"""The running check of a capture: its sigma beside the report's, its reports and their delay, and its time.

Captures of two UR5e are simulated as points: the arms, their faults and the poses are those of `basecal simulate
--process`, and the corners of the board are projected with noise.

`sigma`: the last estimate of a capture beside `calibrate` on the same recording. `clean`: captures without a fault, in
which all reports are false. `bump`, `remount` and `joint`: a fault of random size. The delay of the report is relative
to the first sample at which the most powerful test with known truth passes its 1 % threshold. This test is the
likelihood ratio of the true fault with the true noise; bases and mounts are unknown. Real recordings are replayed
sample by sample.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student
from tests.shared.machine_unit import unit_s

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.systematic_errors.score_tests import score_from_sums, view_sums
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.acquisition.running.check import Doubt, RunningCheck
from basecal.cell import Cell, PixelObservation, Recording, RobotState, Sample
from basecal.effects.faces.candidates import Candidates
from basecal.effects.joint_offsets import candidates as joint_offsets
from basecal.errors import BasecalError, DatasetError
from basecal.estimation.noise.robot_noise import with_robot_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve, solve_from
from basecal.geometry import Array
from basecal.kinematics import SerialChain
from basecal.planning import poses
from basecal.planning.sketch import sketch_cell
from basecal.simulation.running.faults import read_faults
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.two_arms import two_arms
from basecal.simulation.running.world import World
from benchmarks.calibrate import SIMULATED_NAME, recordings
from benchmarks.common import Kept, cpu_seconds, on_one_core, table, write

SAMPLES, SIGMA_CAPTURES, CLEAN, FAULTY, BY_POSES, LATEST_SAMPLES = 25, 60, 60, 40, 40, 3
MOST_REAL = 60  # samples of a real recording
PIXEL_PX = 0.05
POSE_SIGMA = np.repeat([2.5e-5, 4.2e-5], 3)  # [m, rad] of a stop of an arm whose joints repeat to 30 urad
LOOSE = 0.1  # [m, rad] of stops with which each view is where its own points have it
THRESHOLD = float(norm.ppf(0.99))
ARMS = (
    "", "joint-offsets=0.2", "link-errors=0.5", "backlash=0.1", "encoder-noise=0.02", "sag=0.1",
    "joint-offsets=0.02 sag=0.01", "backlash=0.02 encoder-noise=0.005", "link-errors=0.1", "base-bumped=3.8",
)  # fmt: skip
ARM_FAULTS = ("joint-offsets=0.2", "link-errors=0.5", "sag=0.1", "joint-offsets=0.05 link-errors=0.2")
FRAMES = {"bump": "eye_base_from_hand_base", "remount": "hand_flange_from_board"}
FAULTS = {"bump": "base-bumped", "remount": "board-remounted"}
KINDS = ("bump", "remount", "joint")
HEAD_FAULT = (
    "fault",
    "captures",
    "reported in time",
    "later",
    "never",
    "delay in samples, median and largest",
    "early",
)
HEAD_REAL = ("recording", "samples", "odd samples", "lasting changes", "report")


@cache
def plan_samples(seed: int, count: int) -> tuple[Sample, ...]:
    """Poses to which the arms of a cell are sent."""
    world = two_arms("charuco", seed)
    sketch = sketch_cell(world.cell)
    home = {name: RobotState(joints_rad=joints) for name, joints in world.home.items()}
    return tuple(poses.plan(sketch, home, count, seed))


def capture_points(seed: int, faults: Sequence[str] = (), count: int = SAMPLES) -> tuple[World, list[Sample]]:
    """A cell, and its samples as points."""
    world = two_arms("charuco", seed, read_faults(faults))
    plant, rng = Plant(world, Clock(0)), np.random.default_rng([seed, 77])
    board, lens, samples = world.cell.targets["board"].target, world.lenses["wrist"], []
    assert board is not None
    for goal in plan_samples(seed, count):
        for robot, state in goal.robots.items():
            assert state.joints_rad is not None
            plant.move(robot, state.joints_rad, 2.0)
        plant.wait(10.0)
        mean_joints = {robot: np.mean([plant.state(robot)[1] for _ in range(12)], axis=0) for robot in goal.robots}
        robots = {robot: RobotState(joints_rad=joints) for robot, joints in mean_joints.items()}
        pixels = lens.project(plant.camera_scene("wrist").camera_from_target @ board.points)
        pixels = pixels + PIXEL_PX * rng.standard_normal(pixels.shape)
        observation = PixelObservation("wrist", "board", board.ids, pixels)
        samples.append(Sample(goal.sample, robots=robots, observations=(observation,)))
    return world, samples


def run_check(
    cell: Cell, samples: Sequence[Sample], stops: bool = False
) -> tuple[RunningCheck, list[tuple[int, Doubt]]]:
    """The check after all samples, or after the first lasting doubt, and all doubts with the index of their sample."""
    check, doubts = RunningCheck(cell), list[tuple[int, Doubt]]()
    for index, sample in enumerate(samples):
        doubts += [(index, doubt) for doubt in check.add(sample)]
        if stops and any(doubt.is_lasting for _, doubt in doubts):
            break
    return check, doubts


def compare_sigma(seed: int) -> dict[str, Any]:
    """The running sigma of the base at the end of a capture, and the report's [mm]."""
    faults = ARMS[seed % len(ARMS)]
    world, samples = capture_points(seed, faults.split())
    check, _ = run_check(world.cell, samples)
    report = calibrate(world.cell, Recording(tuple(samples)))
    report_sigma = report.transforms[FRAMES["bump"]].sigma_norms
    running = check.estimate.sigma if check.estimate is not None else None
    return {
        "seed": seed,
        "faults": faults,
        "running_mm": None if running is None else 1e3 * running[0],
        "report_mm": 1e3 * report_sigma[0],
        "verdict": report.verdict,
    }


def check_clean(seed: int) -> dict[str, Any]:
    """Reports on a capture without a fault."""
    world, samples = capture_points(seed)
    return {"seed": seed, "reported": [[count, doubt.message] for count, doubt in run_check(world.cell, samples)[1]]}


@dataclass(frozen=True, eq=False)
class Fault:
    """A capture with a fault: its samples, the kind and size of the fault, and the index of its first sample."""

    world: World
    samples: list[Sample]
    since: int
    kind: str
    size: float
    robot: str = ""
    joint: int = 0

    def moves(self, situation: Situation) -> Candidates:
        """The fault as a candidate error, whose true size is 1."""
        if self.kind == "joint":
            each = next(c for c in joint_offsets(situation) if c.about[0] == self.robot and c.code == "joint-offset")
            only = each.single(self.joint)
            return replace(only, moves=tuple(None if m is None else -self.size * m for m in only.moves))
        name = FRAMES[self.kind]
        shift = (self.world.transform(name, False).inverse() @ self.world.transform(name, True)).log()
        moves = (
            self._moves_of_group(situation, k, name, shift) if name in g.frames else None
            for k, g in enumerate(situation.problem.groups)
        )
        return Candidates("fault", (name,), (None,), "", tuple(moves))

    def _moves_of_group(self, situation: Situation, number: int, name: str, shift: Array) -> Array:
        """Right tangents of a group's views after the fault, (n, 1, 6, 1)."""
        is_after = situation.sample_indices(situation.problem.groups[number]) >= self.since
        return (is_after[:, None, None] * (situation.frame_jacobian(number, name) @ shift[:, None]))[:, None]


def draw_fault(kind: str, seed: int) -> Fault:
    """Simulate a capture with a fault of random size, place and time."""
    rng = np.random.default_rng([seed, 9, len(kind)])
    if kind != "joint":
        size, since = 0.5 * 10 ** rng.uniform(0, 1), int(rng.integers(6, 17))
        world, samples = capture_points(seed, (f"{FAULTS[kind]}={size:.4g}@{since}",))
        return Fault(world, samples, since, kind, size)
    size, robot = np.radians(0.05 * 10 ** rng.uniform(0, 1)), ("eye", "hand")[int(rng.integers(2))]
    joint = int(rng.integers(1, 5))  # the first turns the base, the last the mount
    world, samples = capture_points(seed)
    return Fault(
        world, [_with_joint_offset(s, robot, joint, size) for s in samples], 0, kind, float(size), robot, joint
    )


def _with_joint_offset(sample: Sample, robot: str, joint: int, size: float) -> Sample:
    joints = np.array(sample.robots[robot].joints_rad)
    joints[joint] += size
    return replace(sample, robots={**sample.robots, robot: RobotState(joints_rad=joints)})


def show_fault(fault: Fault, count: int) -> tuple[bool, bool, bool]:
    """Whether the first samples show a fault: with known noise, with unknown noise, and with unknown noise and joint.

    The first two are the most powerful tests of their kind at 1 %. One is the matched filter of the true fault over its
    sigma, normal without the fault. The other divides it by the noise that the other freedoms of the views show, with
    Student's t. The third is the second for a joint offset of unknown joint and sign: 1 % over all (Bonferroni).
    """
    robots = {name: replace(robot, noise=POSE_SIGMA) for name, robot in fault.world.cell.robots.items()}
    cell = replace(fault.world.cell, robots=robots, pixel_px=PIXEL_PX)
    recording = Recording(tuple(fault.samples[:count]))
    solution = solve(cell, recording, Settings(robot_noise="stated"))
    situation = Situation(solution.problem, solution.state, build_problem(cell, recording)[0], {})
    score = score_from_sums(situation.linearisation, view_sums(situation.linearisation, fault.moves(situation)))
    gradient, information = float(score.gradient[0, 0]), float(score.information[0, 0, 0])
    if not information > 0:
        return False, False, False
    filtered = -gradient / float(np.sqrt(information))
    loose = with_robot_noise(solution.problem, dict.fromkeys(robots, np.full(6, LOOSE)))
    errors = solution.state.stop_errors * solution.problem.stops.sigma / LOOSE
    within_views = solve_from(loose, replace(solution.state, stop_errors=errors), Settings(robot_noise="stated")).cost
    free = (
        solution.problem.columns[name] for name in solution.problem.unknowns.keys() & solution.problem.columns.keys()
    )
    freedoms = 6 * count - sum(columns.stop - columns.start for columns in free) - 1  # a lens is held by its prior
    level = np.sqrt(max(solution.cost - within_views - filtered**2, 0.0) / freedoms)
    tests = 2 * sum(robot.chain.n for robot in robots.values() if robot.chain is not None)
    known, unknown = (bool(filtered > float(student.ppf(1 - 0.01 / n, freedoms)) * level) for n in (1, tests))
    return filtered > THRESHOLD, known, unknown


def time_report(kind: str, seed: int) -> dict[str, Any]:
    """Sample numbers at which a fault is detectable, and at which it is reported."""
    fault = draw_fault(kind, seed)
    _, doubts = run_check(fault.world.cell, fault.samples, stops=True)
    first = min(fault.since, 3) if kind == "joint" else fault.since
    visible: list[int | None] = [None, None, None]
    for index in range(max(first, 3), SAMPLES):
        for k, is_shown in enumerate(show_fault(fault, index + 1)):
            visible[k] = index if is_shown and visible[k] is None else visible[k]
        if None not in visible:
            break
    reports = [(count, doubt) for count, doubt in doubts if count >= fault.since]
    size = np.degrees(fault.size) if kind == "joint" else fault.size
    return {
        "seed": seed,
        "size": float(size),
        "since": fault.since,
        "visible": visible[1],
        "visible_noise_known": visible[0],
        "visible_joint_unknown": visible[2] if kind == "joint" else None,
        "early": sum(count < fault.since for count, _ in doubts),
        "reported": reports[0][0] if reports else None,
        "lasting": next((count for count, doubt in reports if doubt.is_lasting), None),
        "words": [doubt.message for _, doubt in reports],
    }


def times() -> dict[str, float]:
    """CPU time of the check of the thirtieth sample [s], and in units of `benchmarks.calibrate`, for some captures."""
    times_s, units = [], []
    for seed in range(3):
        world, samples = capture_points(seed, count=30)
        check, _ = run_check(world.cell, samples[:27])
        for sample in samples[27:]:
            before = unit_s()
            times_s.append(cpu_seconds(lambda check=check, sample=sample: check.add(sample)))
            units.append(times_s[-1] / (0.5 * (before + unit_s())))
    return {"fastest_s": min(times_s), "median_s": float(np.median(times_s)), "units": float(np.median(units))}


def check_by_poses(seed: int) -> dict[str, Any]:
    """Lasting reports on arms that differ from their model, while nothing moves and neighbouring poses are in order."""
    faults = ARM_FAULTS[seed % len(ARM_FAULTS)]
    world, samples = capture_points(seed, faults.split())
    chains = {name: robot.chain for name, robot in world.cell.robots.items() if robot.chain is not None}
    robots = {name: replace(robot, chain=None, urdf=None) for name, robot in world.cell.robots.items()}
    by_pose = [replace(sample, robots=_poses(sample, chains)) for sample in samples]
    path = [by_pose.pop(0)]
    while by_pose:
        distances = [np.linalg.norm(_flange_positions(sample) - _flange_positions(path[-1])) for sample in by_pose]
        path.append(by_pose.pop(int(np.argmin(distances))))
    numbered = [replace(sample, sample=number) for number, sample in enumerate(path)]
    _, doubts = run_check(replace(world.cell, robots=robots), numbered)
    return {"seed": seed, "faults": faults, "lasting": [doubt.message for _, doubt in doubts if doubt.is_lasting]}


def _poses(sample: Sample, chains: Mapping[str, SerialChain]) -> dict[str, RobotState]:
    joints = {name: state.joints_rad for name, state in sample.robots.items()}
    return {name: RobotState(chains[name].forward(rad)) for name, rad in joints.items() if rad is not None}


def _flange_positions(sample: Sample) -> Array:
    """Positions of the flanges of a sample, (3 robots,) [m]."""
    poses = (state.base_from_flange for state in sample.robots.values())
    return np.concatenate([pose.translation for pose in poses if pose is not None])


def replay(name: str, cell: Cell, recording: Recording) -> dict[str, Any]:
    """Reports on a real recording, taken sample by sample."""
    samples = recording.samples[:MOST_REAL]
    _, doubts = run_check(cell, samples)
    odd = {doubt.sample for _, doubt in doubts if not doubt.is_lasting}
    lasting = [doubt.message for _, doubt in doubts if doubt.is_lasting]
    return {"recording": name, "samples": len(samples), "odd": sorted(odd), "lasting": lasting}


def delays(captures: Sequence[dict[str, Any]]) -> list[int | None]:
    """Delay of the report of each detectable fault in samples; None if it is never reported."""
    visible = [each for each in captures if each["visible"] is not None]
    return [
        None if capture["reported"] is None else max(capture["reported"] - capture["visible"], 0) for capture in visible
    ]


def count_in_time(captures: Sequence[dict[str, Any]]) -> int:
    """Number of faults that are reported in time."""
    return sum(delay is not None and delay <= LATEST_SAMPLES for delay in delays(captures))


def row_fault(kind: str, captures: Sequence[dict[str, Any]]) -> list[object]:
    """A line of the table with `HEAD_FAULT`."""
    reported_delays = [delay for delay in delays(captures) if delay is not None]
    spread = f"{np.median(reported_delays):g}, {max(reported_delays)}" if reported_delays else "-"
    early, detectable, timely = sum(each["early"] for each in captures), len(delays(captures)), count_in_time(captures)
    return [kind, detectable, timely, len(reported_delays) - timely, detectable - len(reported_delays), spread, early]


def row_real(each: dict[str, Any]) -> list[object]:
    """A line of the table with `HEAD_REAL`."""
    odd = ", ".join(map(str, each["odd"][:8])) + (" ..." if len(each["odd"]) > 8 else "")
    return [each["recording"], each["samples"], odd or "none", len(each["lasting"]), "; ".join(each["lasting"]) or "-"]


def count_close_sigmas(captures: Sequence[dict[str, Any]]) -> int:
    """Number of captures whose running sigma is within 20 % of the report's."""
    return sum(
        each["running_mm"] is not None and abs(each["running_mm"] / each["report_mm"] - 1) < 0.2 for each in captures
    )


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    samples = SAMPLES * len(result["clean"])
    reported = sum(len(each["reported"]) for each in result["clean"])
    time_s = result["times"]
    known = sum(
        count_in_time([{**capture, "visible": capture["visible_noise_known"]} for capture in result[kind]])
        for kind in KINDS
    )
    by_joint = [{**capture, "visible": capture["visible_joint_unknown"]} for capture in result["joint"]]
    hidden = [capture for capture in by_joint if capture["visible"] is None]
    reported_anyway = sum(capture["reported"] is not None for capture in hidden)
    rows = [row_fault(kind, result[kind]) for kind in KINDS]
    moved = sum(any("moved" in message for message in each["lasting"]) for each in result["by_poses"])
    about = f"""\
Captures of two UR5e by {SAMPLES} samples, simulated as points:

- The running sigma of the base after the last sample is compared with the report's, on good and bad arms. It is
  within 20 % in {count_close_sigmas(result["sigma"])} of {len(result["sigma"])} captures.
- {len(result["clean"])} captures without a fault have false reports at {reported} of {samples} samples.
- Other arms differ from their stated model and record poses alone, in an order in which neighbouring poses
  follow one another. Nothing moves, and {moved} of {len(result["by_poses"])} captures report that something moved.
- The check of the thirtieth sample takes {time_s["units"]:.0f} units of the section on [times of the whole
  command](#time-of-the-whole-command), of 8 ms on an idle machine. Beside other work it took
  {1e3 * time_s["median_s"]:.0f} ms of CPU time.

A fault has a random size: bumps and remounted boards of 0.5 to 5 mm, joint offsets of 0.05 to 0.5 deg. It is
detectable from the sample at which the likelihood ratio of the true fault passes the threshold of 1 % false alarms.
This test knows the fault. Like the capture it knows neither bases and mounts nor the level of the noise. A report is
in time at most {LATEST_SAMPLES} samples later. By a test that also knows the noise, {known} of
{sum(len(result[kind]) for kind in KINDS)} are in time.

A test that knows neither joint nor sign detects {len(delays(by_joint))} of {len(by_joint)} joint offsets. Of these
{count_in_time(by_joint)} are reported in time, and of the others {reported_anyway} are reported.

For ur3e_88_images the report of `calibrate` agrees with the running check. Flanges at nearly equal poses see the
board in different places before and after the sample named below. These differ by more than places on the same side
of it."""
    return f"{about}\n\n{table(HEAD_FAULT, rows)}\n\n{table(HEAD_REAL, map(row_real, result['real']))}"


def _real(kept: Kept) -> list[dict[str, Any]]:
    rows = []
    for name, load in recordings().items():
        if name == SIMULATED_NAME:
            continue
        try:
            rows.append(kept.of(f"real:{name}", lambda name=name, load=load: replay(name, *load())))
        except (DatasetError, BasecalError) as error:
            print(f"{name} is left out: {error}")
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what is not kept yet, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="file in which captures are kept, and from which a run goes on")
    parser.add_argument("--share", type=float, default=1.0, help="of the captures that are tried")
    asked = parser.parse_args(arguments)
    on_one_core()
    kept = Kept(asked.keep)

    def measure_part(name: str, count: int, measure: Any) -> list[dict[str, Any]]:
        """Results of the captures of one part."""
        seeds = range(round(asked.share * count))
        return [kept.of(f"{name}:{seed}", lambda seed=seed: measure(seed)) for seed in seeds]

    result: dict[str, Any] = {"times": kept.of("times", times)}
    for kind in KINDS:
        result[kind] = measure_part(kind, FAULTY, lambda seed, kind=kind: time_report(kind, seed))
    result |= {
        "sigma": measure_part("sigma", SIGMA_CAPTURES, compare_sigma),
        "clean": measure_part("clean", CLEAN, check_clean),
    }
    result["by_poses"] = measure_part("by_poses", BY_POSES, check_by_poses)
    result["real"] = _real(kept)
    print(section(result))
    write("running_check", result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
