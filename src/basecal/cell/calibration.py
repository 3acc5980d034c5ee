"""The calibration result: transforms with covariance, the quality of the fit, and findings."""

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
    """Schema of a number that files store times `factor`; null in a file is read as NaN."""
    return as_written(Error, lambda value: math.nan if value is None else value / factor, lambda value: value * factor)


@dataclass(frozen=True)
class Finding:
    """A problem or a remark for the user.

    Attributes:
        code: A kind from docs/findings.md, such as `unobservable-direction`.
        severity: `error` makes the verdict `refused`, `warning` makes it `doubtful`, `info` does not affect it.
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
    """Residuals of one view: rms over its coordinates [px], and the closure error of its loop; None if undefined."""

    sample: Whole
    camera: str
    target: str
    rms_px: Error = None
    loop_m: Annotated[ErrorInMm, Field(alias="loop_mm")] = None
    loop_rad: Annotated[ErrorInDeg, Field(alias="loop_deg")] = None


@dataclass(frozen=True)
class Loop:
    """A closed path over robots' bases, cameras and targets, and its closure error.

    Attributes:
        path: Names along the path. If it starts and ends at the same base, it is a ring; otherwise the transform
            between the two end bases closes it.
        views: Number of views used.
        rms_m: Translation closure error [m], rms over views, or of the ring.
        rms_rad: Rotation closure error [rad], rms over views, or of the ring.
    """

    path: tuple[str, ...]
    views: Whole
    rms_m: Annotated[float, Field(alias="rms_mm"), _number_in_unit(1e3)]
    rms_rad: Annotated[float, Field(alias="rms_deg"), _number_in_unit(math.degrees(1))]


@dataclass(frozen=True)
class Residuals:
    """Residuals of all views; None if no view defines the number."""

    rms_px: Error = None
    median_px: Error = None
    loop_rms_m: Annotated[ErrorInMm, Field(alias="loop_rms_mm")] = None
    loop_rms_rad: Annotated[ErrorInDeg, Field(alias="loop_rms_deg")] = None
    per_sample: tuple[SampleResidual, ...] = ()
    loops: tuple[Loop, ...] = ()


@dataclass(frozen=True)
class Outlier:
    """An observation that was excluded because it contradicts the others.

    Attributes:
        sample: Number of the sample.
        camera: Name of the camera.
        target: Name of the target.
        ids: Ids of the excluded points; empty if the whole view is excluded.
        reason: The reason in words.
        image: Path of the image as in the recording; None if not recorded.
    """

    sample: Whole
    camera: str
    target: str
    ids: tuple[Whole, ...]
    reason: str
    image: str | None = None


@dataclass(frozen=True)
class Validation:
    """Prediction errors of held-out samples.

    Attributes:
        kind: `k-fold`.
        folds: Number of folds.
        rms_px: Rms error of a held-out pixel coordinate [px]; None without pixels.
        target_m: Rms distance of the predicted `camera_from_target` from the view's own pose [m]; None if views have
            no pose.
        target_rad: Rms angle between the same two poses [rad]; None if views have no pose.
        base_change: Mean over folds of the squared change of the requested transforms, divided by the value expected
            from the covariance. It is about 1 if the covariance is true; None if nothing requested is free.
        rivals: This calibration and other methods on the same views; empty if they were not requested.
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
    """Certificate of global optimality.

    Attributes:
        gap: Cost divided by the proven lower bound, minus one; None if no bound was found.
        is_global: True if the optimum is proven to be global; None if this could not be decided.
        reason: Why optimality could not be decided; empty if it was.
    """

    gap: Real | None
    is_global: Annotated[Flag | None, Field(alias="global")]
    reason: str = ""


@dataclass(frozen=True)
class ClockOffset:
    """Offset to add to a device's stamps to convert them to the reference clock [s], and its sigma; 0 if fixed."""

    offset_s: float
    sigma_s: float


@dataclass(frozen=True)
class LineTime:
    """Time between successive rows of a camera's images [s], and its sigma [s]; 0 if fixed."""

    line_time_s: float
    sigma_s: float


@dataclass(frozen=True, eq=False)
class HeldGauge:
    """Uncertainty of transforms due to parameters of a robot that a gauge fixes at zero.

    Attributes:
        robot: Name of the robot.
        parameters: Kinds of the parameters.
        covariance: (6 n, 6 n) [m, rad] contribution to the covariance of the transforms of `Calibration.order`.
    """

    robot: str
    parameters: tuple[str, ...]
    covariance: Covariance


@dataclass(frozen=True, eq=False)
class Calibration(Exports):
    """The calibration result with its uncertainty, quality and findings.

    Attributes:
        verdict: `good`, `doubtful` or `refused`.
        transforms: Estimates by name; a transform with an unobservable direction is left out.
        status: `fixed`, `prior` or `free` of each of `transforms`.
        points: Names of the transforms whose rotation is not defined (mounts of a single point).
        cameras: Estimated lenses with the covariance of their parameters, by camera; fixed lenses are left out.
        robot_parameters: Estimated kinematic parameters by kind, then by robot.
        clocks: Clock offsets of cameras and robots by name; empty if all share one clock.
        line_times: Line times of the rolling-shutter cameras by name.
        noise: Sigmas used or estimated, such as `pixel_px`, `pose_m` and `touch_m`, and by robot.
        order: Names of the transforms of `joint_covariance`, 6 rows each.
        joint_covariance: (6 n, 6 n) [m, rad].
        gauges: Per robot, the part of `joint_covariance` due to parameters that a gauge fixes at zero.
        residuals: Residuals of the views.
        outliers: Excluded observations with reasons; None if outliers were not searched for.
        validation: Prediction errors of held-out samples; None if not computed.
        certificate: Certificate of global optimality; None if not requested.
        condition: Condition number of the whitened, scaled information matrix.
        unobservable: Unobservable directions in words.
        budget: The error at the task by source, the largest first; None if no task is named.
        error_map: The error over the workspace; None if no task is named.
        local: Parts of the workspace calibrated separately; None if no task is named.
        meeting: The error of one flange against another at the work; None if no transform between robots was estimated.
        findings: Problems and remarks for the user.
        verdicts: Verdict on each of `transforms`, from the findings that concern it.
        tolerance: Comparison of the error with the tolerance; None if no tolerance was given.
        settings: Settings of the solver, and `tolerance_m` if a tolerance is stated.
        inputs: `sha256:...` of each file read.
        versions: Versions of the programs used, by name.
        scene: Points of the static scene, if it was used; they are stored in a separate file.
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

    @property
    def outlier_views(self) -> frozenset[tuple[int, str, str]]:
        """Sample, camera and target of the views that are outliers as a whole."""
        return frozenset((each.sample, each.camera, each.target) for each in self.outliers or () if not each.ids)

    def known_transforms(self, cell: Cell) -> dict[str, SE3]:
        """Known transforms of the calibrated cell by name: fixed in the cell, or estimated."""
        fixed = {name: u.mean for name, u in cell.transforms.items() if u.status == "fixed" and u.mean is not None}
        return fixed | {name: estimate.mean for name, estimate in self.transforms.items()}

    def parameters_of_robot(self, robot: str) -> dict[str, RobotParameters]:
        """Estimated kinematic parameters of a robot, by kind."""
        return {kind: by_robot[robot] for kind, by_robot in self.robot_parameters.items() if robot in by_robot}

    def gauge_covariances(self, name: str) -> dict[str, Array]:
        """Part of a transform's covariance due to parameters that gauges fix at zero, (6, 6) [m, rad], by robot."""
        if name not in self.order:
            return {}
        rows = slice(6 * self.order.index(name), 6 * self.order.index(name) + 6)
        blocks = {gauge.robot: gauge.covariance[rows, rows] for gauge in self.gauges}
        return {robot: block for robot, block in blocks.items() if np.any(block)}

    def between(self, robot: str, other_robot: str) -> PoseEstimate:
        """Estimate of `<robot>_base_from_<other>_base` for any two robots, with their correlation.

        The covariance (6, 6) [m, rad] is in the right tangent, in the axes of the other robot's base. Bases observed
        by the same views are known better relative to each other than to the reference.

        Raises:
            FrameNotFound: if a robot does not exist, or its base was not estimated.
        """
        return base_between(self.transforms, self.order, self.joint_covariance, robot, other_robot)

    def frame_between(self, parent: str, child: str) -> PoseEstimate:
        """Estimate of `<parent>_from_<child>` for two rigidly connected frames, such as two on one flange.

        The covariance (6, 6) [m, rad] is in the right tangent, in the axes of `child`.

        Raises:
            FrameNotFound: if a frame does not exist, or its pose was not estimated.
            InputError: if the frames move relative to each other, or one is a single point, which has no rotation.
        """
        poses = {name: estimate for name, estimate in self.transforms.items() if name not in self.points}
        for frame in (parent, child):
            for point in self.points:
                if point.endswith(f"_from_{frame}"):
                    raise InputError(f"{frame!r} is a point and has no rotation: see {point} in calibration.json")
        return frame_between(poses, self.order, self.joint_covariance, parent, child)

    def __repr__(self) -> str:
        """Return a one-line summary."""
        estimates = "; ".join(f"{name} {estimate.words()}" for name, estimate in self.transforms.items())
        return f"<{self.verdict} calibration: {estimates or 'no transform'}>"

    def _repr_html_(self) -> str:
        """The table that a notebook shows."""
        return str(METHODS["html_summary"](self))

    def __getitem__(self, name: str) -> PoseEstimate:
        """The estimate of a transform, such as `calibration["eye_base_from_hand_base"]`.

        Raises:
            FrameNotFound: if the transform does not exist or was not estimated.
        """
        if name not in self.transforms:
            raise FrameNotFound(name, list(self.transforms))
        return self.transforms[name]


@dataclass(frozen=True)
class Rival:
    """Prediction errors of a method on the held-out views.

    Attributes:
        name: Name of the method.
        target_m: Rms distance of the predicted `camera_from_target` from the view's own pose [m]; None if the method
            fails.
        target_rad: Rms angle between the same two poses [rad]; None if the method fails.
    """

    name: str
    target_m: Annotated[ErrorInMm, Field(alias="target_mm")] = None
    target_rad: Annotated[ErrorInDeg, Field(alias="target_deg")] = None
