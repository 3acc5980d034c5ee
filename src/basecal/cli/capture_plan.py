"""The plan of a capture: generated or read, checked as a whole, and printed, before anything moves."""

from __future__ import annotations

import sys
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from basecal.cli.terminal import say
from basecal.errors import InputError, UsageError
from basecal.planning.patterns import PATTERNS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from basecal.acquisition.rig import Rig
    from basecal.cell import Calibration, Cell, Sample
    from basecal.cli.replanning import Replanner, Task
    from basecal.planning.plan_check import PlanCheck, SpeedLimits
    from basecal.planning.sketch import Sketch

_CELL = "cell.yaml"
SAMPLES = 25  # default number
_SHOWN_SAMPLES = 20  # printed refusals, one per line


def known_sketch(folder: Path, is_led: bool = False) -> Sketch:
    """The sketch of a cell from its latest run if that can be trusted, otherwise from its statement.

    Args:
        folder: The cell's folder.
        is_led: Whether a person guides the arms, so that a target need not be visible in a cell with a scene.
    """
    from basecal.cell.files import read_cell
    from basecal.planning.prospects import calibrated_sketch
    from basecal.planning.sketch import led_sketch

    cell = read_cell(folder)
    if is_led and cell.sees_scene:
        return led_sketch(cell)
    return calibrated_sketch(cell, _trusted_calibration(folder, cell))


def _trusted_calibration(folder: Path, cell: Cell) -> Calibration | None:
    """The latest run if arms may move by it; None if it is outdated, not good, or verification found a change."""
    from basecal.cell.files import input_hashes, latest_run, read_calibration, read_verifications

    run = latest_run(folder)
    if run is None:
        return None
    known = read_calibration(run)
    is_current = known.inputs.get(_CELL) == input_hashes(folder, cell).get(_CELL)
    verified = [each.moved for each in read_verifications(folder) if each.run == run.name]
    has_moved = bool(verified) and verified[-1] is not False
    return known if is_current and known.verdict == "good" and not has_moved else None


def capture_plan(
    rig: Rig,
    sketch: Sketch,
    folder: Path,
    pattern: str,
    samples: int | None,
    seed: int,
    replanner: Replanner | None = None,
    task: Task | None = None,
    is_continued: bool = True,
) -> tuple[Sequence[Sample], bool]:
    """The rest of an interrupted plan, or a new plan, and whether it is new."""
    from basecal.acquisition.capture import remaining_samples
    from basecal.acquisition.rig import starting_states
    from basecal.cell.files import read_plan
    from basecal.cli.replanning import shifts_for_task
    from basecal.errors import spelling_hint

    if replanner is not None:
        return replanner.samples, True
    left = remaining_samples(folder, sketch.cell)
    if left:
        return left, False
    count = samples or SAMPLES
    seed += _finished_count(folder, sketch, count, is_continued)
    if pattern not in PATTERNS:
        if not Path(pattern).is_file():
            names = ", ".join(PATTERNS)
            hint = spelling_hint(pattern, PATTERNS)
            raise InputError(f"no pattern {pattern!r}{hint}; it is one of {names}, or a file")
        return read_plan(pattern, folder, sketch.cell), True
    home = starting_states(rig, sketch)
    if task is not None:
        most = count if task.tolerance_m is None else samples
        return shifts_for_task(task, sketch.cell, folder, home, most, seed), True
    return PATTERNS[pattern](sketch, home, count, seed), True


def _finished_count(folder: Path, sketch: Sketch, count: int, is_continued: bool) -> int:
    """Number of recorded samples of a finished capture, 0 if there is none, which changes the seed of further ones.

    Raises:
        UsageError: if the plan is finished and no further samples are requested.
    """
    from basecal.acquisition.capture import finished_count

    recorded = finished_count(folder, sketch.cell)
    if recorded is None:
        return 0
    if not is_continued:
        samples = f"{recorded} sample{' is' if recorded == 1 else 's are'} recorded"
        raise UsageError(f"The plan is finished: {samples}. Add --more to record {count} more")
    return recorded


def checked_plan(
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

    sent = movers(rig)
    home = {name: robot.state().state for name, robot in rig.robots.items() if robot.is_live or name in sent}
    return check_plan(sketch, home, plan, limits, goal_checks(sent if asks_controllers else dict.fromkeys(sent)))


def refuse(plan_check: PlanCheck, samples: int) -> None:
    """Print why samples of a plan are refused.

    Raises:
        InputError: if any sample is refused.
    """
    for refusal in plan_check.refusals[:_SHOWN_SAMPLES]:
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
    led = [name for name, robot in rig.robots.items() if robot.is_live and name not in moving]
    camera, target = sketch.view
    begun = "" if is_new else "continues the interrupted plan: "
    say(
        f"{begun}{len(plan)} samples; {' and '.join(moving) or 'no robot'} will move{_speeds(plan_check)}, "
        f"with {target} in view of {camera} at every stop; {_ways(plan_check)}"
    )
    for name in {way.robot for way in plan_check.ways if way.gaps}:
        for problem in robot_capsules(sketch, name)[1]:
            say(f"WARNING: {name}: {problem}. A line with a radius of 60 mm is checked instead")
    if replanner is not None:
        say(replanner.words())
    if led:
        say(f"{' and '.join(led)} will be guided by hand: a sample is taken when all are at rest at a new pose")
    if not go and not rig.cameras:
        say("nothing has moved: no camera has a `driver`. Add it to cell.yaml before --go")
    elif not go:
        say("nothing has moved: add --go, with a hand on the emergency stop")


def _speeds(plan_check: PlanCheck) -> str:
    if not plan_check.ways:
        return ""
    joint, tool = max(way.joint_rad_s for way in plan_check.ways), max(way.tool_m_s for way in plan_check.ways)
    return f", no joint faster than {degrees(joint):.3g} deg/s and no point faster than {1e3 * tool:.0f} mm/s"


def _ways(plan_check: PlanCheck) -> str:
    """Text with the least clearances between robots and of robots from boxes."""
    gaps = sorted((gap for way in plan_check.ways for gap in way.gaps), key=lambda gap: -gap.gap_m)
    least = {(gap.robot, gap.other): f"{1e3 * gap.gap_m:.0f} mm between {gap.robot} and {gap.other}" for gap in gaps}
    known = ", ".join(least.values())
    return f"least clearance of motions: {known}; nothing else is checked" if known else "the motions are not checked"


def say_ways(plan_check: PlanCheck) -> None:
    """Print each robot's motion to each sample with its speeds and clearances, and which samples are refused."""
    why = {refusal.sample for refusal in plan_check.refusals}
    say("sample  robot       joint deg/s  tool mm/s  clearance mm")
    for way in plan_check.ways:
        gaps = [f"{gap.other if gap.robot == way.robot else gap.robot} {1e3 * gap.gap_m:.0f}" for gap in way.gaps]
        speeds = f"{degrees(way.joint_rad_s):11.1f}  {1e3 * way.tool_m_s:9.0f}"
        verdict = "  refused" if way.sample in why else ""
        say(f"{way.sample:6d}  {way.robot:10s}  {speeds}  {', '.join(gaps)}{verdict}")
