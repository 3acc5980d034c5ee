"""`basecal capture`."""

from __future__ import annotations

import sys
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, validators

from basecal.cli.terminal import pasted, print_json, say
from basecal.errors import InputError, UsageError
from basecal.registry import PATTERNS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from basecal.acquisition.capture import Step
    from basecal.acquisition.rig import Rig
    from basecal.cell import Sample
    from basecal.planning.sketch import Sketch


def capture(
    cell: Path,
    /,
    *,
    pattern: str = "poses",
    plan: Path | None = None,
    samples: Annotated[int, Parameter(validator=validators.Number(gte=1, lte=10_000))] = 25,
    go: bool = False,
    speed_limit_deg_s: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=360))] = 30.0,
    seed: Annotated[int, Parameter(validator=validators.Number(gte=0, lt=2**31))] = 0,
    json: bool = False,
) -> int:
    """Make a recording: send the arms, wait until all is still, look, and note.

    The drivers of robots and cameras stand in cell.yaml (docs/data_format.md).
    Begin with the target in the picture. Without --go nothing moves: it says
    what it would do. Ctrl-C stops the arms. A capture that was cut off goes on
    where it was when it is started again.

    Ends with 0 where every sample of the plan was taken, else with 1.

    For example:

        basecal capture mycell
        basecal capture mycell --pattern poses --samples 25 --go
        basecal capture mycell --pattern shifts --go --speed-limit-deg-s 10
        basecal capture mycell --plan plan.jsonl --go

    Args:
        cell: Folder of the cell.
        pattern: poses (all around), shifts (the paper's), or a file with lines of samples whose robots are gone to.
        plan: File of samples to go to, as `basecal plan -o` writes it; the same as --pattern FILE.
        samples: How many; shifts are rounded up to whole stations of seven.
        go: Move the arms.
        speed_limit_deg_s: The fastest that any joint may turn.
        seed: Another number makes another plan.
        json: Print what was captured as JSON.
    """
    from basecal.acquisition.capture import CaptureSettings, store_plan
    from basecal.acquisition.capture import capture as captured
    from basecal.acquisition.rig import open_rig
    from basecal.cell.files import read_cell
    from basecal.planning.sketch import sketch_of

    if plan is not None and pattern != "poses":
        raise UsageError("--plan and --pattern both say where to go: give one of them")
    sketch = sketch_of(read_cell(cell))
    with open_rig(sketch.cell, cell) as rig:
        wanted, is_new = _plan(rig, sketch, cell, pattern if plan is None else str(plan), samples, seed)
        if not json:
            _say_plan(rig, sketch, wanted, is_new, speed_limit_deg_s, go)
        if not go:
            if json:
                print_json({"cell": str(cell), "planned": len(wanted), "captured": [], "given_up": []})
            return 0
        wanted = store_plan(cell, sketch.cell, wanted) if is_new else wanted
        steps: list[Step] = []
        for step in captured(rig, sketch, cell, wanted, CaptureSettings(radians(speed_limit_deg_s))):
            steps.append(step)
            if not json:
                say_step(step, len(steps))
    return _summed_up(cell, steps, json)


def captured_steps(folder: Path, pattern: str, samples: int, speed_deg_s: float) -> Iterator[Step]:
    """What becomes of each sample of a pattern, while a cell is captured."""
    from basecal.acquisition.capture import CaptureSettings, store_plan
    from basecal.acquisition.capture import capture as captured
    from basecal.acquisition.rig import open_rig
    from basecal.cell.files import read_cell
    from basecal.planning.sketch import sketch_of

    sketch = sketch_of(read_cell(folder))
    with open_rig(sketch.cell, folder) as rig:
        plan, is_new = _plan(rig, sketch, folder, pattern, samples, seed=0)
        plan = store_plan(folder, sketch.cell, plan) if is_new else plan
        yield from captured(rig, sketch, folder, plan, CaptureSettings(radians(speed_deg_s)))


def _plan(
    rig: Rig, sketch: Sketch, folder: Path, pattern: str, samples: int, seed: int
) -> tuple[Sequence[Sample], bool]:
    """What is still to be taken of a plan that was cut off, or a new plan, and whether it is new."""
    from basecal.acquisition.capture import unfinished
    from basecal.cell.files import read_plan
    from basecal.errors import nearest
    from basecal.planning.feasible import feasible_in
    from basecal.planning.patterns import pattern as named

    left = unfinished(folder, sketch.cell)
    if left:
        return left, False
    if pattern not in PATTERNS:
        if not Path(pattern).is_file():
            names = ", ".join(PATTERNS)
            raise InputError(f"no pattern {pattern!r}{nearest(pattern, PATTERNS)}; it is one of {names}, or a file")
        return read_plan(pattern, folder, sketch.cell), True
    missing = [name for name in sketch.movers if name not in rig.robots]
    if missing:
        raise InputError(f"robot {missing[0]!r} has no `driver` in cell.yaml: nothing can be planned for it")
    home = {name: robot.state().state for name, robot in rig.robots.items()}
    return named(pattern)(sketch, home, feasible_in(sketch), samples, seed), True


def _say_plan(rig: Rig, sketch: Sketch, plan: Sequence[Sample], is_new: bool, speed: float, go: bool) -> None:
    from basecal.acquisition.driver import Moves

    moving = [name for name, robot in rig.robots.items() if isinstance(robot, Moves)]
    led = [name for name, robot in rig.robots.items() if robot.is_live and name not in moving]
    camera, target = sketch.view
    begun = "" if is_new else "goes on with what was begun: "
    say(
        f"{begun}{len(plan)} samples; {' and '.join(moving) or 'no robot'} will move, no joint faster than "
        f"{speed:g} deg/s, with {target} in view of {camera} at every stop; the way between stops is not checked"
    )
    if led:
        say(f"{' and '.join(led)} will be led by hand: wherever all stand still anew, a sample is taken")
    if not go:
        say("nothing has moved: add --go, with a hand on the emergency stop")
    if sys.stdout is not None:
        sys.stdout.flush()


def say_step(step: Step, place: int) -> None:
    """Print what has become of a sample."""
    sigma = "" if step.sigma is None else f"; base +-{1e3 * step.sigma[0]:.2f} mm {57.2958 * step.sigma[1]:.3f} deg"
    said = f"not taken: {step.why_not}" if step.why_not else f"taken, {100 * step.coverage.share:.0f} % of the picture"
    advice = step.coverage.advice(step.taken)
    say(f"{place:4d}/{step.planned} sample {step.sample}: {said}{sigma}{'; ' + advice if advice else ''}")
    if sys.stdout is not None:
        sys.stdout.flush()


def _summed_up(cell: Path, steps: Sequence[Step], json: bool) -> int:
    given_up = [{"sample": step.sample, "why": step.why_not} for step in steps if step.why_not]
    if json:
        last = steps[-1] if steps else None
        sigma = None if last is None or last.sigma is None else {"t_m": last.sigma[0], "r_rad": last.sigma[1]}
        print_json(
            {
                "cell": str(cell),
                "planned": len(steps),
                "captured": [step.sample for step in steps if not step.why_not],
                "given_up": given_up,
                "covered": None if last is None else last.coverage.share,
                "sigma": sigma,
            }
        )
    else:
        say(f"{len(steps) - len(given_up)} of {len(steps)} samples taken; next: basecal calibrate {pasted(cell)}")
    return 1 if given_up else 0
