"""`basecal capture`."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import inf, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, validators

from basecal.cli.capture_plan import SAMPLES, capture_plan, checked_plan, known_sketch, refuse, say_plan, say_ways
from basecal.cli.capture_touch import capture_touches
from basecal.cli.capture_view import CaptureView, capture_view
from basecal.cli.connecting import ASKING, Connecting, allowed_rig
from basecal.cli.option_types import Box, Point, Port, Seed, number_range
from basecal.cli.replanning import Replanner, Task, requested_task
from basecal.cli.terminal import print_json, quote_path, say, say_next
from basecal.errors import UsageError
from basecal.fields.typed_length import length_m
from basecal.planning.patterns import PATTERNS

_PLANS = 20  # that are tried for a task until one is not refused
_SHIFTS = "shifts"
_FASTEST_M_S = 2.0  # of any point of an arm

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
class Moving:
    """How arms may move.

    Attributes:
        speed_limit_deg_s: The fastest that any joint may turn.
        tool_speed_limit: The fastest that any point of an arm, or of what it carries, may move.
        accept_no_watchdog: Move also arms that finish their move if this program or the network fails.
        touch: Move none: a person leads tips, and each line that is typed is a touch; no camera is needed.
    """

    speed_limit_deg_s: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=180))] = 30.0
    tool_speed_limit: str = "250mm/s"
    accept_no_watchdog: bool = False
    touch: bool = False

    @property
    def limits(self) -> SpeedLimits:
        """The limits, as a plan is checked with them.

        Raises:
            UsageError: if a speed has no unit, or is above 2 m/s.
        """
        from basecal.planning.plan_check import SpeedLimits

        tool_m_s = length_m(self.tool_speed_limit, "--tool-speed-limit", "250mm/s", suffix="/s")
        if tool_m_s > _FASTEST_M_S:
            raise UsageError(f"--tool-speed-limit {self.tool_speed_limit}: expected at most {_FASTEST_M_S:g} m/s")
        return SpeedLimits(radians(self.speed_limit_deg_s), tool_m_s)


_USUAL = Moving()


def capture(
    cell: Path,
    /,
    *,
    pattern: str = "poses",
    plan: Path | None = None,
    task_point: Point | None = None,
    task_box: Box | None = None,
    tolerance: str | None = None,
    samples: Annotated[int | None, number_range(1, 10_000)] = None,
    go: bool = False,
    freedrive: bool = False,
    dry_run: bool = False,
    more: bool = False,
    moving: Moving = _USUAL,
    connecting: Connecting = ASKING,
    seed: Seed = 0,
    stop_on_disagreement: bool = False,
    web: bool = False,
    port: Port = 0,
    json: bool = False,
) -> int:
    """Make a recording: send the arms, wait until all is still, look, and note.

    The drivers of robots and cameras are stated in cell.yaml
    (docs/data_format.md); what they connect to is asked once. Begin with the
    target in the image. Without --go nothing moves: it prints what it would do.
    Ctrl-C stops the arms. A capture that was cut off goes on where it was when it
    is started again. One that is finished records nothing again; --more records
    other samples beside those that are there.

    With --tolerance and --task-point it plans while it captures. The plan is made
    anew after each sample, from all that was taken, until 95 % of errors at the
    task are below the tolerance. What could not be taken is not tried again. With
    --pattern shifts and a task, the stations are those that lower the error there
    the most. They are planned once: as many as a tolerance needs, or --samples.

    With --freedrive no arm is sent anywhere: you lead them. Held still for
    0.8 s at a new place, or at the space bar, a sample is taken; q ends.
    A cell with `target: scene` is captured so; images that show too little
    of the scene are refused at once.
    With --touch you lead tips to marks, and type which mark it is.

    From the fourth sample on each is compared with those before it. One that
    disagrees is reported, and taken once more at the same place. A disagreement
    that lasts, such as a base that moved, ends the command with 1.

    Ends with 0 if every sample was taken, or the tolerance is reached; with 5 if
    the tolerance is missed, else with 1.

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
        pattern: poses (all around), shifts (the paper's), or a file with lines of samples whose robots are gone to.
        plan: File of samples to go to, as `basecal plan -o` writes it; the same as --pattern FILE. With --tolerance
            its samples are offered beside others.
        task_point: Where the work is done, x y z [m] in the reference robot's base.
        task_box: Two opposite corners of where it is done, instead of a point.
        tolerance: Length with its unit, such as 0.2mm, below which 95 % of position errors there shall be.
        samples: How many, 25 where it is left out; shifts are rounded up to whole stations of seven. With --tolerance
            the most that are taken, 60 where it is left out.
        go: Move the arms.
        freedrive: Take samples where a person leads the arms to.
        dry_run: Check the whole plan as --go does, ask the controllers, and print each way; nothing moves.
        more: Record other samples after a plan that is finished.
        moving: How arms may move.
        connecting: What the cell may reach.
        seed: Another number makes another plan.
        stop_on_disagreement: Wait for the check of each sample, and end the capture at a disagreement that lasts.
        web: Show the capture as a page as well, on this machine alone, with a button that stops all arms.
        port: Where the page is served; 0 takes a free one.
        json: Print what was captured as JSON.
    """
    if moving.touch:
        return capture_touches(cell, connecting, json, has_others=go or dry_run or freedrive or web)
    task = _checked_task(task_point, task_box, tolerance, pattern, plan, go, dry_run, freedrive, web, port)
    sketch, count, limits = known_sketch(cell, freedrive), samples or SAMPLES, moving.limits
    with ExitStack() as shown, allowed_rig(sketch.cell, cell, connecting) as rig:  # an error stops the arms first
        wanted: Sequence[Sample] = ()
        replanner = Replanner(rig, sketch, cell, task, plan, samples, seed) if task and pattern != _SHIFTS else None
        if not freedrive:
            wanted, is_new = capture_plan(rig, sketch, cell, str(plan or pattern), samples, seed, replanner, task, more)
            wanted = _check_capture(rig, sketch, wanted, is_new, moving, replanner, go=go, dry_run=dry_run, quiet=json)
            if not go:
                return _finish_plan(cell, wanted, json)
            wanted = _store_plan(cell, sketch, wanted, is_new)
        view = shown.enter_context(capture_view(rig, sketch.cell, cell, web, port, quiet=json))
        by = _taker(rig, sketch, cell, limits, view, stop_on_disagreement)
        steps = _take_samples(by, wanted, count if freedrive else None, replanner, view, stop_on_disagreement)
        view.watch.end(_outcome(steps, replanner, f"basecal calibrate {quote_path(cell)}"))
    return _summarise(cell, steps, replanner, json)


def _check_capture(
    rig: Rig,
    sketch: Sketch,
    plan: Sequence[Sample],
    is_new: bool,
    moving: Moving,
    replanner: Replanner | None,
    *,
    go: bool,
    dry_run: bool,
    quiet: bool,
) -> Sequence[Sample]:
    """The plan, checked as a whole before anything moves, and printed; one for a task without the samples refused.

    Raises:
        UsageError: if arms are to move that nothing stops, and the person does not accept that.
        InputError: if any sample or way of it is refused, or no camera can be read.
    """
    from basecal.acquisition.rig import check_cameras, check_guarantees

    if go:
        check_cameras(rig)
        check_guarantees(rig, moving.accept_no_watchdog)
    found = checked_plan(rig, sketch, plan, moving.limits, asks_controllers=go or dry_run)
    for _ in range(_PLANS):
        if replanner is None or not found.refusals:
            break
        refused = {refusal.sample for refusal in found.refusals}
        plan = replanner.exclude([sample for sample in plan if sample.sample in refused])
        found = checked_plan(rig, sketch, plan, moving.limits, asks_controllers=go or dry_run)
    if not quiet:
        if dry_run:
            say_ways(found)
        if not found.refusals:
            say_plan(rig, sketch, plan, is_new, found, go, replanner)
    refuse(found, len(plan))
    return plan


def _checked_task(
    task_point: Point | None,
    task_box: Box | None,
    tolerance: str | None,
    pattern: str,
    plan: Path | None,
    go: bool,
    dry_run: bool,
    freedrive: bool,
    web: bool,
    port: int,
) -> Task | None:
    """The task, if options go together.

    Raises:
        UsageError: if they do not.
    """
    task = requested_task(task_point, task_box, tolerance, may_be_open=pattern == _SHIFTS)
    if task is not None and (freedrive or pattern not in PATTERNS):
        raise UsageError("a task says where arms are sent: leave --freedrive out, and files of --pattern")
    if plan is not None and pattern != "poses":
        raise UsageError("--plan and --pattern both say where to go: give one of them")
    if dry_run and (go or freedrive):
        raise UsageError("--dry-run moves nothing: leave --go and --freedrive out")
    if freedrive and go:
        raise UsageError("--freedrive moves no arm: leave --go out")
    if port and not web:
        raise UsageError("--port says where the page of --web is served: give --web, or leave it out")
    return task


def captured_steps(folder: Path, pattern: str, samples: int, speed_deg_s: float) -> Iterator[Step]:
    """Results of each sample of a pattern, while a cell is captured."""
    from basecal.acquisition.capture import capture as captured
    from basecal.acquisition.rig import open_rig
    from basecal.cell.files import read_cell
    from basecal.planning.plan_check import SpeedLimits
    from basecal.planning.sketch import sketch_cell

    sketch = sketch_cell(read_cell(folder))  # not of an earlier run: the same places each time
    with open_rig(sketch.cell, folder) as rig:
        plan = _store_plan(folder, sketch, *capture_plan(rig, sketch, folder, pattern, samples, seed=0))
        limits = SpeedLimits(radians(speed_deg_s), inf)  # a simulated arm hurts nobody
        yield from captured(_taker(rig, sketch, folder, limits, None), plan)


def _take_samples(
    taker: Taker,
    plan: Sequence[Sample],
    led: int | None,
    replan: Replanner | None,
    view: CaptureView,
    stops: bool = False,
) -> list[Step]:
    """Results of each sample of a plan, or of those that a person leads the arms to; called when it is done."""
    from basecal.acquisition.capture import capture as captured
    from basecal.acquisition.capture import capture_led

    found: list[Step] = []
    for step in captured(taker, plan, replan) if led is None else capture_led(taker, led, view.key):
        found.append(step)
        view.note(step, len(found))
        if replan is not None:
            view.watch.note_error(replan.tolerance_m, replan.error_m)
        if stops and any(doubt.is_lasting for doubt in step.doubts):
            break
    return found


def _store_plan(folder: Path, sketch: Sketch, plan: Sequence[Sample], is_new: bool) -> Sequence[Sample]:
    from basecal.acquisition.capture import store_plan

    return store_plan(folder, sketch.cell, plan) if is_new else plan


def _taker(
    rig: Rig, sketch: Sketch, folder: Path, limits: SpeedLimits, view: CaptureView | None, waits_for_check: bool = False
) -> Taker:
    """A taker of samples; without a view nothing is reported."""
    from basecal.acquisition.images.scene_images import SceneImages
    from basecal.acquisition.taking import CaptureSettings, Taker
    from basecal.planning.sketch import SceneSketch

    settings = CaptureSettings(limits.joint_rad_s, limits.tool_m_s, waits_for_check=waits_for_check)
    scene = SceneImages(sketch.cell, folder) if isinstance(sketch, SceneSketch) else None
    taker = Taker(rig, sketch, folder, settings, scene=scene)
    if view is None:
        return taker
    watch = view.watch
    return replace(taker, notify=watch.notify, report=view.report, show=watch.note_image, send=watch.note_goal)


def _finish_plan(cell: Path, samples: Sequence[Sample], json: bool) -> int:
    if json:
        print_json({"cell": str(cell), "planned": len(samples), "captured": [], "given_up": []})
    return 0


def _abandoned_steps(steps: Sequence[Step]) -> list[Step]:
    """Steps of samples that were not taken, and not at a later attempt either."""
    taken = {step.sample for step in steps if not step.why_not}
    return [step for step in steps if step.sample not in taken]


def _lasting_doubts(steps: Sequence[Step]) -> list[str]:
    return [doubt.message for step in steps for doubt in step.doubts if doubt.is_lasting]


def _outcome(steps: Sequence[Step], replanner: Replanner | None, command: str) -> End:
    """The verdict of a capture, why, and what to type next."""
    from basecal.acquisition.watching import End

    doubts, missing = _lasting_doubts(steps), _abandoned_steps(steps)
    if replanner is not None:
        return End("PASS" if replanner.is_reached else "FAIL", replanner.words(), command)
    if doubts:
        return End("DOUBTFUL", doubts[0], command)
    counted = f"{len(steps) - len(missing)} of {len(steps)} samples taken"
    first = f"; the first missing one: {missing[0].why_not}" if missing else ""
    return End("DOUBTFUL" if missing else "GOOD", f"{counted}{first}", command)


def _summarise(cell: Path, steps: Sequence[Step], replanner: Replanner | None, json: bool) -> int:
    missing, doubts = _abandoned_steps(steps), _lasting_doubts(steps)
    taken = {step.sample for step in steps if not step.why_not}
    if json:
        last = steps[-1] if steps else None
        sigma = None if last is None or last.sigma is None else {"t_m": last.sigma[0], "r_rad": last.sigma[1]}
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
