"""`verifications.jsonl`: append-only log of a cell's verifications, one per line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, ClassVar

from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError

from basecal.bounded_file import read_bounded
from basecal.cell.format.writing import append_durably
from basecal.cell.schema.errors import collect_problems
from basecal.errors import DatasetError
from basecal.fields.file_forms import THREE, Error, Flag, Length, Vector3, Whole, array_form
from basecal.fields.problems import field_name
from basecal.geometry import Array

FILE = "verifications.jsonl"
_LARGEST_BYTES = 2**26  # 64 MB: one verification per minute for several months


def _to_utc(instant: datetime) -> datetime:
    """Convert a time to UTC; a time without a zone is taken as UTC."""
    return instant.replace(tzinfo=UTC) if instant.tzinfo is None else instant.astimezone(UTC)


@dataclass(frozen=True, eq=False)
class MeasuredShift:
    """Translation of a transform since its calibration: the first three numbers of the right tangent.

    Attributes:
        t_m: (3,) translation [m].
        sigma_m: (3,) sigmas of the translation [m].
    """

    t_m: Vector3
    sigma_m: Annotated[Array, array_form(Annotated[list[Length], THREE])]


@dataclass(frozen=True, eq=False)
class PastVerification:
    """Result of a past verification.

    Attributes:
        when: Time of the verification in UTC.
        run: Name of the verified run.
        samples: Number of new samples.
        moved: Whether something had moved; None if it could not be determined.
        chance: p-value: probability of residuals this large if nothing moved.
        detectable_m: Smallest detectable shift [m]; None if no shift is detectable.
        frame: Name of the moved frame; None if nothing moved.
        shifts: Measured shifts of all requested transforms, by name.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", allow_inf_nan=False, defer_build=True)
    when: Annotated[datetime, AfterValidator(_to_utc)]
    run: str
    samples: Annotated[Whole, Field(ge=0)]
    moved: Flag | None
    chance: Annotated[float, Field(alias="p", strict=True, ge=0, le=1)]
    detectable_m: Error
    frame: str | None
    shifts: Mapping[str, MeasuredShift]


_LINE = TypeAdapter(PastVerification)


def append_verification(folder: str | Path, entry: PastVerification) -> None:
    """Append a verification to the log of a cell.

    Raises:
        InputError: if the log cannot be written.
    """
    line = _LINE.dump_json(entry, by_alias=True, warnings=False).decode()
    append_durably(Path(folder) / FILE, line + "\n", base_folder=Path(folder))


def read_verifications(folder: str | Path) -> tuple[PastVerification, ...]:
    """Read all verifications of a cell in chronological order; empty if there is no log.

    An incomplete last line is left out.

    Raises:
        DatasetError: if a line is invalid.
    """
    path = Path(folder) / FILE
    if not path.exists():
        return ()
    *lines, _ = read_bounded(path, _LARGEST_BYTES).split(b"\n")
    return tuple(_read(line, str(path), number) for number, line in enumerate(lines, start=1) if line.strip())


def _read(line: bytes, path: str, number: int) -> PastVerification:
    try:
        return _LINE.validate_json(line)
    except ValidationError as error:
        problem = collect_problems(error, _LINE)[0]
        raise DatasetError(path, f"{problem.message}; remove the line", number, field_name(problem.loc)) from None
