"""Going through a plan: send the arms, wait until all is still, take states and picture, detect, append to the journal.

Every sample that is told of is on the disk. Cut off at any instant, a capture goes on with the samples of its plan that
are neither in the journal nor given up.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from basecal.acquisition.coverage import Coverage, alike, coverage_of
from basecal.acquisition.driver import Freedrives, Grey, Moves, Reading, Switches
from basecal.acquisition.rig import Rig
from basecal.acquisition.running_estimate import RunningEstimate, running_estimate
from basecal.acquisition.stillness import Moving, Unfit, wait_for_arms, wait_for_picture, wait_until_led
from basecal.cell import CandidateObservation, Cell, PixelObservation, Recording, RobotState, Sample, Target
from basecal.cell.files import append_sample, read_plan, read_recording, write_plan
from basecal.cell.format.writing import append_durably, write_whole
from basecal.errors import InputError
from basecal.planning.sketch import Sketch
from basecal.vision.detect import detect
from basecal.vision.detectors import LIGHT
from basecal.vision.edge_width import edge_width
from basecal.vision.image_file import png_bytes

PLAN = Path("recording", "plan.jsonl")
"""What is to be captured, with the numbers that samples then have."""

GIVEN_UP = Path("recording", "given_up.jsonl")
"""Samples of the plan that could not be taken, and why."""

_WIDEST_EDGE_PX = 5.0  # of an edge about the target's points: four pixels of motion, or a point spread of 1.4
_ALIKE_M, _ALIKE_RAD = 2e-3, 2e-3  # between samples that say nearly the same
_ATTEMPTS = 2  # at a sample whose arms or picture do not come to rest


@dataclass(frozen=True)
class CaptureSettings:
    """How arms are moved and waited for.

    Attributes:
        speed_rad_s: The fastest that any joint may turn.
        patience_s: How long an arm or a picture may take to come to rest after it was sent.
        lead_patience_s: How long a person may take to lead an arm to another place.
    """

    speed_rad_s: float
    patience_s: float = 20.0
    lead_patience_s: float = 600.0


@dataclass(frozen=True, eq=False)
class Step:
    """What has become of one sample of the plan.

    Attributes:
        sample: Its number.
        why_not: Why it was given up, in words; empty where it was taken.
        taken: How many samples there are now.
        planned: How many the plan has.
        coverage: Of all of them.
        sigma: Of the transform asked for, along [m] and about [rad] its axes; None while a direction is open.
    """

    sample: int
    why_not: str
    taken: int
    planned: int
    coverage: Coverage
    sigma: tuple[float, float] | None


def unfinished(folder: Path, cell: Cell) -> tuple[Sample, ...]:
    """Samples of a plan in a cell's folder that are still to be taken; none where there is no plan."""
    if not (folder / PLAN).exists():
        return ()
    done = {sample.sample for sample in _taken(folder, cell)} | _given_up(folder)
    return tuple(sample for sample in read_plan(folder / PLAN, folder, cell) if sample.sample not in done)


def store_plan(folder: Path, cell: Cell, samples: Sequence[Sample]) -> tuple[Sample, ...]:
    """Samples as they are to be taken, numbered beyond what the recording has, stored in the cell's folder."""
    numbers = [sample.sample for sample in _taken(folder, cell)]
    first = max([*numbers, *_given_up(folder)], default=-1) + 1
    plan = tuple(Sample(first + k, robots=sample.robots) for k, sample in enumerate(samples))
    write_plan(plan, folder / PLAN, folder)
    return plan


def capture(
    rig: Rig, sketch: Sketch, folder: Path, plan: Sequence[Sample], settings: CaptureSettings
) -> Iterator[Step]:
    """Take the samples of a plan, one after another; each has become what is told when it is told.

    Args:
        rig: The robots and cameras.
        sketch: The cell.
        folder: The cell's folder.
        plan: What is to be taken.
        settings: How.

    Raises:
        InputError: if a file cannot be written, or no camera has a driver.
        DriverError: if a robot or camera does not answer.
    """
    cell = sketch.cell
    if not rig.cameras:
        raise InputError("no camera of the cell has a `driver`: say in cell.yaml what gives its pictures")
    taken = list(detect(cell, Recording(_taken(folder, cell), folder=str(folder))).samples)
    estimate: RunningEstimate = running_estimate(sketch)
    for sample in taken:
        estimate = estimate.added(sample)
    led_from: dict[str, RobotState] = {}
    for wanted in plan:
        try:
            led_from = _led(rig, led_from, settings.lead_patience_s)
            found = _with_attempts(rig, sketch, folder, wanted, settings, taken)
        except Unfit as why:
            _give_up(folder, wanted.sample, str(why))
            yield Step(wanted.sample, str(why), len(taken), len(plan), coverage_of(sketch, taken), estimate.sigma())
            continue
        append_sample(folder, replace(found, observations=()))
        taken.append(found)
        estimate = estimate.added(found)
        yield Step(wanted.sample, "", len(taken), len(plan), coverage_of(sketch, taken), estimate.sigma())


def _led(rig: Rig, before: Mapping[str, RobotState], patience_s: float) -> dict[str, RobotState]:
    """Where arms that a person leads have come to: of those that are live, but are not sent.

    Raises:
        Unfit: if they were not led to another place in time.
    """
    led = {name: robot for name, robot in rig.robots.items() if robot.is_live and not isinstance(robot, Moves)}
    if not led:
        return {}
    with ExitStack() as held:
        for robot in led.values():
            if isinstance(robot, Freedrives):
                robot.freedrive(True)
                held.callback(robot.freedrive, False)
        wait_until_led(led, before, patience_s)
    return {name: robot.state().state for name, robot in led.items()}


def _with_attempts(
    rig: Rig, sketch: Sketch, folder: Path, wanted: Sample, settings: CaptureSettings, taken: Sequence[Sample]
) -> Sample:
    for _ in range(_ATTEMPTS - 1):
        try:
            return _take(rig, sketch, folder, wanted, settings, taken)
        except Moving:
            continue
    return _take(rig, sketch, folder, wanted, settings, taken)


def _take(
    rig: Rig, sketch: Sketch, folder: Path, wanted: Sample, settings: CaptureSettings, taken: Sequence[Sample]
) -> Sample:
    """A sample with its pictures on the disk, and what is seen in them.

    Raises:
        Unfit: if it cannot be used.
    """
    for name, state in wanted.robots.items():
        robot = rig.robots.get(name)
        if isinstance(robot, Moves):
            robot.move(state, settings.speed_rad_s)
    goals = {name: state for name, state in wanted.robots.items() if isinstance(rig.robots.get(name), Moves)}
    before = wait_for_arms(rig.robots, goals, settings.patience_s)
    shots = {name: _shot(rig, sketch.cell, name, settings.patience_s) for name in rig.cameras}
    after = _states_after(rig, before, settings.patience_s)
    states = {name: reading.state for name, reading in after.items()}
    stamp_s = next(iter(shots.values())).stamp_s
    sample = Sample(wanted.sample, stamp_s, states, (), *_written(folder, wanted.sample, shots))
    like = alike(sketch, sample, taken, _ALIKE_M, _ALIKE_RAD)
    if like is not None:
        raise Unfit(f"too like sample {like}")
    seen = detect(sketch.cell, Recording((sample,), folder=str(folder))).samples[0]
    _check_seen(sketch.cell, seen, shots)
    return seen


@dataclass(frozen=True, eq=False)
class _Shot:
    """What one camera gave: the picture, and the one without the light where that can be switched."""

    stamp_s: float
    grey: Grey
    background: Grey | None


def _shot(rig: Rig, cell: Cell, name: str, patience_s: float) -> _Shot:
    camera, targets = rig.cameras[name], _targets(cell, name)
    picture = wait_for_picture(camera, targets, patience_s)
    if not (isinstance(camera, Switches) and any(target.found_by == LIGHT for target in targets)):
        return _Shot(picture.stamp_s, picture.grey, None)
    camera.light(False)
    try:
        background = camera.picture().grey
    finally:
        camera.light(True)
    return _Shot(picture.stamp_s, picture.grey, background)


def _targets(cell: Cell, camera: str) -> list[Target]:
    on = cell.cameras[camera].on
    return [each.target for each in cell.targets.values() if each.on != on and each.target is not None]


def _states_after(rig: Rig, before: Mapping[str, Reading], patience_s: float) -> dict[str, Reading]:
    """Where arms are after the picture: nearer to where they were in it, since the last of a way is slow.

    Raises:
        Moving: if one has moved away.
    """
    live = {name: robot for name, robot in rig.robots.items() if robot.is_live}
    after = wait_for_arms(live, {name: before[name].state for name in live}, patience_s) if live else {}
    return {**before, **after}


def _written(folder: Path, number: int, shots: Mapping[str, _Shot]) -> tuple[dict[str, str], dict[str, str]]:
    """Paths of the pictures and of those without the light, by camera; all of them are on the disk."""
    images, background = {}, {}
    for camera, shot in shots.items():
        stem = f"recording/images/{camera}/{number:06d}"
        images[camera] = f"{stem}.png"
        write_whole(folder / images[camera], png_bytes(shot.grey), within=folder)
        if shot.background is not None:
            background[camera] = f"{stem}_off.png"
            write_whole(folder / background[camera], png_bytes(shot.background), within=folder)
    return images, background


def _check_seen(cell: Cell, sample: Sample, shots: Mapping[str, _Shot]) -> None:
    """Whether each camera sees a target, sharply.

    Raises:
        Unfit: if not.
    """
    for camera, shot in shots.items():
        seen = [each for each in sample.observations if each.camera == camera]
        if not seen:
            raise Unfit(f"target not seen by {camera}")
        for each in seen:
            shape = cell.targets[each.target].target
            if isinstance(each, CandidateObservation | PixelObservation) and shape is not None and shape.sheets:
                width = edge_width(shot.grey, each.pixels)
                if width is not None and width > _WIDEST_EDGE_PX:
                    raise Unfit(f"too blurred: edges of {each.target} are {width:.1f} px wide")


def _taken(folder: Path, cell: Cell) -> tuple[Sample, ...]:
    has_journal = (folder / "recording" / "samples.jsonl").exists()
    return read_recording(folder, cell).samples if has_journal else ()


def _given_up(folder: Path) -> set[int]:
    path = folder / GIVEN_UP
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    numbers = set()
    for line in lines:
        try:
            numbers.add(int(json.loads(line)["sample"]))
        except (ValueError, KeyError, TypeError):  # cut off: the sample is tried again
            continue
    return numbers


def _give_up(folder: Path, number: int, why: str) -> None:
    append_durably(folder / GIVEN_UP, json.dumps({"sample": number, "why": why}) + "\n", within=folder)
