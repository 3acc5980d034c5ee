"""The plan of a capture: generated or read, checked as a whole, and printed, before anything moves."""

from __future__ import annotations

import sys
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.plan_options import DEFAULT_SAMPLES, DEFAULTS, PlanOptions, refuse_other_options
from basecal.cli.terminal import say
from basecal.errors import InputError, UsageError, count_text
from basecal.planning.patterns import PATTERNS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from basecal.acquisition.rig import Rig
    from basecal.cell import Calibration, Cell, Sample
    from basecal.cli.replanning import Replanner, Task
    from basecal.planning.plan_check import PlanCheck, SpeedLimits
    from basecal.planning.sketch import Sketch

_CELL = "cell.yaml"
_SHOWN_REFUSALS = 20  # printed refusals, one per line


def known_sketch(folder: Path, is_guided: bool = False) -> Sketch:
    """The sketch of a cell from its latest run if that can be trusted, otherwise from its statement.

    Args:
        folder: The cell's folder.
        is_guided: Whether a person guides the arms, so that a target need not be visible in a cell with a scene.
    """
    from basecal.cell.files import read_cell
    from basecal.planning.prospects import calibrated_sketch
    from basecal.planning.sketch import hand_guided_sketch

    cell = read_cell(folder)
    if is_guided and cell.sees_scene:
        return hand_guided_sketch(cell)
    return calibrated_sketch(cell, _trusted_calibration(folder, cell))


def _trusted_calibration(folder: Path, cell: Cell) -> Calibration | None:
    """The latest run if arms may move by it; None if it is outdated, not good, or verification found a change."""
    from basecal.cell.files import input_hashes, latest_run, read_calibration, read_verifications

    run = latest_run(folder)
    if run is None:
        return None
    calibration = read_calibration(run)
    is_current = calibration.inputs.get(_CELL) == input_hashes(folder, cell).get(_CELL)
    moves = [each.moved for each in read_verifications(folder) if each.run == run.name]
    has_moved = bool(moves) and moves[-1] is not False
    return calibration if is_current and calibration.verdict == "good" and not has_moved else None


def capture_plan(
    rig: Rig,
    sketch: Sketch,
    folder: Path,
    planning: PlanOptions,
    replanner: Replanner | None = None,
    task: Task | None = None,
    allows_more: bool = True,
) -> tuple[Sequence[Sample], bool]:
    """The rest of an interrupted plan, or a new plan, and whether it is new.

    Raises:
        UsageError: if the given options are not those of the interrupted plan.
    """
    from basecal.acquisition.capture import remaining_samples
    from basecal.acquisition.rig import starting_states
    from basecal.cli.replanning import shifts_for_task

    if replanner is not None:
        return replanner.samples, True
    pattern = str(planning.plan or planning.pattern or DEFAULTS["--pattern"])
    file = None if pattern in PATTERNS else _plan_of_file(pattern, folder, sketch.cell)
    remaining = remaining_samples(folder, sketch.cell)
    if remaining:
        _refuse_other_plan(file, folder, sketch.cell, len(remaining))
        if file is None:
            refuse_other_options(planning, folder, len(remaining))
        return remaining, False
    count = planning.samples or DEFAULT_SAMPLES
    seed = (planning.seed or 0) + _finished_count(folder, sketch, count, allows_more)
    if file is not None:
        return file, True
    home = starting_states(rig, sketch)
    if task is not None:
        max_count = count if task.tolerance_m is None else planning.samples
        return shifts_for_task(task, sketch.cell, folder, home, max_count, seed), True
    return PATTERNS[pattern](sketch, home, count, seed), True


def _plan_of_file(pattern: str, folder: Path, cell: Cell) -> Sequence[Sample]:
    """The samples of a file.

    Raises:
        InputError: if there is no such file.
    """
    from basecal.cell.files import read_plan
    from basecal.errors import spelling_hint

    if not Path(pattern).is_file():
        hint = spelling_hint(pattern, PATTERNS)
        raise InputError(f"no pattern and no file {pattern!r}{hint}; the patterns are {', '.join(PATTERNS)}")
    return read_plan(pattern, folder, cell)


def _refuse_other_plan(file: Sequence[Sample] | None, folder: Path, cell: Cell, remaining_count: int) -> None:
    """Refuse the samples of a file, if any, while another plan is interrupted.

    Raises:
        UsageError: if the file has other samples than the interrupted plan.
    """
    from basecal.acquisition.capture import PLAN_FILE
    from basecal.cell.files import read_plan, sample_to_dict

    if file is None:
        return
    plans = (file, read_plan(folder / PLAN_FILE, folder, cell))
    goals, interrupted_goals = ([sample_to_dict(each, "")["robots"] for each in plan] for plan in plans)
    if goals != interrupted_goals:
        raise UsageError(
            f"the file is not the interrupted plan, of which {count_text(remaining_count, 'sample')} remain: "
            f"continue that one without a file, or remove {folder / PLAN_FILE}"
        )


def _finished_count(folder: Path, sketch: Sketch, count: int, allows_more: bool) -> int:
    """Number of recorded samples of a finished capture, 0 if there is none, which changes the seed of further ones.

    Raises:
        UsageError: if the plan is finished and no further samples are requested.
    """
    from basecal.acquisition.capture import finished_count

    recorded = finished_count(folder, sketch.cell)
    if recorded is None:
        return 0
    if not allows_more:
        samples = f"{recorded} sample{' is' if recorded == 1 else 's are'} recorded"
        raise UsageError(f"The plan is finished: {samples}. Add --more to record {count} more")
    return recorded


def check_whole_plan(
    rig: Rig, sketch: Sketch, plan: Sequence[Sample], limits: SpeedLimits, asks_controllers: bool
) -> PlanCheck:
    """Check every sample and motion of a plan; robots that the program does not move are left out.

    Args:
        rig: The robots.
        sketch: The cell.
        plan: The samples with the robots' goals.
        limits: Speed limits.
        asks_controllers: Whether to ask the controllers as well, some of which run a program for that.
    """
    from basecal.acquisition.rig import goal_checks, movers
    from basecal.planning.plan_check import check_plan

    drivers = movers(rig)
    home = {name: robot.state().state for name, robot in rig.robots.items() if robot.is_live or name in drivers}
    return check_plan(sketch, home, plan, limits, goal_checks(drivers if asks_controllers else dict.fromkeys(drivers)))


def refuse_plan(plan_check: PlanCheck, samples: int) -> None:
    """Print why samples of a plan are refused.

    Raises:
        InputError: if any sample is refused.
    """
    for refusal in plan_check.refusals[:_SHOWN_REFUSALS]:
        say(str(refusal), sys.stderr)
    if plan_check.refusals:
        bad = len({refusal.sample for refusal in plan_check.refusals})
        raise InputError(f"{bad} of {samples} samples of the plan are refused: nothing was moved")


def say_plan(
    rig: Rig,
    sketch: Sketch,
    plan: Sequence[Sample],
    is_new: bool,
    plan_check: PlanCheck,
    go: bool,
    replanner: Replanner | None,
) -> None:
    """Print what a capture will do, or would do with --go."""
    from basecal.acquisition.rig import movers
    from basecal.planning.clearance import robot_capsules

    if not plan:
        say(f"{'' if replanner is None else f'{replanner.words()}; '}nothing will move")
        return
    moving = list(movers(rig))
    guided = [name for name, robot in rig.robots.items() if robot.is_live and name not in moving]
    prefix = "" if is_new else "continues the interrupted plan: "
    say(
        f"{prefix}{count_text(len(plan), 'sample')}; {' and '.join(moving) or 'no robot'} will move"
        f"{_speed_text(plan_check)}; {_clearance_text(plan_check)}"
    )
    for name in {way.robot for way in plan_check.paths if way.gaps}:
        for problem in robot_capsules(sketch, name)[1]:
            say(f"WARNING: {name}: {problem}. A line with a radius of 60 mm is checked instead")
    if replanner is not None:
        say(replanner.words())
    if guided:
        say(f"{' and '.join(guided)} will be guided by hand: a sample is taken when all are at rest at a new pose")
    if not go and not rig.cameras:
        say("nothing has moved: no camera has a `driver`. Add it to cell.yaml before --go")
    elif not go:
        say("nothing has moved: add --go, with a hand on the emergency stop")


def _speed_text(plan_check: PlanCheck) -> str:
    if not plan_check.paths:
        return ""
    joint, tool = max(way.joint_rad_s for way in plan_check.paths), max(way.tool_m_s for way in plan_check.paths)
    return f", no joint faster than {degrees(joint):.3g} deg/s and no point faster than {1e3 * tool:.0f} mm/s"


def _clearance_text(plan_check: PlanCheck) -> str:
    """Text with the least clearances between robots and of robots from boxes."""
    gaps = sorted((gap for way in plan_check.paths for gap in way.gaps), key=lambda gap: -gap.gap_m)
    least = {(gap.robot, gap.other): f"{1e3 * gap.gap_m:.0f} mm between {gap.robot} and {gap.other}" for gap in gaps}
    text = ", ".join(least.values())
    return f"least clearance of motions: {text}; nothing else is checked" if text else "the motions are not checked"


def say_ways(plan_check: PlanCheck) -> None:
    """Print each robot's motion to each sample with its speeds and clearances, and which samples are refused."""
    refused_samples = {refusal.sample for refusal in plan_check.refusals}
    say("sample  robot       joint deg/s  tool mm/s  clearance mm")
    for way in plan_check.paths:
        gaps = [f"{gap.other if gap.robot == way.robot else gap.robot} {1e3 * gap.gap_m:.0f}" for gap in way.gaps]
        speeds = f"{degrees(way.joint_rad_s):11.1f}  {1e3 * way.tool_m_s:9.0f}"
        verdict = "  refused" if way.sample in refused_samples else ""
        say(f"{way.sample:6d}  {way.robot:10s}  {speeds}  {', '.join(gaps)}{verdict}")
