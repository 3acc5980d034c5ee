"""The shape of `calibration.json`: what each of its fields may hold, as pydantic models."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, create_model, model_validator

from basecal.cell.schema.errors import problems_of
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.errors import InputError
from basecal.fields.problems import field_name, short
from basecal.fields.values import LARGEST

_FARTHEST = 1e9  # [m, px]: a thousand times what a cell may hold; squares of it are far from overflow
_FARTHEST_S = 1e12  # [s] as far as stamps may be

LARGEST_NUMBER = 1e150
"""Of any field: beyond it a square overflows, and nothing that is measured is as large."""


def _covariance(rows: list[list[float | None]]) -> list[list[float | None]]:
    """A square whose variances are not negative; a number that is not known is null."""
    if any(len(row) != len(rows) for row in rows):
        raise ValueError(f"expected a square, got {len(rows)} rows of {' or '.join(map(str, {len(r) for r in rows}))}")
    values = np.array(rows, dtype=np.float64).reshape(len(rows), len(rows))  # null is no number there
    bad = (np.diagonal(values) < 0) | np.any(np.abs(values) > LARGEST_NUMBER, axis=1)
    if bad.any():
        first = int(np.argmax(bad))
        raise ValueError(f"row {first} holds a number beyond {LARGEST_NUMBER:g} or a variance below 0")
    return rows


def _transform_name(name: str) -> str:
    if not re.fullmatch(r"[a-z][a-z0-9_]*_from_[a-z][a-z0-9_]*", name) or name.count("_from_") != 1:
        raise ValueError(f"expected the name of a transform, a_from_b, got {short(name)}")
    return name


_Name = Annotated[str, AfterValidator(_transform_name)]
_Covariance = Annotated[list[list[float | None]], AfterValidator(_covariance)]
_Three = Field(min_length=3, max_length=3)
_Error = Annotated[float, Field(ge=0, le=LARGEST_NUMBER)] | None  # also null, where no view defines it
_Status = Literal["fixed", "prior", "free"]
_Sigma = Annotated[float, Field(ge=0, le=LARGEST)] | None
_Sigma3 = Annotated[list[_Sigma], _Three]
_Number = Annotated[float, Field(ge=-_FARTHEST, le=_FARTHEST)]
_Length = Annotated[float, Field(ge=0, le=_FARTHEST)]


class _Result(BaseModel):
    """A mapping whose known fields are checked; a later program may have added others."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False, frozen=True)


class _Pose(_Result):
    t_m: Annotated[list[_Number], _Three]
    q_xyzw: Annotated[list[float], Field(min_length=4, max_length=4)]


class _Transform(_Pose):
    covariance: Annotated[_Covariance, Field(min_length=3, max_length=6)]
    status: _Status | None
    verdict: Literal["good", "doubtful", "refused"]


class _Lens(_Result):
    model: str
    fx: _Number
    fy: _Number
    cx: _Number
    cy: _Number
    distortion: list[_Number]
    size_px: Annotated[list[int], Field(min_length=2, max_length=2)] | None
    covariance: _Covariance
    status: _Status | None = None


class _Joint(_Result):
    order: list[_Name]
    covariance: _Covariance


class _SampleResidual(_Result):
    sample: int
    camera: str
    target: str
    rms_px: _Error
    loop_mm: _Error
    loop_deg: _Error


class _Loop(_Result):
    path: list[str]
    views: int
    rms_mm: _Error
    rms_deg: _Error


class _Residuals(_Result):
    rms_px: _Error
    median_px: _Error
    loop_rms_mm: _Error
    loop_rms_deg: _Error
    per_sample: list[_SampleResidual]
    loops: list[_Loop]


class _Outlier(_Result):
    sample: int
    camera: str
    target: str
    ids: list[int]
    reason: str


class _Validation(_Result):
    kind: str
    folds: int
    rms_px: _Error
    target_mm: _Error
    target_deg: _Error
    base_change: _Error


class _Observability(_Result):
    condition: float | None
    unobservable: list[str]


class _BudgetEntry(_Result):
    source: str
    mm: _Length
    percent: float
    total_mm_if_halved: _Length


class _ErrorMap(_Result):
    points_m: list[Annotated[list[_Number], _Three]]
    mm_95: list[_Length]
    deg_95: list[_Length]

    @model_validator(mode="after")
    def _of_each(self) -> Self:
        """Every point has its error."""
        if not len(self.points_m) == len(self.mm_95) == len(self.deg_95):
            raise ValueError("expected an error in mm and in deg for each point")
        return self


class _LocalFit(_Result):
    centre_m: Annotated[list[_Number], _Three]
    samples: list[int]
    global_mm: _Length | None
    local_mm: _Length | None
    p: _Number
    recommended: Literal["local", "global"]
    transforms: dict[str, _Pose]


class _Certificate(_Result):
    gap: float | None
    is_global: Annotated[bool | None, Field(alias="global")]
    reason: str


class _Finding(_Result):
    code: str
    severity: Literal["info", "warning", "error"]
    about: list[str]
    what: str
    why: str
    do: list[str]
    message: str


class _CommonError(_Result):
    sigma: Annotated[list[_Sigma], Field(min_length=6, max_length=6)]


class _RobotNoise(_Result):
    """Sigmas of each stop by itself; beside them those of errors that stops share, by the name of the effect."""

    model_config = ConfigDict(extra="allow")
    sigma_t_m: _Sigma3
    sigma_r_rad: _Sigma3
    rms_factor: _Sigma | None = None
    freedoms: Annotated[float, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _terms(self) -> Self:
        """Every effect has its sigmas, and its figures."""
        for name in RANDOM_EFFECTS.keys() & (self.__pydantic_extra__ or {}).keys():
            figures: dict[str, Any] = dict.fromkeys(RANDOM_EFFECTS[name].figures, (float, ...))
            create_model(name, __base__=_CommonError, **figures).model_validate(getattr(self, name))
        return self


class _CameraNoise(_Result):
    """Sigmas of what the camera measured, by their names, beside these."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, _Sigma]
    factor: float | None
    views_count: int


class _TargetShape(_Result):
    shape: list[_Number]


class _Noise(_Result):
    """Sigmas by what they are of; `cameras`, `robots` and other things by name; `targets` have shapes."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, _Sigma | Annotated[list[_Sigma], Field(min_length=1)] | dict[str, dict[str, Any]]]
    cameras: dict[str, _CameraNoise] | None = None
    robots: dict[str, _RobotNoise] | None = None
    targets: dict[str, _TargetShape] | None = None


class _Settings(_Result):
    """What was asked, as it is; only what is calculated with is looked at."""

    tolerance_m: Annotated[float, Field(gt=0, le=_FARTHEST)] | None = None


class _Tolerance(_Result):
    asked_m: Annotated[float, Field(gt=0, le=_FARTHEST)]
    expected_95_m: Annotated[float, Field(ge=0)] | None
    met: bool


class _CalibrationEntry(_Result):
    verdict: Literal["good", "doubtful", "refused"]
    transforms: dict[_Name, _Transform]
    intrinsics: dict[str, _Lens] | None
    clock_offset_s: dict[str, Annotated[float, Field(ge=-_FARTHEST_S, le=_FARTHEST_S)]] | None = None
    clock_sigma_s: dict[str, Annotated[float, Field(ge=0, le=LARGEST)]] | None = None
    line_time_s: dict[str, Annotated[float, Field(ge=-LARGEST, le=LARGEST)]] | None = None
    line_time_sigma_s: dict[str, Annotated[float, Field(ge=0, le=LARGEST)]] | None = None
    noise: _Noise | None
    joint: _Joint | None
    residuals: _Residuals
    outliers: list[_Outlier] | None
    validation: _Validation | None
    observability: _Observability
    certificate: _Certificate | None
    budget: list[_BudgetEntry] | None = None
    error_map: _ErrorMap | None = None
    local: list[_LocalFit] | None = None
    findings: list[_Finding]
    tolerance: _Tolerance | None = None
    settings: _Settings | None
    inputs: dict[str, str] | None
    versions: dict[str, str] | None = None


def check_calibration(data: dict[str, Any]) -> None:
    """Nothing, when every field of the data of a `calibration.json` is there and of its kind.

    Raises:
        InputError: naming the first field that is not.
    """
    try:
        entry = _CalibrationEntry.model_validate(data)
    except ValidationError as error:
        problem = problems_of(error, _CalibrationEntry)[0]
        raise InputError(f"{field_name(problem.loc)}: {problem.message}") from None
    if (entry.clock_offset_s or {}).keys() != (entry.clock_sigma_s or {}).keys():
        raise InputError("clock_sigma_s: expected a sigma of each of clock_offset_s")
    if (entry.line_time_s or {}).keys() != (entry.line_time_sigma_s or {}).keys():
        raise InputError("line_time_sigma_s: expected a sigma of each of line_time_s")
    if entry.joint is not None and len(entry.joint.covariance) != 6 * len(entry.joint.order):
        size, count = len(entry.joint.covariance), len(entry.joint.order)
        raise InputError(f"joint.covariance: has {size} rows, expected 6 for each of {count} transforms")
