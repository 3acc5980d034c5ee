"""The error at the work: between flanges, by source, over the workspace, and compared with a tolerance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from basecal.fields.file_forms import (
    THREE,
    Error,
    Flag,
    Length,
    Number,
    Pose,
    Real,
    Vector3,
    Whole,
    array_form,
    as_written,
    number_form,
)
from basecal.geometry import Array

_BETTER_VERDICT = as_written(
    Literal["local", "global"], lambda best: best == "local", lambda is_better: "local" if is_better else "global"
)

PlaceKind = Literal["task point", "task box", "recorded places"]
"""Places at which the error is evaluated: those of the named task, or the recorded ones."""


@dataclass(frozen=True)
class BudgetEntry:
    """Contribution of one source to the error at the task.

    Attributes:
        source: The source in words, with the name of the robot, camera or target.
        rms_m: Rms contribution of the source [m]; the squares of all contributions add up to the variance.
        share: Share of the total variance.
        halved_rms_m: Total rms error if the source's sigma were half as large [m].
    """

    source: str
    rms_m: Annotated[float, Field(alias="mm"), number_form(Length, 1e3)]
    share: Annotated[float, Field(alias="percent"), number_form(Real, 100.0)]
    halved_rms_m: Annotated[float, Field(alias="total_mm_if_halved"), number_form(Length, 1e3)]


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """Expected error between two robots over the workspace.

    Attributes:
        points_m: (n, 3) points in the reference's base [m].
        length_95_m: (n,) 95 % quantile of the distance error [m].
        angle_95_rad: (n,) 95 % quantile of the angle error [rad].
    """

    points_m: Annotated[Array, array_form(list[Annotated[list[Number], THREE]], shape=(-1, 3))]
    length_95_m: Annotated[Array, Field(alias="mm_95"), array_form(list[Length], 1e3)]
    angle_95_rad: Annotated[Array, Field(alias="deg_95"), array_form(list[Length], math.degrees(1))]

    @property
    def worst(self) -> int:
        """Index of the point with the largest distance error."""
        return int(self.length_95_m.argmax())


@dataclass(frozen=True, eq=False)
class LocalFit:
    """A part of the workspace, calibrated separately.

    Attributes:
        centre_m: (3,) centre of the part in the reference's base [m].
        samples: Numbers of the samples in the part.
        global_m: Rms target position error of the part's held-out samples with the global fit [m].
        local_m: Rms error of the same samples with a local fit, which down-weights samples far from the centre [m].
            Both errors are None if one of the fits does not converge.
        chance: p-value: probability of a local fit this different from the global fit under noise alone.
        is_better: Whether the local fit is recommended in this part.
        transforms: Requested transforms from the local fit of all samples.
    """

    centre_m: Vector3
    samples: tuple[Whole, ...]
    global_m: Annotated[float | None, Field(alias="global_mm"), number_form(Length | None, 1e3)]
    local_m: Annotated[float | None, Field(alias="local_mm"), number_form(Length | None, 1e3)]
    chance: Annotated[Number, Field(alias="p")]
    is_better: Annotated[bool, Field(alias="recommended"), _BETTER_VERDICT]
    transforms: Mapping[str, Pose]


@dataclass(frozen=True)
class MeetingError:
    """The error of one flange relative to another at the work: base, joints, links and stops together.

    Attributes:
        expected_95_m: 95 % quantile of the distance error [m].
        where: Places of evaluation: the named task, or the recorded places.
        sigma_m: 1 sigma per axis, rms over places and axes [m].
    """

    expected_95_m: Length
    where: PlaceKind
    sigma_m: Length

    @property
    def variance_m2(self) -> float:
        """Mean squared distance error [m^2]."""
        return 3 * self.sigma_m**2


@dataclass(frozen=True)
class Tolerance:
    """Comparison of the error at the work with the tolerance.

    Attributes:
        asked_m: The tolerance [m].
        expected_95_m: 95 % quantile of the distance error between flanges [m]. Without two flanges to compare, it is
            that of the position errors of the requested transforms; None if these were not estimated.
        met: Whether the expected error is within the tolerance and the verdict is `good`.
    """

    asked_m: Annotated[Length, Field(gt=0)]
    expected_95_m: Error
    met: Flag

    @property
    def is_within(self) -> bool:
        """Whether the expected error is within the tolerance, regardless of the verdict."""
        return self.expected_95_m is not None and self.expected_95_m <= self.asked_m
