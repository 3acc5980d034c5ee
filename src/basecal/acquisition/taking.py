"""Taking one sample: move the arms, wait until they are still, read states and images, and detect the targets."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path

import numpy as np

from basecal.acquisition.coverage import Coverage, find_equal_sample, is_same_place, measure_coverage, rotation_ranges
from basecal.acquisition.driver import CameraImage, Grey, Moves, Switches
from basecal.acquisition.images.scene_images import SceneImages
from basecal.acquisition.rig import Rig, goal_checks, movers
from basecal.acquisition.stillness import Moving, Unfit, wait_for_arms, wait_for_image, wait_for_image_after
from basecal.cell import CandidateObservation, Cell, PixelObservation, Recording, RobotState, Sample, Target
from basecal.cell.format.writing import write_atomically
from basecal.errors import DriverError
from basecal.geometry import Array
from basecal.planning.plan_check import SpeedLimits, check_plan
from basecal.planning.sketch import Sketch
from basecal.vision.detect import detect
from basecal.vision.detectors import LED
from basecal.vision.edge_width import EdgeWidth, edge_width
from basecal.vision.image_file import png_bytes, read_bytes, size_fault

_WIDTH_RATIO = 1.25  # of widest to narrowest edges, above which motion is likely: lens and print blur all directions
_MOTION_PX = 3.0  # motion blur that is accepted in addition to the width of edges in the sharpest view
_MERGE_PX = 16.0  # width of edges at which twice the width is accepted: neighbouring marks merge


class Sharpness:
    """Widths of the narrowest edges so far, by camera and target: in the image [px], and on the target [m]."""

    def __init__(self) -> None:
        self._narrowest: dict[tuple[str, str], Array] = {}

    def is_blurred(self, view: tuple[str, str], width: EdgeWidth, pixels: Array, points: Array) -> bool:
        """Whether the edges of a view are wider than lens and print explain; a sharp view updates the reference.

        The lens limits the width of edges in the image [px], and the print limits it on the target [m].

        Args:
            view: Names of the camera and the target.
            width: Width of the edges.
            pixels: (n, 2) image of the target's points [px].
            points: (n, 3) points on the target [m].
        """
        if len(points) < 2:  # one point has no size on either side
            return False
        scale = np.array([1.0, np.linalg.norm(pixels.std(0)) / np.linalg.norm(points.std(0))])
        narrowest = self._narrowest.get(view, np.full(2, np.inf))
        typical = (scale * narrowest).max()
        limit = max(np.hypot(typical, _MOTION_PX), typical * (1 + typical / _MERGE_PX))
        if width.wide_px > min(limit, _WIDTH_RATIO * width.narrow_px):
            return True
        self._narrowest[view] = np.minimum(narrowest, width.wide_px / scale)
        return False


Notify = Callable[[str], None]
"""Function that receives a description of the current step."""

TOOL_M_S = 0.25
"""Default speed of an arm's fastest point [m/s]: the limit of collaborative and of manual operation.

Source: ISO 10218-1, reduced speed control.
"""

_REST_ATTEMPTS = 2  # attempts at a sample if the arms or the image do not come to rest


@dataclass(frozen=True)
class CaptureSettings:
    """Speed limits and timeouts of a capture.

    Attributes:
        speed_rad_s: Speed limit of any joint [rad/s].
        tool_m_s: Speed limit of any point of an arm and its load [m/s].
        patience_s: Timeout for an image, and for an arm to come to rest in addition to the time of its path [s].
        lead_patience_s: Timeout for a person to lead an arm to another place [s].
        waits_for_check: Whether to wait for the running check of a sample before arms move on.
    """

    speed_rad_s: float
    tool_m_s: float = TOOL_M_S
    patience_s: float = 20.0
    lead_patience_s: float = 600.0
    waits_for_check: bool = False


@dataclass(frozen=True, eq=False)
class Taker:
    """Procedure that takes the samples of a cell.

    Attributes:
        rig: The robots and cameras.
        sketch: The cell.
        folder: The cell's folder.
        settings: Speed limits and timeouts.
        notify: Receives a description of the current step.
        report: Receives notes about images.
        show_image: Receives each image, with the camera's name.
        show_goal: Receives each goal, with the robot's name.
        sharpness: Sharpness of the views so far.
        scene: Images of the scene so far; None if the cell has targets.
        digests: Sample number of each image so far, by camera and digest of its file.
    """

    rig: Rig
    sketch: Sketch
    folder: Path
    settings: CaptureSettings
    notify: Notify = lambda words: None
    report: Notify = lambda words: None
    show_image: Callable[[str, Grey], None] = lambda camera, grey: None
    show_goal: Callable[[str, RobotState], None] = lambda robot, goal: None
    sharpness: Sharpness = field(default_factory=Sharpness)
    scene: SceneImages | None = None
    digests: dict[tuple[str, bytes], int] = field(default_factory=dict)

    def coverage(self, samples: Sequence[Sample]) -> Coverage:
        """Measure the coverage of samples."""
        if self.scene is None:
            return measure_coverage(self.sketch, samples)
        return Coverage(self.scene.cells.copy(), rotation_ranges(self.sketch, samples))

    def remember(self, samples: Sequence[Sample]) -> None:
        """Remember the images of earlier samples, none of which may be repeated."""
        for sample in samples:
            for camera, path in sample.images.items():
                content = read_bytes(self.folder / path)
                if isinstance(content, bytes):
                    self.digests.setdefault((camera, sha256(content).digest()), sample.sample)

    def take(self, goal: Sample, samples: Sequence[Sample]) -> Sample:
        """Take a sample, write its images to the disk, and detect the targets in them.

        Args:
            goal: Number of the sample, and goals of the robots; robots without a goal do not move.
            samples: The samples taken so far.

        Raises:
            Unfit: if the sample is not usable.
            DriverError: if a robot or camera does not answer, or an arm that was sent does not come to rest.
        """
        patience_s = self.settings.patience_s + _send_arms(self, goal)
        for _ in range(_REST_ATTEMPTS - 1):
            try:
                return _take_sample(self, goal, samples, patience_s)
            except Moving as why:
                self.notify(f"{why}; once more")
        try:
            return _take_sample(self, goal, samples, patience_s)
        except Moving:
            _wait_for_rest(self.rig, patience_s)
            raise


def _send_arms(taker: Taker, goal: Sample) -> float:
    """Send the arms to a sample after the sample, the path and the controllers' acceptance are checked.

    Returns:
        Duration of the longest path [s].

    Raises:
        Unfit: if a check fails; no arm is sent then.
        DriverError: if a robot does not answer.
    """
    taker.notify(f"sample {goal.sample}: arms move" if goal.robots else f"sample {goal.sample}")
    moving = {name: robot for name, robot in movers(taker.rig).items() if name in goal.robots}
    if not moving:
        return 0.0
    here = {name: robot.state().state for name, robot in taker.rig.robots.items() if robot.is_live or name in moving}
    limits = SpeedLimits(taker.settings.speed_rad_s, taker.settings.tool_m_s)
    plan_check = check_plan(taker.sketch, here, [goal], limits, goal_checks(moving))
    if plan_check.refusals:
        raise Unfit(f"{plan_check.refusals[0].what}; nothing was sent")
    for path in plan_check.paths:
        taker.show_goal(path.robot, goal.robots[path.robot])
        moving[path.robot].move(goal.robots[path.robot], path.joint_rad_s)
    return max(
        _joint_travel_rad(here[path.robot], goal.robots[path.robot]) / path.joint_rad_s for path in plan_check.paths
    )


def _wait_for_rest(rig: Rig, patience_s: float) -> None:
    """Wait until no arm that is sent by program moves, because the check of the next path assumes a start from rest.

    Raises:
        DriverError: if an arm is still moving at the timeout [s].
    """
    try:
        wait_for_arms({name: rig.robots[name] for name in movers(rig)}, {}, patience_s, rig.arms.note)
    except Moving as why:
        raise DriverError(
            f"{why}. No arm is sent while one moves. Look for a low speed slider, or what shakes the arm"
        ) from None


def _joint_travel_rad(start: RobotState, end: RobotState) -> float:
    """Angle by which the leading joint turns [rad]; pi, the usual maximum, if joints are unknown."""
    if start.joints_rad is None or end.joints_rad is None:
        return np.pi
    return float(np.abs(end.joints_rad - start.joints_rad).max())


def _take_sample(taker: Taker, goal: Sample, samples: Sequence[Sample], patience_s: float) -> Sample:
    rig, sketch, folder, settings = taker.rig, taker.sketch, taker.folder, taker.settings
    goals = {name: state for name, state in goal.robots.items() if isinstance(rig.robots.get(name), Moves)}
    before = wait_for_arms(rig.robots, goals, patience_s, rig.arms.note)
    rested_s = time.monotonic()
    taker.notify(f"sample {goal.sample}: waiting for a still image")
    shots = {name: _take_shot(taker, name, rested_s) for name in rig.cameras}
    rig.arms.forget()
    # States after the image are nearer to the pose at the exposure, because the end of a motion is slow.
    live = {name: robot for name, robot in rig.robots.items() if robot.is_live}
    after = wait_for_arms(live, {name: before[name].state for name in live}, settings.patience_s) if live else {}
    states = {name: reading.state for name, reading in {**before, **after}.items()}
    stamp_s = next(iter(shots.values())).stamp_s
    taken = Sample(goal.sample, stamp_s, states)
    _check_repeats(taker, taken, shots, samples)
    if taker.scene is not None:
        taker.notify(f"sample {goal.sample}: looking at the scene")
        new = {name: shots[name] for name in taker.scene.moved_cameras(shots, sketch, taken, samples)}
        sample = replace(taken, images=_write_shots(folder, goal.sample, new)[0])
        taker.scene.check(sample)
        return sample
    taker.notify(f"sample {goal.sample}: looking for the target")
    images, background = _write_shots(folder, goal.sample, shots)
    sample = replace(taken, images=images, background=background)
    equal = find_equal_sample(sketch, sample, samples)
    if equal is not None:
        raise Unfit(f"too similar to sample {equal}")
    seen = detect(sketch.cell, Recording((sample,), folder=str(folder))).samples[0]
    _check_visibility(taker, seen, shots)
    return seen


@dataclass(frozen=True, eq=False)
class _Shot:
    """The image of one camera, with the LED on, and a second image with the LED off if it can be switched."""

    stamp_s: float
    grey: Grey
    background: Grey | None

    @cached_property
    def png(self) -> bytes:
        """The image as it is on the disk."""
        return png_bytes(self.grey)


def _take_shot(taker: Taker, name: str, rested_s: float) -> _Shot:
    camera, targets, patience_s = (
        taker.rig.cameras[name],
        visible_targets(taker.sketch.cell, name),
        taker.settings.patience_s,
    )

    def show(image: CameraImage) -> None:
        """Show an image, and report its note."""
        taker.show_image(name, image.grey)
        if image.note:
            taker.report(image.note)

    image = wait_for_image(camera, targets, patience_s, rested_s, show)
    height, width = image.grey.shape
    if fault := size_fault((width, height), taker.sketch.cell.cameras[name].size_px):
        raise DriverError(f"{name}: {image.source or 'its image'} {fault}")
    if not (isinstance(camera, Switches) and any(target.found_by == LED for target in targets)):
        return _Shot(image.stamp_s, image.grey, None)
    camera.light(False)
    try:
        background = wait_for_image_after(camera, time.monotonic(), patience_s, show).grey
    finally:
        camera.light(True)
    return _Shot(image.stamp_s, image.grey, background)


def _check_repeats(taker: Taker, sample: Sample, shots: Mapping[str, _Shot], samples: Sequence[Sample]) -> None:
    """Check that no camera repeats the image of another sample.

    Raises:
        DriverError: if an image is repeated although the camera or all its targets moved.
    """
    others = {other.sample: other for other in samples}
    for name, shot in shots.items():
        key = (name, sha256(shot.png).digest())
        other = others.get(taker.digests.get(key, -1))
        if other is None:
            taker.digests[key] = sample.sample
        elif _is_new_view(taker.sketch, name, sample, other):
            raise DriverError(
                f"{name}: its image at sample {sample.sample} repeats that of sample {other.sample}, "
                f"though arms moved. Restart the camera, or the program that saves its images"
            )


def _is_new_view(sketch: Sketch, camera: str, first: Sample, second: Sample) -> bool:
    """Whether a camera, or each target that it may see, moved between two samples."""
    shared = first.robots.keys() & second.robots.keys()
    moved = {robot for robot in shared if not is_same_place(sketch, robot, first, second)}
    carrier = sketch.cell.cameras[camera].on
    carriers = {target.on for target in sketch.cell.targets.values() if target.on != carrier}
    return carrier in moved or (bool(carriers) and carriers <= moved)


def visible_targets(cell: Cell, camera: str) -> list[Target]:
    """Targets that a camera may see: all that are not mounted on the same body."""
    carrier = cell.cameras[camera].on
    return [each.target for each in cell.targets.values() if each.on != carrier and each.target is not None]


def _write_shots(folder: Path, number: int, shots: Mapping[str, _Shot]) -> tuple[dict[str, str], dict[str, str]]:
    """Write images to the disk; paths of the images, and of those with the LED off, by camera."""
    images, background = {}, {}
    for camera, shot in shots.items():
        stem = f"recording/images/{camera}/{number:06d}"
        images[camera] = f"{stem}.png"
        write_atomically(folder / images[camera], shot.png, base_folder=folder)
        if shot.background is not None:
            background[camera] = f"{stem}_off.png"
            write_atomically(folder / background[camera], png_bytes(shot.background), base_folder=folder)
    return images, background


def _check_visibility(taker: Taker, sample: Sample, shots: Mapping[str, _Shot]) -> None:
    """Check that each camera sees a target without blur.

    Raises:
        Unfit: if a camera sees no target, or the target is blurred.
    """
    for camera, shot in shots.items():
        observations = [observation for observation in sample.observations if observation.camera == camera]
        if not observations:
            raise Unfit(f"target not seen by {camera}")
        for observation in observations:
            shape = taker.sketch.cell.targets[observation.target].target
            if isinstance(observation, CandidateObservation | PixelObservation) and shape is not None and shape.sheets:
                width = edge_width(shot.grey, observation.pixels)
                points = shape.points[observation.ids] if isinstance(observation, PixelObservation) else shape.points
                view = (camera, observation.target)
                if width is not None and taker.sharpness.is_blurred(view, width, observation.pixels, points):
                    raise Unfit(f"too blurred: edges of {observation.target} are {width.wide_px:.1f} px wide")
