"""`basecal plan`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from cyclopts import Parameter, validators

from basecal.cli.detect import detected_recording
from basecal.cli.next_step import has_drivers
from basecal.cli.option_types import (
    Box,
    OpensPage,
    Output,
    Point,
    Seed,
    given_options,
    number_range,
    refuse_options,
    task_points,
)
from basecal.cli.terminal import print_json, progress, quote_path, say
from basecal.cli.typed_words import typed_command
from basecal.errors import BasecalError, FrameNotFound, UsageError
from basecal.exchange.motions.writers import PLAN_FORMATS
from basecal.fields.typed_length import length_m

_KINDS = "; ".join(f"{name}: {each.words}" for name, each in PLAN_FORMATS.items())

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from basecal.cell import Calibration, Cell, Recording
    from basecal.planning.plan import Plan


class Step(NamedTuple):
    """A next command and its purpose."""

    purpose: str
    command: str


def plan(
    cell: Path,
    /,
    *,
    task_point: Point | None = None,
    task_box: Box | None = None,
    tolerance: str | None = None,
    samples: Annotated[int | None, number_range(1, 1000)] = None,
    pattern: Literal["poses", "shifts"] = "poses",
    touches: bool = False,
    anew: bool = False,
    seed: Seed = 0,
    to: Annotated[str | None, Parameter(help=f"Write the samples for a robot's own program. {_KINDS}.")] = None,
    robot: str | None = None,
    speed_limit_deg_s: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=360))] = 30.0,
    hold_s: Annotated[float, number_range(0, 3600)] = 2.0,
    output: Output = None,
    report: bool = False,
    opens_page: OpensPage = False,
    json: bool = False,
) -> int:
    """Plan which samples to record, and how many, to reach a tolerance at a task point.

    The planned samples reduce the error at the task the most, with both arms near
    taught poses and the whole target in view. Recorded samples count. If no
    samples reach the tolerance, the limiting source of error is printed. With -o
    the samples are written for `basecal capture --plan`, with --to for robots'
    own programs. With --touches they are touches of marks; the position of an
    additional mark is printed if that helps. --report writes the page
    CELL/plan.html: the expected error, and the poses of the arms.

    Exit code: 0 if the tolerance is reached or none is requested, else 5.

    For example:

        basecal plan mycell --tolerance 0.2mm
        basecal plan mycell --tolerance 0.2mm --task-point 0.8 0.1 0.3
        basecal plan mycell --tolerance 0.2mm --task-point "0.8 0.1 0.3" --json
        basecal plan mycell --samples 12 --task-point 0.8 0.1 0.3 -o plan.jsonl
        basecal plan mycell --samples 12 --task-point 0.8 0.1 0.3 --to csv
        basecal plan mycell --touches --samples 12 --task-point 0.6 0.1 0.3
        basecal plan mycell --tolerance 0.2mm --task-point 0.8 0.1 0.3 --report
        basecal plan mycell --pattern shifts --samples 28 --task-point 0.8 0.1 0.3
        basecal plan mycell --tolerance 1mm --task-box 0.6 -0.2 0.1 1.0 0.2 0.5

    Args:
        cell: Folder of the cell, with at least one taught pose in its recording.
        task_point: Task position x y z [m] in the reference robot's base; by default the arms' recorded working area.
        task_box: Task volume, by two opposite corners, instead of a point.
        tolerance: Length with its unit, such as 0.2mm, below which 95 % of position errors at the task must be.
        samples: Number of samples to plan; by default as many as the tolerance needs.
        pattern: poses (varied poses), or shifts (the paper's: whole stations of seven samples).
        touches: Plan touches of tips by all arms in turn, after some are recorded.
        anew: Plan as if nothing had been recorded yet.
        seed: Seed of the candidates.
        to: Write the samples for a robot's own program.
        robot: The robot of that program; by default all, if the format can contain several.
        speed_limit_deg_s: With --to: largest speed of any joint.
        hold_s: With --to: time at rest at each sample.
        output: File for the samples: with --to that program, with the ending .jsonl lines for capture, else JSON.
        report: Write the plan as a page, CELL/plan.html.
        opens_page: Show that page in a browser.
        json: Print one JSON object instead of text.
    """
    from basecal.cell.files import read_cell

    options = {"--task-point": task_point, "--task-box": task_box, "--tolerance": tolerance, "--samples": samples}
    options |= {"--pattern": pattern != "poses" and pattern, "--touches": touches, "--anew": anew, "--seed": seed}
    points = [] if task_point is None and task_box is None else task_points(task_point, task_box)
    tolerance_m = _tolerance_m(tolerance, samples)
    _check_output(to, robot, output, json, touches, given_options(plan, locals()))
    described = read_cell(cell)
    recording = detected_recording(cell, described)
    with progress("planning"):
        calibration = _find_calibration(cell, described, recording, points, task_box)
        counted = _without_observations(recording) if anew else recording
        result = _make_plan(described, counted, calibration, points, tolerance_m, samples, seed, pattern, touches)
    motion = None if to is None else _motion(described, result, to, robot, speed_limit_deg_s, hold_s)
    steps = _next_steps(described, result, tolerance_m, cell, output, options)
    _print_plan(result, tolerance_m, motion, steps, output, json)
    if report or opens_page:
        _write_page(described, result, calibration, tolerance_m, cell, steps, opens_page)
    return 5 if result.reachable is False else 0


def _tolerance_m(tolerance: str | None, count: int | None) -> float | None:
    """The tolerance [m]; None if only a number of samples is given.

    Raises:
        UsageError: if neither a tolerance nor a number of samples is given.
    """
    if tolerance is None and count is None:
        raise UsageError("give how many to plan: --tolerance LENGTH (such as 0.2mm), --samples COUNT, or both")
    return None if tolerance is None else length_m(tolerance)


def _without_observations(recording: Recording) -> Recording:
    from dataclasses import replace

    from basecal.cell import Recording

    return Recording(tuple(replace(sample, observations=()) for sample in recording.samples))


def _make_plan(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    points: list[Point],
    tolerance_m: float | None,
    count: int | None,
    seed: int,
    pattern: str,
    are_touches: bool,
) -> Plan:
    """Plan samples at varied poses, whole stations of programmed shifts, or touches."""
    from numpy import array

    from basecal.planning.plan import plan_for_task, plan_stations
    from basecal.planning.touches import plan_touches

    make_plan = plan_touches if are_touches else plan_for_task if pattern == "poses" else plan_stations
    points_m = array(points, dtype=float).reshape(-1, 3)
    return make_plan(cell, recording, calibration, points_m, tolerance_m, count, seed)


def _check_output(
    to: str | None, robot: str | None, output: Path | None, json: bool, touches: bool, options: Sequence[str]
) -> None:
    """Check the combination of options of the output.

    Raises:
        UsageError: if they exclude each other, or have no effect.
    """
    motion = [option for option in options if option in ("--speed-limit-deg-s", "--hold-s")]
    if to is None:
        refuse_options(motion, (), "without --to no robot's program is written")
    if touches and "--pattern" in options:
        raise UsageError("--pattern has no effect on --touches: leave it out")
    if to is not None and to not in PLAN_FORMATS:
        raise UsageError(f"--to: {FrameNotFound(to, list(PLAN_FORMATS))}")
    if to is None and robot is not None:
        raise UsageError("--robot needs --to, such as --to ur-script: it names the robot of that program")
    if to is not None and json and output is None:
        raise UsageError("--to and --json cannot both be printed: give -o FILE for the output of --to")


def _print_plan(
    plan_result: Plan,
    tolerance_m: float | None,
    motion: str | None,
    steps: Sequence[Step],
    output: Path | None,
    json: bool,
) -> None:
    """Print and write the requested outputs; a printed robot program is the only output."""
    from json import dumps

    from basecal.cell.files import write_plan
    from basecal.cell.format.writing import write_output
    from basecal.reporting.plans.page import plan_lines

    data = plan_dict(plan_result, tolerance_m)
    if motion is not None and output is None:
        say(motion.rstrip("\n"))
        return
    if output is not None and motion is not None:
        write_output(output, motion)
    elif output is not None and output.suffix == ".jsonl":
        write_plan(plan_result.samples, output, output.parent)
    elif output is not None:
        write_output(output, dumps(data, allow_nan=False) + "\n")
    if json:
        print_json(data)
        return
    say("\n".join(plan_lines(plan_result, tolerance_m)))
    if output is not None:
        say(f"written: {output}")
    if motion is None and steps:
        say(f"next, {steps[0].purpose}: {steps[0].command.removesuffix(' --go')}")  # a look before arms move


def _next_steps(
    cell: Cell,
    plan_result: Plan,
    tolerance_m: float | None,
    folder: Path,
    output: Path | None,
    options: Mapping[str, object],
) -> list[Step]:
    """Commands from a plan to its recording, or to the calibration if no samples are needed.

    Args:
        cell: The cell.
        plan_result: The plan.
        tolerance_m: The tolerance [m], if one is given.
        folder: The cell's folder.
        output: File of the samples, if one was written.
        options: Options of the planning command, without those of its output.
    """
    quoted_folder = quote_path(folder)
    plan_command = typed_command(f"basecal plan {quoted_folder}", options)
    if not plan_result.samples:
        is_reached = tolerance_m is not None and plan_result.needed == 0
        command = f"basecal calibrate {quoted_folder} --tolerance {1e3 * (tolerance_m or 0.0):g}mm"
        return [Step("to judge what is recorded", command)] if is_reached else []
    if any(sample.observations for sample in plan_result.samples):  # touches: a person guides the tips
        return []
    if not has_drivers(cell):
        return [Step("for robots' own programs, as the cell has no drivers", f"{plan_command} --to csv -o plan.csv")]
    is_written = output is not None and output.suffix == ".jsonl"
    file = quote_path(output) if is_written else "plan.jsonl"
    record = Step("to record the samples", f"basecal capture {quoted_folder} --plan {file} --go")
    return [record] if is_written else [Step("to write the samples", f"{plan_command} -o {file}"), record]


def _write_page(
    cell: Cell,
    plan_result: Plan,
    calibration: Calibration | None,
    tolerance_m: float | None,
    folder: Path,
    steps: Sequence[Step],
    opens: bool,
) -> None:
    """Write the page of a plan, and show it if requested."""
    from basecal.cell.format.writing import write_atomically
    from basecal.cli.page import show_page
    from basecal.reporting.plans.page import plan_page

    path = folder / "plan.html"
    words = [f"{step.purpose.capitalize()}: `{step.command}`" for step in steps]
    html = plan_page(cell, plan_result, calibration, tolerance_m, title=folder.resolve().name, steps=words)
    write_atomically(path, html, base_folder=folder)
    show_page(path, opens)


def plan_dict(plan_result: Plan, tolerance_m: float | None) -> dict[str, Any]:
    """A plan as plain data; values that are not requested or not reached are null."""
    from basecal.cell.files import sample_to_dict
    from basecal.cell.results.calibration_dict import budget_entry

    return {
        "samples": [sample_to_dict(sample, "") for sample in plan_result.samples],
        "needed": plan_result.needed,
        "predicted_mm": None if plan_result.expected_m is None else 1e3 * plan_result.expected_m,
        "reachable": plan_result.reachable,
        "tolerance_mm": None if tolerance_m is None else 1e3 * tolerance_m,
        "recorded": plan_result.recorded,
        "forbidden_by": plan_result.budget[0].source if plan_result.reachable is False and plan_result.budget else None,
        "budget": [budget_entry(entry) for entry in plan_result.budget],
        "marks": {name: place.tolist() for name, place in plan_result.marks.items()},
    }


def _motion(cell: Cell, plan_result: Plan, to: str, robot: str | None, speed_deg_s: float, hold_s: float) -> str:
    """The samples as a robot's own program."""
    from math import radians

    from basecal.exchange.motions.way import make_path

    return PLAN_FORMATS[to].text(make_path(cell, plan_result.samples, robot, radians(speed_deg_s), hold_s))


def _find_calibration(
    folder: Path, cell: Cell, recording: Recording, points: Sequence[Point], box: Box | None
) -> Calibration | None:
    """The latest run if it is of this recording and task, else a new calibration; None if it fails."""
    from numpy import array_equal

    from basecal.accuracy.calibrate import calibrate
    from basecal.accuracy.task.task import task_places
    from basecal.cell.files import input_hashes, latest_run, read_calibration
    from basecal.estimation.settings import Settings

    task = Settings(task_point=points[0] if points else None, task_box=box)
    run = latest_run(folder)
    if run is not None:
        stored = read_calibration(run)
        stored_task = task_places(stored.settings.get("task_point"), stored.settings.get("task_box"))
        is_same = array_equal(stored_task, task_places(task.task_point, task.task_box))
        if is_same and dict(stored.inputs) == input_hashes(folder, cell):
            return stored
    if not any(sample.observations for sample in recording.samples):
        return None
    try:
        return calibrate(cell, recording, task)
    except BasecalError:  # too little was recorded: the cell's own guesses are used
        return None
