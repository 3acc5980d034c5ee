"""The running check of a capture: its sigma beside the report's, what it reports and when, and its time.

Captures of two UR5e are simulated as points: the arms, their faults and the poses are those of `basecal simulate
--process`, and the corners of the board are projected with noise. `sigma`: the last estimate of a capture beside
`calibrate` on the same recording. `clean`: captures without a fault; what is reported is false. `bump`, `remount` and
`joint`: a fault of random size; the report is timed against the first sample at which the most powerful test with known
truth passes its 1 % threshold: the likelihood ratio of the true fault, with the true noise, bases and mounts unknown.
Real recordings are replayed sample by sample.
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

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.systematic_errors.score_tests import score_from_sums, sums
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
from benchmarks.calibrate import SIMULATED_NAME, recordings, unit_s
from benchmarks.common import Kept, cpu_seconds, on_one_core, table, write

SAMPLES, SIGMA_CAPTURES, CLEAN, FAULTY, BY_POSES, LATEST = 25, 60, 60, 40, 40, 3
MOST_REAL = 60  # samples of a real recording
PIXEL_PX = 0.05
POSE_SIGMA = np.repeat([2.5e-5, 4.2e-5], 3)  # [m, rad] of a stop of an arm whose joints repeat to 30 urad
LOOSE = 0.1  # [m, rad] of stops with which each view is where its own points have it
THRESHOLD = float(norm.ppf(0.99))
ARMS = (
    "", "joint-offsets=0.2", "link-errors=0.5", "backlash=0.1", "encoder-noise=0.02", "sag=0.1",
    "joint-offsets=0.02 sag=0.01", "backlash=0.02 encoder-noise=0.005", "link-errors=0.1", "base-bumped=3.8",
)  # fmt: skip
BUILT = ("joint-offsets=0.2", "link-errors=0.5", "sag=0.1", "joint-offsets=0.05 link-errors=0.2")
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
def planned(seed: int, count: int) -> tuple[Sample, ...]:
    """Where the arms of a cell are sent."""
    world = two_arms("charuco", seed)
    sketch = sketch_cell(world.cell)
    home = {name: RobotState(joints_rad=joints) for name, joints in world.home.items()}
    return tuple(poses.plan(sketch, home, count, seed))


def captured(seed: int, faults: Sequence[str] = (), count: int = SAMPLES) -> tuple[World, list[Sample]]:
    """A cell, and its samples as points."""
    world = two_arms("charuco", seed, read_faults(faults))
    plant, rng = Plant(world, Clock(0)), np.random.default_rng([seed, 77])
    board, lens, samples = world.cell.targets["board"].target, world.lenses["wrist"], []
    assert board is not None
    for wanted in planned(seed, count):
        for robot, state in wanted.robots.items():
            assert state.joints_rad is not None
            plant.move(robot, state.joints_rad, 2.0)
        plant.wait(10.0)
        read = {robot: np.mean([plant.state(robot)[1] for _ in range(12)], axis=0) for robot in wanted.robots}
        robots = {robot: RobotState(joints_rad=joints) for robot, joints in read.items()}
        pixels = lens.project(plant.camera_scene("wrist").camera_from_target @ board.points)
        pixels = pixels + PIXEL_PX * rng.standard_normal(pixels.shape)
        seen = PixelObservation("wrist", "board", board.ids, pixels)
        samples.append(Sample(wanted.sample, robots=robots, observations=(seen,)))
    return world, samples


def checked(cell: Cell, samples: Sequence[Sample], stops: bool = False) -> tuple[RunningCheck, list[tuple[int, Doubt]]]:
    """The check after all samples, or the first doubt that lasts; each doubt with the place of the sample."""
    check, found = RunningCheck(cell), list[tuple[int, Doubt]]()
    for place, sample in enumerate(samples):
        found += [(place, doubt) for doubt in check.add(sample)]
        if stops and any(doubt.is_lasting for _, doubt in found):
            break
    return check, found


def sigma(seed: int) -> dict[str, Any]:
    """The running sigma of the base at the end of a capture, and the report's [mm]."""
    faults = ARMS[seed % len(ARMS)]
    world, samples = captured(seed, faults.split())
    check, _ = checked(world.cell, samples)
    report = calibrate(world.cell, Recording(tuple(samples)))
    of_report = report.transforms[FRAMES["bump"]].sigma_norms
    running = check.estimate.sigma if check.estimate is not None else None
    return {
        "seed": seed,
        "faults": faults,
        "running_mm": None if running is None else 1e3 * running[0],
        "report_mm": 1e3 * of_report[0],
        "verdict": report.verdict,
    }


def clean(seed: int) -> dict[str, Any]:
    """What is reported of a capture without a fault."""
    world, samples = captured(seed)
    return {"seed": seed, "reported": [[count, doubt.message] for count, doubt in checked(world.cell, samples)[1]]}


@dataclass(frozen=True, eq=False)
class Fault:
    """A capture with a fault: its samples, how its views move with the fault, and when that begins."""

    world: World
    samples: list[Sample]
    since: int
    kind: str
    size: float
    robot: str = ""
    joint: int = 0

    def moves(self, of: Situation) -> Candidates:
        """The fault as an error of one size, 1 of it is the true one."""
        if self.kind == "joint":
            each = next(c for c in joint_offsets(of) if c.about[0] == self.robot and c.code == "joint-offset")
            only = each.single(self.joint)
            return replace(only, moves=tuple(None if m is None else -self.size * m for m in only.moves))
        name = FRAMES[self.kind]
        shift = (self.world.transform(name, False).inverse() @ self.world.transform(name, True)).log()
        moves = (
            ((of.rank(g) >= self.since)[:, None, None] * (of.frame_jacobian(k, name) @ shift[:, None]))[:, None]
            if name in g.frames
            else None
            for k, g in enumerate(of.problem.groups)
        )
        return Candidates("fault", (name,), (None,), "", tuple(moves))


def faulty(kind: str, seed: int) -> Fault:
    """A capture with a fault of random size, place and time."""
    rng = np.random.default_rng([seed, 9, len(kind)])
    if kind != "joint":
        size, since = 0.5 * 10 ** rng.uniform(0, 1), int(rng.integers(6, 17))
        world, samples = captured(seed, (f"{FAULTS[kind]}={size:.4g}@{since}",))
        return Fault(world, samples, since, kind, size)
    size, robot = np.radians(0.05 * 10 ** rng.uniform(0, 1)), ("eye", "hand")[int(rng.integers(2))]
    joint = int(rng.integers(1, 5))  # the first turns the base, the last the mount
    world, samples = captured(seed)
    return Fault(world, [_off(s, robot, joint, size) for s in samples], 0, kind, float(size), robot, joint)


def _off(sample: Sample, robot: str, joint: int, size: float) -> Sample:
    joints = np.array(sample.robots[robot].joints_rad)
    joints[joint] += size
    return replace(sample, robots={**sample.robots, robot: RobotState(joints_rad=joints)})


def shown(fault: Fault, count: int) -> tuple[bool, bool, bool]:
    """Whether the first samples show a fault to who knows it: with the true noise, and with the level of noise unknown.

    Both are the most powerful tests of their kind at 1 %: the matched filter of the true fault over its sigma, normal
    without the fault, and the same over the noise that the other freedoms of the views show, Student's t. Third the
    latter if neither the joint of a joint offset nor its sign is known: 1 % over all of them (Bonferroni).
    """
    robots = {name: replace(robot, noise=POSE_SIGMA) for name, robot in fault.world.cell.robots.items()}
    cell = replace(fault.world.cell, robots=robots, pixel_px=PIXEL_PX)
    recording = Recording(tuple(fault.samples[:count]))
    found = solve(cell, recording, Settings(robot_noise="stated"))
    of = Situation(found.problem, found.state, build_problem(cell, recording)[0], {})
    score = score_from_sums(of.linearisation, sums(of.about, fault.moves(of)))
    gradient, information = float(score.gradient[0, 0]), float(score.information[0, 0, 0])
    if not information > 0:
        return False, False, False
    filtered = -gradient / float(np.sqrt(information))
    loose = with_robot_noise(found.problem, dict.fromkeys(robots, np.full(6, LOOSE)))
    errors = found.state.stop_errors * found.problem.stops.sigma / LOOSE
    within_views = solve_from(loose, replace(found.state, stop_errors=errors), Settings(robot_noise="stated")).cost
    free = (found.problem.columns[name] for name in found.problem.unknowns.keys() & found.problem.columns.keys())
    freedoms = 6 * count - sum(where.stop - where.start for where in free) - 1  # a lens is held by its prior
    level = np.sqrt(max(found.cost - within_views - filtered**2, 0.0) / freedoms)
    tests = 2 * sum(robot.chain.n for robot in robots.values() if robot.chain is not None)
    known, unknown = (bool(filtered > float(student.ppf(1 - 0.01 / n, freedoms)) * level) for n in (1, tests))
    return filtered > THRESHOLD, known, unknown


def reported(kind: str, seed: int) -> dict[str, Any]:
    """When a fault can be seen, and when it is reported: numbers of samples."""
    fault = faulty(kind, seed)
    _, doubts = checked(fault.world.cell, fault.samples, stops=True)
    first = min(fault.since, 3) if kind == "joint" else fault.since
    can: list[int | None] = [None, None, None]
    for place in range(max(first, 3), SAMPLES):
        for k, is_shown in enumerate(shown(fault, place + 1)):
            can[k] = place if is_shown and can[k] is None else can[k]
        if None not in can:
            break
    after = [(count, doubt) for count, doubt in doubts if count >= fault.since]
    size = np.degrees(fault.size) if kind == "joint" else fault.size
    return {
        "seed": seed,
        "size": float(size),
        "since": fault.since,
        "visible": can[1],
        "visible_noise_known": can[0],
        "visible_joint_unknown": can[2] if kind == "joint" else None,
        "early": sum(count < fault.since for count, _ in doubts),
        "reported": after[0][0] if after else None,
        "lasting": next((count for count, doubt in after if doubt.is_lasting), None),
        "words": [doubt.message for _, doubt in after],
    }


def times() -> dict[str, float]:
    """CPU time of the check of the thirtieth sample [s] and in units of `benchmarks.calibrate`, of several captures."""
    found, units = [], []
    for seed in range(3):
        world, samples = captured(seed, count=30)
        check, _ = checked(world.cell, samples[:27])
        for sample in samples[27:]:
            before = unit_s()
            found.append(cpu_seconds(lambda check=check, sample=sample: check.add(sample)))
            units.append(found[-1] / (0.5 * (before + unit_s())))
    return {"fastest_s": min(found), "median_s": float(np.median(found)), "units": float(np.median(units))}


def by_poses(seed: int) -> dict[str, Any]:
    """What is reported of arms built otherwise than stated, where nothing moves and neighbours follow one another."""
    faults = BUILT[seed % len(BUILT)]
    world, samples = captured(seed, faults.split())
    chains = {name: robot.chain for name, robot in world.cell.robots.items() if robot.chain is not None}
    robots = {name: replace(robot, chain=None, urdf=None) for name, robot in world.cell.robots.items()}
    posed = [replace(sample, robots=_poses(sample, chains)) for sample in samples]
    path = [posed.pop(0)]
    while posed:
        apart = [np.linalg.norm(_places(sample) - _places(path[-1])) for sample in posed]
        path.append(posed.pop(int(np.argmin(apart))))
    numbered = [replace(sample, sample=number) for number, sample in enumerate(path)]
    _, doubts = checked(replace(world.cell, robots=robots), numbered)
    return {"seed": seed, "faults": faults, "lasting": [doubt.message for _, doubt in doubts if doubt.is_lasting]}


def _poses(sample: Sample, chains: Mapping[str, SerialChain]) -> dict[str, RobotState]:
    joints = {name: state.joints_rad for name, state in sample.robots.items()}
    return {name: RobotState(chains[name].forward(rad)) for name, rad in joints.items() if rad is not None}


def _places(sample: Sample) -> Array:
    """Where the flanges of a sample are, (3 robots,) [m]."""
    poses = (state.base_from_flange for state in sample.robots.values())
    return np.concatenate([pose.translation for pose in poses if pose is not None])


def replayed(name: str, cell: Cell, recording: Recording) -> dict[str, Any]:
    """What is reported of a real recording, taken sample by sample."""
    samples = recording.samples[:MOST_REAL]
    _, doubts = checked(cell, samples)
    odd = {doubt.sample for _, doubt in doubts if not doubt.is_lasting}
    lasting = [doubt.message for _, doubt in doubts if doubt.is_lasting]
    return {"recording": name, "samples": len(samples), "odd": sorted(odd), "lasting": lasting}


def delays(found: Sequence[dict[str, Any]]) -> list[int | None]:
    """Of the faults that can be seen, how many samples later each is reported; None where it never is."""
    visible = [each for each in found if each["visible"] is not None]
    return [None if of["reported"] is None else max(of["reported"] - of["visible"], 0) for of in visible]


def in_time(found: Sequence[dict[str, Any]]) -> int:
    """How many faults are reported in time."""
    return sum(delay is not None and delay <= LATEST for delay in delays(found))


def row_fault(kind: str, found: Sequence[dict[str, Any]]) -> list[object]:
    """A line of the table with `HEAD_FAULT`."""
    told = [delay for delay in delays(found) if delay is not None]
    spread = f"{np.median(told):g}, {max(told)}" if told else "-"
    early, seen, soon = sum(each["early"] for each in found), len(delays(found)), in_time(found)
    return [kind, seen, soon, len(told) - soon, seen - len(told), spread, early]


def row_real(each: dict[str, Any]) -> list[object]:
    """A line of the table with `HEAD_REAL`."""
    odd = ", ".join(map(str, each["odd"][:8])) + (" ..." if len(each["odd"]) > 8 else "")
    return [each["recording"], each["samples"], odd or "none", len(each["lasting"]), "; ".join(each["lasting"]) or "-"]


def within(found: Sequence[dict[str, Any]]) -> int:
    """Captures whose running sigma is within 20 % of the report's."""
    return sum(
        each["running_mm"] is not None and abs(each["running_mm"] / each["report_mm"] - 1) < 0.2 for each in found
    )


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    samples = SAMPLES * len(result["clean"])
    reported = sum(len(each["reported"]) for each in result["clean"])
    time_s = result["times"]
    known = sum(in_time([{**of, "visible": of["visible_noise_known"]} for of in result[kind]]) for kind in KINDS)
    by_joint = [{**of, "visible": of["visible_joint_unknown"]} for of in result["joint"]]
    hidden = [of for of in by_joint if of["visible"] is None]
    rows = [row_fault(kind, result[kind]) for kind in KINDS]
    moved = sum(any("moved" in message for message in each["lasting"]) for each in result["by_poses"])
    about = f"""\
Captures of two UR5e by {SAMPLES} samples, simulated as points:

- The running sigma of the base after the last sample is compared with the report's, on good and bad arms. It is
  within 20 % in {within(result["sigma"])} of {len(result["sigma"])} captures.
- {len(result["clean"])} captures without a fault have false reports at {reported} of {samples} samples.
- Other arms differ from their stated model and record poses alone, in an order in which neighbouring poses
  follow one another. Nothing moves, and {moved} of {len(result["by_poses"])} captures report that something moved.
- The check of the thirtieth sample takes {time_s["units"]:.0f} units of the section on [times of the whole
  command](#time-of-the-whole-command), of 8 ms on an idle machine. Beside other work it took
  {1e3 * time_s["median_s"]:.0f} ms of CPU time.

A fault has a random size: bumps and remounted boards of 0.5 to 5 mm, joint offsets of 0.05 to 0.5 deg. It is
detectable from the sample at which the likelihood ratio of the true fault passes the threshold of 1 % false alarms.
This test knows the fault. Like the capture it knows neither bases and mounts nor the level of the noise. A report is
in time at most {LATEST} samples later. By a test that also knows the noise, {known} of
{sum(len(result[kind]) for kind in KINDS)} are in time.

A test that knows neither joint nor sign detects {len(delays(by_joint))} of {len(by_joint)} joint offsets. Of these
{in_time(by_joint)} are reported in time, and of the others {sum(of["reported"] is not None for of in hidden)} are
reported.

For ur3e_88_images the report of `calibrate` agrees with the running check. Flanges at nearly equal poses see the
board in different places before and after the sample named below. These differ by more than places on the same side
of it."""
    return f"{about}\n\n{table(HEAD_FAULT, rows)}\n\n{table(HEAD_REAL, map(row_real, result['real']))}"


def _real(kept: Kept) -> list[dict[str, Any]]:
    found = []
    for name, load in recordings().items():
        if name == SIMULATED_NAME:
            continue
        try:
            found.append(kept.of(f"real:{name}", lambda name=name, load=load: replayed(name, *load())))
        except (DatasetError, BasecalError) as error:
            print(f"{name} is left out: {error}")
    return found


def main(words: Sequence[str] | None = None) -> int:
    """Measure what is not kept yet, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="file in which captures are kept, and from which a run goes on")
    parser.add_argument("--share", type=float, default=1.0, help="of the captures that are tried")
    asked = parser.parse_args(words)
    on_one_core()
    kept = Kept(asked.keep)

    def each(name: str, count: int, measured: Any) -> list[dict[str, Any]]:
        """Captures of one part."""
        seeds = range(round(asked.share * count))
        return [kept.of(f"{name}:{seed}", lambda seed=seed: measured(seed)) for seed in seeds]

    result: dict[str, Any] = {"times": kept.of("times", times)}
    for kind in KINDS:
        result[kind] = each(kind, FAULTY, lambda seed, kind=kind: reported(kind, seed))
    result |= {"sigma": each("sigma", SIGMA_CAPTURES, sigma), "clean": each("clean", CLEAN, clean)}
    result["by_poses"] = each("by_poses", BY_POSES, by_poses)
    result["real"] = _real(kept)
    print(section(result))
    write("running_check", result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
