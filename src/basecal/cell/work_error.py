"""The error where the work is done: of meetings, by source, over the workspace, and against a tolerance."""

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
"""The places at which an error is expected: those of the task that is named, or where the arms worked."""


@dataclass(frozen=True)
class BudgetEntry:
    """The part of one source in the error at the task.

    Attributes:
        source: In words, with the name of what it is of.
        rms_m: Root of the variance that comes of it [m]; those of all sources add up in squares.
        share: Of the whole variance.
        halved_rms_m: What the whole error would be with the source's sigma half as large [m].
    """

    source: str
    rms_m: Annotated[float, Field(alias="mm"), number_form(Length, 1e3)]
    share: Annotated[float, Field(alias="percent"), number_form(Real, 100.0)]
    halved_rms_m: Annotated[float, Field(alias="total_mm_if_halved"), number_form(Length, 1e3)]


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """The error to be expected where two robots meet.

    Attributes:
        points_m: (n, 3) in the reference's base [m].
        length_95_m: (n,) the distance that 95 of 100 errors stay below [m].
        angle_95_rad: (n,) likewise the angle [rad].
    """

    points_m: Annotated[Array, array_form(list[Annotated[list[Number], THREE]], shape=(-1, 3))]
    length_95_m: Annotated[Array, Field(alias="mm_95"), array_form(list[Length], 1e3)]
    angle_95_rad: Annotated[Array, Field(alias="deg_95"), array_form(list[Length], math.degrees(1))]

    @property
    def worst(self) -> int:
        """The row with the longest error."""
        return int(self.length_95_m.argmax())


@dataclass(frozen=True, eq=False)
class LocalFit:
    """A part of the workspace, calibrated separately.

    Attributes:
        centre_m: (3,) its middle in the reference's base [m].
        samples: Numbers of the samples in it.
        global_m: Root of the mean square of where targets of held-out samples in it are off, by the fit of all [m].
        local_m: Likewise by a fit to which samples far from its middle count little; None, both, where one has no end.
        chance: Of a local fit so far from that of all where there is noise alone.
        is_better: Whether the local fit is recommended there.
        transforms: The requested ones, by the local fit of all samples.
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
    """The error of one flange against another where the work is done: base, joints, links and stops together.

    Attributes:
        expected_95_m: The distance that 95 of 100 meetings stay below [m].
        where: At the task named, or where targets were seen.
        sigma_m: 1 sigma per axis, root of the mean square over places and axes [m].
    """

    expected_95_m: Length
    where: PlaceKind
    sigma_m: Length

    @property
    def variance_m2(self) -> float:
        """The mean square of the distance [m^2]."""
        return 3 * self.sigma_m**2


@dataclass(frozen=True)
class Tolerance:
    """Whether the error at the work is as small as is needed.

    Attributes:
        asked_m: What is needed [m].
        expected_95_m: The distance that 95 of 100 meetings stay below [m]. If nothing meets, it is that of the position
            errors of the requested transforms; None if these were not found.
        met: Whether that is within the tolerance and the verdict is good, without which it proves nothing.
    """

    asked_m: Annotated[Length, Field(gt=0)]
    expected_95_m: Error
    met: Flag

    @property
    def is_within(self) -> bool:
        """Whether the expected error is within the tolerance, whatever the verdict."""
        return self.expected_95_m is not None and self.expected_95_m <= self.asked_m
