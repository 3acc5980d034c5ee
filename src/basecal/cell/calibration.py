"""The answer: transforms with covariance, the quality of the fit, and findings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, GetPydanticSchema

from basecal.cell.cell import Cell
from basecal.cell.exports import Exports
from basecal.cell.fingerprint import Fingerprint
from basecal.cell.frames import base_between, frame_between
from basecal.cell.work_error import BudgetEntry, ErrorMap, LocalFit, MeetingError, Tolerance
from basecal.effects.faces.robot_parameter import RobotParameters
from basecal.errors import FrameNotFound, InputError
from basecal.fields.file_forms import (
    Covariance,
    Error,
    ErrorInDeg,
    ErrorInMm,
    Flag,
    Real,
    Whole,
    as_written,
)
from basecal.geometry import SE3, Array, Camera, PoseEstimate
from basecal.methods import METHODS

Severity = Literal["info", "warning", "error"]
Verdict = Literal["good", "doubtful", "refused"]


def _number_in_unit(factor: float) -> GetPydanticSchema:
    """A number in another unit, which is NaN if a file has null."""
    return as_written(Error, lambda value: math.nan if value is None else value / factor, lambda value: value * factor)


@dataclass(frozen=True)
class Finding:
    """Something the user should know.

    Attributes:
        code: A kind from docs/findings.md, such as `unobservable-direction`.
        severity: `error` refuses, `warning` makes doubtful, `info` does neither.
        about: Names of samples, robots, cameras, targets or transforms.
        what: The problem, with its number and unit.
        do: What to do: sentences, or commands to copy.
        why: The cause, if it is known; empty if not.
    """

    code: str
    severity: Severity
    about: tuple[str, ...]
    what: str
    do: tuple[str, ...] = ()
    why: str = ""

    @property
    def message(self) -> str:
        """The text of what, why and do, joined."""
        return " ".join(part for part in (self.what, self.why, *self.do) if part)


@dataclass(frozen=True)
class SampleResidual:
    """How one view fits: rms over its coordinates [px], and the loop it closes [m, rad]; None if not defined."""

    sample: Whole
    camera: str
    target: str
    rms_px: Error = None
    loop_m: Annotated[ErrorInMm, Field(alias="loop_mm")] = None
    loop_rad: Annotated[ErrorInDeg, Field(alias="loop_deg")] = None


@dataclass(frozen=True)
class Loop:
    """A closed path over robots' bases, cameras and targets, and how far from closing it is.

    Attributes:
        path: Names along it. Where it begins and ends at one base it goes around a ring; else the bases at its ends
            are those whose transform closes it.
        views: On how many it rests.
        rms_m: Length by which it fails to close [m], rms over views, or of the ring.
        rms_rad: Angle likewise [rad].
    """

    path: tuple[str, ...]
    views: Whole
    rms_m: Annotated[float, Field(alias="rms_mm"), _number_in_unit(1e3)]
    rms_rad: Annotated[float, Field(alias="rms_deg"), _number_in_unit(math.degrees(1))]


@dataclass(frozen=True)
class Residuals:
    """How everything fits; None if no view defines it."""

    rms_px: Error = None
    median_px: Error = None
    loop_rms_m: Annotated[ErrorInMm, Field(alias="loop_rms_mm")] = None
    loop_rms_rad: Annotated[ErrorInDeg, Field(alias="loop_rms_deg")] = None
    per_sample: tuple[SampleResidual, ...] = ()
    loops: tuple[Loop, ...] = ()


@dataclass(frozen=True)
class Outlier:
    """An observation that was excluded, since it contradicts the rest.

    Attributes:
        sample: Number of the sample.
        camera: Which camera saw it.
        target: What it saw.
        ids: Which points; none if the whole view is left out.
        reason: In words.
        image: Path of its image as in the recording; None if none was recorded.
    """

    sample: Whole
    camera: str
    target: str
    ids: tuple[Whole, ...]
    reason: str
    image: str | None = None


@dataclass(frozen=True)
class Validation:
    """How well held-out samples are predicted.

    Attributes:
        kind: `k-fold`.
        folds: How many.
        rms_px: Of a coordinate, held out [px]; None without pixels.
        target_m: Rms distance of `camera_from_target` from where the view alone has it [m]; None if it has none.
        target_rad: Likewise its rms angle [rad].
        base_change: Mean over folds of the squared change of the requested transforms, in units of its expectation by
            the covariance. It is about 1 if the covariance is true; None if nothing requested is free.
        rivals: The answer and other methods on the same views; none if they were not requested.
    """

    kind: str
    folds: Whole
    rms_px: Error = None
    target_m: Annotated[ErrorInMm, Field(alias="target_mm")] = None
    target_rad: Annotated[ErrorInDeg, Field(alias="target_deg")] = None
    base_change: Error = None
    rivals: tuple[Rival, ...] = ()


@dataclass(frozen=True)
class Certificate:
    """Whether no other state fits better.

    Attributes:
        gap: Cost over the proven lower bound, less one; None if no bound was found.
        is_global: True where proven; None if it could not be decided.
        reason: Why it could not; empty if it was.
    """

    gap: Real | None
    is_global: Annotated[Flag | None, Field(alias="global")]
    reason: str = ""


@dataclass(frozen=True)
class ClockOffset:
    """The offset from a device's stamps to the reference's, and its sigma [s]; 0 if it is fixed."""

    offset_s: float
    sigma_s: float


@dataclass(frozen=True)
class LineTime:
    """How long after a row of a camera's images the next is seen, and its sigma [s]; 0 if it is fixed."""

    line_time_s: float
    sigma_s: float


@dataclass(frozen=True, eq=False)
class HeldGauge:
    """Uncertainty of transforms by parameters of a robot that a gauge holds at zero.

    Attributes:
        robot: Its name.
        parameters: Kinds of the parameters.
        covariance: (6 n, 6 n) [m, rad] of the transforms of `Calibration.order`, part of their covariance.
    """

    robot: str
    parameters: tuple[str, ...]
    covariance: Covariance


@dataclass(frozen=True, eq=False)
class Calibration(Exports):
    """The answer, with all that is needed to trust it.

    Attributes:
        verdict: `good`, `doubtful` or `refused`.
        transforms: Estimates by name; a transform with an unobservable direction is left out.
        status: `fixed`, `prior` or `free` of each of `transforms`.
        points: Names of the transforms whose rotation is not defined (mounts of a single point).
        cameras: Lenses with the covariance of their parameters, by camera; those not fixed.
        robot_parameters: By kind, then by robot; of those given by joints whose parameters are not fixed.
        clocks: Of the cameras and robots whose clocks were not all taken for one, by name.
        line_times: Of the cameras whose rows are seen one after another, by name.
        noise: Sigmas used or estimated, such as `pixel_px`, `pose_m` and `touch_m`, and by robot.
        order: Names of the transforms of `joint_covariance`, 6 rows each.
        joint_covariance: (6 n, 6 n) [m, rad].
        gauges: What of it comes of parameters that are held at zero, robot by robot.
        residuals: How everything fits.
        outliers: What was not used, and why; None if it was not looked for.
        validation: How well held-out samples are predicted; None if it was not computed.
        certificate: Whether the optimum is proven; None if it was not asked.
        condition: Condition number of the whitened, scaled information.
        unobservable: Directions that the data leave open, in words.
        budget: The error at the task by source, the largest first; None if no task is named.
        error_map: The error over the workspace; None if no task is named.
        local: Parts of the workspace calibrated separately; None if no task is named.
        meeting: The error of one flange against another at the work; None if nothing found is placed between robots.
        findings: What the user should know.
        verdicts: Of each of `transforms`, by the findings that concern it.
        tolerance: How the answer compares with what is needed; None if no tolerance was given.
        settings: What was asked of the solver, and `tolerance_m` where it is stated how well the answer must be known.
        inputs: `sha256:...` of each file read.
        versions: Of the programs that were used, by name.
        scene: Points of the static scene, if it took part; they are kept in a file of their own.
    """

    verdict: Verdict
    transforms: Mapping[str, PoseEstimate] = field(default_factory=dict)
    status: Mapping[str, str] = field(default_factory=dict)
    points: frozenset[str] = frozenset()
    cameras: Mapping[str, tuple[Camera, Array]] = field(default_factory=dict)
    robot_parameters: Mapping[str, Mapping[str, RobotParameters]] = field(default_factory=dict)
    clocks: Mapping[str, ClockOffset] = field(default_factory=dict)
    line_times: Mapping[str, LineTime] = field(default_factory=dict)
    noise: Mapping[str, Any] = field(default_factory=dict)
    order: tuple[str, ...] = ()
    joint_covariance: Array | None = None
    gauges: tuple[HeldGauge, ...] = ()
    residuals: Residuals = Residuals()
    outliers: tuple[Outlier, ...] | None = None
    validation: Validation | None = None
    certificate: Certificate | None = None
    condition: float | None = None
    unobservable: tuple[str, ...] = ()
    budget: tuple[BudgetEntry, ...] | None = None
    error_map: ErrorMap | None = None
    local: tuple[LocalFit, ...] | None = None
    meeting: MeetingError | None = None
    findings: tuple[Finding, ...] = ()
    verdicts: Mapping[str, Verdict] = field(default_factory=dict)
    tolerance: Tolerance | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    scene: Fingerprint | None = None

    def known_transforms(self, cell: Cell) -> dict[str, SE3]:
        """The known transforms of the calibrated cell, by name: fixed there, or found here."""
        fixed = {name: u.mean for name, u in cell.transforms.items() if u.status == "fixed" and u.mean is not None}
        return fixed | {name: estimate.mean for name, estimate in self.transforms.items()}

    def parameters_of_robot(self, robot: str) -> dict[str, RobotParameters]:
        """Estimates of a robot's own kinematics, by kind."""
        return {kind: found[robot] for kind, found in self.robot_parameters.items() if robot in found}

    def gauge_covariances(self, name: str) -> dict[str, Array]:
        """The part of a transform's covariance by a robot's held parameters, (6, 6) [m, rad], by robot."""
        if name not in self.order:
            return {}
        at = slice(6 * self.order.index(name), 6 * self.order.index(name) + 6)
        return {gauge.robot: gauge.covariance[at, at] for gauge in self.gauges if np.any(gauge.covariance[at, at])}

    def between(self, robot: str, other_robot: str) -> PoseEstimate:
        """`<robot>_base_from_<other>_base` of any two robots, by what both share too.

        The covariance (6, 6) [m, rad] is in the right tangent, in the axes of the other's base. Bases that the same
        views place are known better relative to each other than to the reference's.

        Raises:
            FrameNotFound: if there is no such robot, or its base was not found.
        """
        return base_between(self.transforms, self.order, self.joint_covariance, robot, other_robot)

    def frame_between(self, parent: str, child: str) -> PoseEstimate:
        """`<parent>_from_<child>` of any two frames that do not move against each other, such as two of one flange.

        The covariance (6, 6) [m, rad] is as of `between`.

        Raises:
            FrameNotFound: if there is no such frame, or its pose was not found.
            InputError: if the frames move against each other, or one is a single point, which has no rotation.
        """
        placed = {name: estimate for name, estimate in self.transforms.items() if name not in self.points}
        for frame in (parent, child):
            for point in self.points:
                if point.endswith(f"_from_{frame}"):
                    raise InputError(f"{frame!r} is a point and has no rotation: see {point} in calibration.json")
        return frame_between(placed, self.order, self.joint_covariance, parent, child)

    def __repr__(self) -> str:
        """One line."""
        told = "; ".join(f"{name} {estimate.words()}" for name, estimate in self.transforms.items())
        return f"<{self.verdict} calibration: {told or 'no transform'}>"

    def _repr_html_(self) -> str:
        """The table that a notebook shows."""
        return str(METHODS["html_summary"](self))

    def __getitem__(self, name: str) -> PoseEstimate:
        """The estimate of a transform, such as `calibration["eye_base_from_hand_base"]`.

        Raises:
            FrameNotFound: if it was not found or does not exist.
        """
        if name not in self.transforms:
            raise FrameNotFound(name, list(self.transforms))
        return self.transforms[name]


@dataclass(frozen=True)
class Rival:
    """How well another method predicts the held-out views.

    Attributes:
        name: Of the method.
        target_m: Rms distance of `camera_from_target` from where the view alone has it [m]; None where it fails.
        target_rad: Likewise its rms angle [rad].
    """

    name: str
    target_m: Annotated[ErrorInMm, Field(alias="target_mm")] = None
    target_rad: Annotated[ErrorInDeg, Field(alias="target_deg")] = None
