"""Data model of `calibration.json` with the field names and units of the file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model

from basecal.cell.calibration import (
    Calibration,
    Certificate,
    ClockOffset,
    Finding,
    HeldGauge,
    LineTime,
    Outlier,
    Residuals,
    Validation,
    Verdict,
)
from basecal.cell.work_error import BudgetEntry, ErrorMap, LocalFit, MeetingError, Tolerance
from basecal.effects.faces.effect import RandomEffect
from basecal.effects.faces.robot_parameter import RobotParameters
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.errors import InputError, count_text
from basecal.fields.file_forms import (
    THREE,
    Covariance,
    Length,
    Number,
    Real,
    Seconds,
    Sigma,
    Whole,
    WrittenPose,
    as_written,
    pose_data,
)
from basecal.fields.problems import shorten
from basecal.fields.values import Status
from basecal.geometry import Array, Camera, PoseEstimate

_Sigma3 = Annotated[list[Sigma | None], THREE]
_Sigma6 = Annotated[list[Sigma | None], Field(min_length=6, max_length=6)]


def _check_transform_name(name: str) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9_]*_from_[a-z][a-z0-9_]*", name) or name.count("_from_") != 1:
        raise ValueError(f"expected the name of a transform, a_from_b, got {shorten(name)}")
    return name


_Name = Annotated[str, AfterValidator(_check_transform_name)]


class _Estimate(NamedTuple):
    """A known transform; `size` is 3 if only its position is defined, otherwise 6."""

    estimate: PoseEstimate
    size: int
    status: str | None
    verdict: Verdict


class _WrittenTransform(WrittenPose):
    covariance: Covariance
    status: Status | None
    verdict: Verdict

    def transform_entry(self) -> _Estimate:
        """Return the transform with a covariance (6, 6) [m, rad]."""
        size, full = len(self.covariance), np.zeros((6, 6))
        if size not in (3, 6):
            raise ValueError(f"covariance: has {count_text(size, 'row')}, expected 3 or 6")
        full[:size, :size] = self.covariance
        return _Estimate(PoseEstimate(self.transform(), full), size, self.status, self.verdict)


def _transform_data(entry: _Estimate) -> dict[str, Any]:
    covariance = entry.estimate.covariance[: entry.size, : entry.size] + 0.0
    return pose_data(entry.estimate.mean) | {"covariance": covariance, "status": entry.status, "verdict": entry.verdict}


class _WrittenLens(BaseModel):
    model_config = ConfigDict(allow_inf_nan=False, defer_build=True)
    model: str
    fx: Number
    fy: Number
    cx: Number
    cy: Number
    distortion: list[Number]
    size_px: tuple[Whole, Whole] | None
    covariance: Covariance

    def lens(self) -> tuple[Camera, Array]:
        """Return the camera and the covariance of its parameters."""
        parameters = np.array([self.fx, self.fy, self.cx, self.cy, *self.distortion])
        return Camera(self.model, parameters, self.size_px), self.covariance


def _lens_data(lens: tuple[Camera, Array]) -> dict[str, Any]:
    camera, covariance = lens
    fx, fy, cx, cy, *terms = (camera.parameters + 0.0).tolist()
    return {
        "model": camera.model,
        **{"fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": terms},
        "size_px": camera.size_px,
        "covariance": covariance,
    }


@dataclass(frozen=True, eq=False)
class _Joint:
    order: tuple[_Name, ...]
    covariance: Covariance


@dataclass(frozen=True)
class _Observability:
    condition: Real | None
    unobservable: tuple[str, ...]


class _WrittenSettings(BaseModel):
    """Settings; only those used in calculations are validated."""

    model_config = ConfigDict(extra="allow", defer_build=True)
    tolerance_m: Annotated[Length, Field(gt=0)] | None = None

    def plain(self) -> dict[str, Any]:
        """Return the settings as plain data."""
        return self.model_dump(exclude_unset=True)


_Transform = Annotated[_Estimate, as_written(_WrittenTransform, _WrittenTransform.transform_entry, _transform_data)]
_Lens = Annotated[tuple[Camera, Array], as_written(_WrittenLens, _WrittenLens.lens, _lens_data)]
_Settings = Annotated[Mapping[str, Any], as_written(_WrittenSettings, _WrittenSettings.plain, dict)]
_TimeSigma = Annotated[Seconds, Field(ge=0)]


@dataclass(frozen=True, eq=False)
class CalibrationFile:
    """Content of `calibration.json` without its schema, the program's version and the robot parameters."""

    __pydantic_config__: ClassVar = ConfigDict(allow_inf_nan=False, defer_build=True)
    verdict: Verdict
    transforms: Mapping[_Name, _Transform]
    intrinsics: Mapping[str, _Lens]
    clock_offset_s: Mapping[str, Seconds] | None
    clock_sigma_s: Mapping[str, _TimeSigma] | None
    line_time_s: Mapping[str, Seconds] | None
    line_time_sigma_s: Mapping[str, _TimeSigma] | None
    noise: WrittenNoise
    joint: _Joint | None
    gauges: tuple[HeldGauge, ...]
    residuals: Residuals
    outliers: tuple[Outlier, ...] | None
    validation: Validation | None
    observability: _Observability
    certificate: Certificate | None
    budget: tuple[BudgetEntry, ...] | None
    error_map: ErrorMap | None
    local: tuple[LocalFit, ...] | None
    meeting: MeetingError | None
    findings: tuple[Finding, ...]
    tolerance: Tolerance | None
    settings: _Settings
    inputs: Mapping[str, str]
    versions: Mapping[str, str]

    def check_fields(self) -> Self:
        """Check that the fields are consistent, and return self.

        Raises:
            InputError: if they are not.
        """
        for sigmas, values in (("clock_sigma_s", "clock_offset_s"), ("line_time_sigma_s", "line_time_s")):
            if (getattr(self, sigmas) or {}).keys() != (getattr(self, values) or {}).keys():
                raise InputError(f"{sigmas}: expected a sigma of each of {values}")
        if self.joint is not None and len(self.joint.covariance) != 6 * len(self.joint.order):
            size, count = len(self.joint.covariance), len(self.joint.order)
            raise InputError(
                f"joint.covariance: has {count_text(size, 'row')}, expected 6 for each of {count} transforms"
            )
        rows = 0 if self.joint is None else len(self.joint.covariance)
        if any(len(gauge.covariance) != rows for gauge in self.gauges):
            raise InputError(f"gauges: expected covariances of {rows} rows, as joint.covariance has")
        if (errors := self.error_map) and not len(errors.points_m) == len(errors.length_95_m) == len(
            errors.angle_95_rad
        ):
            raise InputError("error_map: expected an error in mm and in deg for each point")
        return self

    @classmethod
    def from_calibration(cls, calibration: Calibration) -> Self:
        """Return the file content of a calibration."""
        joint = calibration.joint_covariance
        clocks, lines = calibration.clocks, calibration.line_times
        return cls(
            transforms={name: _transform_entry(name, calibration) for name in calibration.transforms},
            intrinsics=calibration.cameras,
            clock_offset_s={name: clock.offset_s for name, clock in clocks.items()} or None,
            clock_sigma_s={name: clock.sigma_s for name, clock in clocks.items()} or None,
            line_time_s={name: line.line_time_s for name, line in lines.items()} or None,
            line_time_sigma_s={name: line.sigma_s for name, line in lines.items()} or None,
            joint=None if joint is None else _Joint(calibration.order, joint),
            observability=_Observability(calibration.condition, calibration.unobservable),
            **{name: getattr(calibration, name) for name in _SHARED_FIELDS},
        )

    def calibration(self, robot_parameters: Mapping[str, Mapping[str, RobotParameters]]) -> Calibration:
        """Return the calibration with these robot parameters by kind, then by robot."""
        entries, joint = self.transforms, self.joint
        return Calibration(
            transforms={name: entry.estimate for name, entry in entries.items()},
            verdicts={name: entry.verdict for name, entry in entries.items()},
            status={name: entry.status for name, entry in entries.items() if entry.status is not None},
            points=frozenset(name for name, entry in entries.items() if entry.size == 3),
            cameras=self.intrinsics,
            robot_parameters=robot_parameters,
            clocks={n: ClockOffset(s, (self.clock_sigma_s or {})[n]) for n, s in (self.clock_offset_s or {}).items()},
            line_times={n: LineTime(s, (self.line_time_sigma_s or {})[n]) for n, s in (self.line_time_s or {}).items()},
            order=() if joint is None else joint.order,
            joint_covariance=None if joint is None else joint.covariance,
            condition=self.observability.condition,
            unobservable=self.observability.unobservable,
            **{name: getattr(self, name) for name in _SHARED_FIELDS},
        )


_SHARED_FIELDS = CalibrationFile.__dataclass_fields__.keys() & Calibration.__dataclass_fields__.keys() - {"transforms"}


def _transform_entry(name: str, calibration: Calibration) -> _Estimate:
    return _Estimate(
        calibration.transforms[name],
        3 if name in calibration.points else 6,
        calibration.status.get(name),
        calibration.verdicts.get(name, calibration.verdict),
    )


class _MeasurementNoise(BaseModel):
    """Sigmas of camera measurements."""

    pixel_px: Sigma | None = None
    pose_m: Sigma | None = None
    pose_rad: Sigma | None = None
    point_m: Sigma | None = None
    touch_m: Sigma | None = None
    grip_rad: Sigma | None = None


class _CameraNoise(_MeasurementNoise):
    factor: Real | None
    views_count: Whole


class _RobotNoise(BaseModel):
    """Sigmas of a robot's independent error per stop; errors shared by stops are stored by random effect."""

    sigma_t_m: _Sigma3
    sigma_r_rad: _Sigma3
    rms_factor: Sigma | None = None
    freedoms: Annotated[Real, Field(ge=1)] | None = None


class _ClockNoise(BaseModel):
    jitter_s: Sigma | None


class _Target(BaseModel):
    shape: list[Number]


def _effect_field(name: str, effect: RandomEffect) -> Any:
    """Field of a random effect in the model: its sigmas and figures."""
    error_fields = () if effect.is_by_coordinate else ("shift_m", "turn_rad")
    numbers: dict[str, Any] = dict.fromkeys((*error_fields, *effect.figures), (Real, ...))
    return create_model(name, sigma=(_Sigma6, ...), **numbers) | None, None


_EFFECT_FIELDS: dict[str, Any] = {name: _effect_field(name, effect) for name, effect in RANDOM_EFFECTS.items()}
_AnyRobotNoise: Any = create_model("_AnyRobotNoise", __base__=_RobotNoise, **_EFFECT_FIELDS)


class _Noise(_MeasurementNoise):
    correlated_px: Sigma | None = None
    cameras: dict[str, _CameraNoise] | None = None
    robots: dict[str, _AnyRobotNoise] | None = None
    clocks: dict[str, _ClockNoise] | None = None
    targets: dict[str, _Target] | None = None


def _noise_data(noise: _Noise | None) -> dict[str, Any]:
    return {} if noise is None else noise.model_dump(exclude_unset=True)


WrittenNoise = Annotated[Mapping[str, Any], as_written(_Noise | None, _noise_data, dict)]
"""Sigmas by measurement; those of `cameras`, `robots`, `clocks` and `targets` also by name."""
