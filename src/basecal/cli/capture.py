"""`basecal capture`."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import inf, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, validators

from basecal.cli.capture_plan import (
    capture_plan,
    check_whole_plan,
    known_sketch,
    refuse_plan,
    say_plan,
    say_ways,
)
from basecal.cli.capture_touch import capture_touches
from basecal.cli.capture_view import CaptureView, capture_view
from basecal.cli.connecting import ASK_FIRST, ConnectionOptions, allowed_rig
from basecal.cli.option_types import Port, given_options, refuse_options
from basecal.cli.plan_options import DEFAULT_SAMPLES, PlanOptions, store_plan_options
from basecal.cli.replanning import Replanner, Task, requested_task
from basecal.cli.terminal import print_json, quote_path, say, say_next
from basecal.errors import UsageError
from basecal.fields.typed_length import length_m
from basecal.planning.patterns import PATTERNS

_MOST_PLANS = 20  # largest number of plans that are tried for a task until one is accepted
_SHIFTS = "shifts"
_TOUCH_OPTIONS = ("--touch", "--json", "--yes", "--allow-plaintext")
_GUIDED_OPTIONS = (*_TOUCH_OPTIONS, "--freedrive", "--samples", "--more", "--stop-on-disagreement", "--web", "--port")
_MOST_SPEED_M_S = 2.0  # largest speed limit of any point of an arm

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from basecal.acquisition.capture import Step
    from basecal.acquisition.rig import Rig
    from basecal.acquisition.taking import Taker
    from basecal.acquisition.watching import End
    from basecal.cell import Sample
    from basecal.planning.plan_check import SpeedLimits
    from basecal.planning.sketch import Sketch


@Parameter(name="*")
@dataclass(frozen=True)
class MotionOptions:
    """Limits of the motion of arms.

    Attributes:
        speed_limit_deg_s: Largest speed of any joint.
        tool_speed_limit: Largest speed of any point of an arm or of its load.
        accept_no_watchdog: Also move arms that do not stop if this program or the network fails.
        touch: Move no arm: a person guides tips to marks, and each typed line is a touch; no camera is needed.
    """

    speed_limit_deg_s: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=180))] = 30.0
    tool_speed_limit: str = "250mm/s"
    accept_no_watchdog: bool = False
    touch: bool = False

    @property
    def limits(self) -> SpeedLimits:
        """The speed limits for the check of a plan.

        Raises:
            UsageError: if a speed has no unit, or is above 2 m/s.
        """
        from basecal.planning.plan_check import SpeedLimits

        tool_m_s = length_m(self.tool_speed_limit, "--tool-speed-limit", "250mm/s", suffix="/s")
        if tool_m_s > _MOST_SPEED_M_S:
            raise UsageError(f"--tool-speed-limit {self.tool_speed_limit}: expected at most {_MOST_SPEED_M_S:g} m/s")
        return SpeedLimits(radians(self.speed_limit_deg_s), tool_m_s)


_DEFAULT_PLAN = PlanOptions()
_DEFAULT_MOTION = MotionOptions()


def capture(
    cell: Path,
    /,
    *,
    planning: PlanOptions = _DEFAULT_PLAN,
    go: bool = False,
    freedrive: bool = False,
    dry_run: bool = False,
    more: bool = False,
    moving: MotionOptions = _DEFAULT_MOTION,
    connecting: ConnectionOptions = ASK_FIRST,
    stop_on_disagreement: bool = False,
    web: bool = False,
    port: Port = 0,
    json: bool = False,
) -> int:
    """Record samples: move the arms, wait until they are at rest, and take images.

    The drivers of robots and cameras are stated in cell.yaml
    (docs/data_format.md); their connections are confirmed once. Begin with the
    target in the image. Without --go nothing moves: the plan is printed. Ctrl-C
    stops the arms. The same command continues an interrupted capture; options
    of another plan are refused. It does not repeat a finished capture; --more
    records additional samples.

    With --tolerance and --task-point the plan is updated after each sample, until
    95 % of errors at the task are expected below the tolerance. Samples that
    failed are not tried again. With --pattern shifts and a task, the stations are
    those that reduce the error there the most. They are planned once: as many as
    the tolerance needs, or --samples.

    With --freedrive a person guides the arms by hand. A sample is taken when they
    are at rest at a new pose for 0.8 s, or at the space bar; q ends the capture.
    Use it for a cell with `target: scene`; images that show too little of the
    scene are refused at once.
    With --touch a person guides tips to marks and types the name of each mark.

    From the fourth sample on, each sample is compared with the previous ones. If
    it disagrees, this is reported and the sample is repeated. With a lasting
    disagreement, such as after a base moved, the exit code is 1.

    Exit code: 0 if every sample was taken or the tolerance is reached, 5 if the
    tolerance is missed, else 1.

    For example:

        basecal capture mycell
        basecal capture mycell --pattern poses --samples 25 --go
        basecal capture mycell --pattern shifts --go --speed-limit-deg-s 10
        basecal capture mycell --pattern shifts --task-point 0.8 0.1 0.3 --go
        basecal capture mycell --plan plan.jsonl --go
        basecal capture mycell --tolerance 0.3mm --task-point 0.8 0.1 0.3 --go
        basecal capture mycell --freedrive --web
        basecal capture mycell --touch

    Args:
        cell: Folder of the cell.
        planning: Where samples are taken, and how many.
        go: Move the arms.
        freedrive: Take samples while a person guides the arms by hand.
        dry_run: Check the whole plan as --go does, ask the controllers, and print each motion; nothing moves.
        more: Record additional samples after a finished plan.
        moving: Limits of the motion of arms.
        connecting: Connections that the cell may make.
        stop_on_disagreement: Wait for the check of each sample, and end the capture at a lasting disagreement.
        web: Also show the capture as a page, on this machine only, with a button that stops all arms.
        port: Port of the page; 0 selects a free one.
        json: Print the captured samples as JSON.
    """
    task = _check_options(planning, given_options(capture, locals()))
    if moving.touch:
        return capture_touches(cell, connecting, json)
    sketch, limits = known_sketch(cell, freedrive), moving.limits
    guided_count = (planning.samples or DEFAULT_SAMPLES) if freedrive else None
    with ExitStack() as contexts, allowed_rig(sketch.cell, cell, connecting) as rig:  # an error stops the arms first
        chosen: Sequence[Sample] = ()
        replanner = Replanner(rig, sketch, cell, task, planning) if task and planning.pattern != _SHIFTS else None
        if not freedrive:
            chosen, is_new = capture_plan(rig, sketch, cell, planning, replanner, task, more)
            chosen = _check_capture(rig, sketch, chosen, is_new, moving, replanner, go=go, dry_run=dry_run, quiet=json)
            if not go:
                return _report_plan(cell, chosen, json)
            chosen = _store_plan(cell, sketch, chosen, is_new, planning)
        view = contexts.enter_context(capture_view(rig, sketch.cell, cell, web, port, quiet=json))
        taker = _taker(rig, sketch, cell, limits, view, stop_on_disagreement)
        steps = _take_samples(taker, chosen, guided_count, replanner, view, stop_on_disagreement)
        view.watch.end(_outcome(steps, replanner, f"basecal calibrate {quote_path(cell)}"))
    return _summarise(cell, steps, replanner, json)


def _check_capture(
    rig: Rig,
    sketch: Sketch,
    plan: Sequence[Sample],
    is_new: bool,
    moving: MotionOptions,
    replanner: Replanner | None,
    *,
    go: bool,
    dry_run: bool,
    quiet: bool,
) -> Sequence[Sample]:
    """Check and print the whole plan before anything moves; a plan for a task is repeated without refused samples.

    Raises:
        UsageError: if arms without a watchdog are to move, and the user does not accept that.
        InputError: if a sample or a motion is refused, or no camera can be read.
    """
    from basecal.acquisition.rig import check_cameras, check_guarantees

    if go:
        check_cameras(rig)
        check_guarantees(rig, moving.accept_no_watchdog)
    plan_check = check_whole_plan(rig, sketch, plan, moving.limits, asks_controllers=go or dry_run)
    for _ in range(_MOST_PLANS):
        if replanner is None or not plan_check.refusals:
            break
        refused = {refusal.sample for refusal in plan_check.refusals}
        plan = replanner.exclude([sample for sample in plan if sample.sample in refused])
        plan_check = check_whole_plan(rig, sketch, plan, moving.limits, asks_controllers=go or dry_run)
    if not quiet:
        if dry_run:
            say_ways(plan_check)
        if not plan_check.refusals:
            say_plan(rig, sketch, plan, is_new, plan_check, go, replanner)
    refuse_plan(plan_check, len(plan))
    return plan


def _check_options(planning: PlanOptions, options: Sequence[str]) -> Task | None:
    """Check the combination of options and return the task; None if there is none.

    Raises:
        UsageError: if options exclude each other, or have no effect.
    """
    if "--touch" in options:
        refuse_options(options, _TOUCH_OPTIONS, "--touch only records touches, as many as are typed")
    if "--freedrive" in options:
        refuse_options(options, _GUIDED_OPTIONS, "--freedrive moves no arm, a person does")
    task = requested_task(
        planning.task_point, planning.task_box, planning.tolerance, may_be_open=planning.pattern == _SHIFTS
    )
    if task is not None and planning.pattern not in (None, *PATTERNS):
        raise UsageError("--pattern FILE cannot be combined with a task: give the file by --plan, as candidates")
    if "--plan" in options and "--pattern" in options:
        raise UsageError("--plan and --pattern both determine the samples: give only one of them")
    if "--dry-run" in options and "--go" in options:
        raise UsageError("--dry-run moves nothing: leave --go out")
    if "--port" in options and "--web" not in options:
        raise UsageError("--port is the port of the page of --web: give --web, or leave --port out")
    return task


def captured_steps(folder: Path, pattern: str, samples: int, speed_deg_s: float) -> Iterator[Step]:
    """Capture a pattern in a cell and yield the result of each sample."""
    from basecal.acquisition.capture import capture as captured
    from basecal.acquisition.rig import open_rig
    from basecal.cell.files import read_cell
    from basecal.planning.plan_check import SpeedLimits
    from basecal.planning.sketch import sketch_cell

    sketch = sketch_cell(read_cell(folder))  # not of an earlier run, so that samples are the same each time
    with open_rig(sketch.cell, folder) as rig:
        planning = PlanOptions(pattern, samples=samples)
        plan = _store_plan(folder, sketch, *capture_plan(rig, sketch, folder, planning), planning)
        limits = SpeedLimits(radians(speed_deg_s), inf)  # simulated arms need no limit of the tool's speed
        yield from captured(_taker(rig, sketch, folder, limits, None), plan)


def _take_samples(
    taker: Taker,
    plan: Sequence[Sample],
    guided_count: int | None,
    replanner: Replanner | None,
    view: CaptureView,
    stops_on_disagreement: bool,
) -> list[Step]:
    """Take the samples of a plan, or at poses to which a person guides the arms, and return their results."""
    from basecal.acquisition.capture import capture as captured
    from basecal.acquisition.capture import capture_by_hand

    steps: list[Step] = []
    taking = (
        captured(taker, plan, replanner) if guided_count is None else capture_by_hand(taker, guided_count, view.key)
    )
    for step in taking:
        steps.append(step)
        view.note(step)
        if replanner is not None:
            view.watch.note_error(replanner.tolerance_m, replanner.error_m)
        if stops_on_disagreement and any(doubt.is_lasting for doubt in step.doubts):
            break
    return steps


def _store_plan(
    folder: Path, sketch: Sketch, plan: Sequence[Sample], is_new: bool, planning: PlanOptions
) -> Sequence[Sample]:
    """Store a new plan after the options that it was made with."""
    from basecal.acquisition.capture import store_plan

    if not is_new:
        return plan
    store_plan_options(folder, planning)
    return store_plan(folder, sketch.cell, plan)


def _taker(
    rig: Rig, sketch: Sketch, folder: Path, limits: SpeedLimits, view: CaptureView | None, waits_for_check: bool = False
) -> Taker:
    """A taker of samples; nothing is reported if `view` is None."""
    from basecal.acquisition.images.scene_images import SceneImages
    from basecal.acquisition.taking import CaptureSettings, Taker
    from basecal.planning.sketch import SceneSketch

    settings = CaptureSettings(limits.joint_rad_s, limits.tool_m_s, waits_for_check=waits_for_check)
    scene = SceneImages(sketch.cell, folder) if isinstance(sketch, SceneSketch) else None
    taker = Taker(rig, sketch, folder, settings, scene=scene)
    if view is None:
        return taker
    watch = view.watch
    return replace(
        taker, notify=watch.notify, report=view.report, show_image=watch.note_image, show_goal=watch.note_goal
    )


def _report_plan(cell: Path, samples: Sequence[Sample], json: bool) -> int:
    if json:
        print_json({"cell": str(cell), "planned": len(samples), "captured": [], "given_up": []})
    return 0


def _abandoned_steps(steps: Sequence[Step]) -> list[Step]:
    """Steps of samples that were not taken at any attempt."""
    taken = {step.sample for step in steps if not step.why_not}
    return [step for step in steps if step.sample not in taken]


def _lasting_doubts(steps: Sequence[Step]) -> list[str]:
    return [doubt.message for step in steps for doubt in step.doubts if doubt.is_lasting]


def _outcome(steps: Sequence[Step], replanner: Replanner | None, command: str) -> End:
    """The verdict of a capture, its reason, and the next command."""
    from basecal.acquisition.watching import End

    doubts, missing = _lasting_doubts(steps), _abandoned_steps(steps)
    if replanner is not None and not replanner.is_reached:
        return End("FAIL", replanner.words(), command)
    if doubts:
        return End("DOUBTFUL", doubts[0], command)
    if replanner is not None:
        return End("PASS", replanner.words(), command)
    count_text = f"{len(steps) - len(missing)} of {len(steps)} samples taken"
    first_reason = f"; the first missing one: {missing[0].why_not}" if missing else ""
    return End("DOUBTFUL" if missing else "GOOD", f"{count_text}{first_reason}", command)


def _summarise(cell: Path, steps: Sequence[Step], replanner: Replanner | None, json: bool) -> int:
    missing, doubts = _abandoned_steps(steps), _lasting_doubts(steps)
    taken = {step.sample for step in steps if not step.why_not}
    if json:
        last = steps[-1] if steps else None
        sigma = None
        if last is not None and last.sigma is not None:
            sigma = {"t_m": last.sigma[0], "r_rad": last.sigma[1], "samples": last.taken - last.unchecked}
        print_json(
            {
                "cell": str(cell),
                "planned": len(taken) + len(missing),
                "captured": sorted(taken),
                "given_up": [{"sample": step.sample, "why": step.why_not} for step in missing],
                "covered": None if last is None else last.coverage.share,
                "sigma": sigma,
                "doubts": [vars(doubt) for step in steps for doubt in step.doubts],
                **({} if replanner is None else replanner.as_dict()),
            }
        )
    else:
        if replanner is not None:
            say(replanner.words())
        for doubt in doubts:
            say(f"WARNING: {doubt}")
        say(f"{len(taken)} of {len(taken) + len(missing)} samples taken")
        say_next(f"basecal calibrate {quote_path(cell)}")
    if replanner is not None and not replanner.is_reached:
        return 5
    return 1 if doubts or (missing and replanner is None) else 0
