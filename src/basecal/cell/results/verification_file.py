"""`verifications.jsonl`: what verifications of a cell found, one a line, appended as they are made."""

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
_LARGEST_BYTES = 2**26  # 64 MB: a verification every minute of some months


def _to_utc(instant: datetime) -> datetime:
    """An instant in UTC, which it counts in if it names no zone."""
    return instant.replace(tzinfo=UTC) if instant.tzinfo is None else instant.astimezone(UTC)


@dataclass(frozen=True, eq=False)
class MeasuredShift:
    """The shift of a transform since its calibration: a right tangent, its first three numbers.

    Attributes:
        t_m: (3,) [m].
        sigma_m: (3,) [m].
    """

    t_m: Vector3
    sigma_m: Annotated[Array, array_form(Annotated[list[Length], THREE])]


@dataclass(frozen=True, eq=False)
class PastVerification:
    """A verification that was made.

    Attributes:
        when: UTC.
        run: Name of the run that was verified.
        samples: How many new samples there were.
        moved: Whether something had moved; None if it could not be determined.
        chance: Of samples so far off, where nothing moved.
        detectable_m: The shift that would have been seen [m]; None if none.
        frame: What had moved; None if nothing had.
        shifts: By requested transform, whether it moved or not.
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
    """Append a verification to those of a cell's folder.

    Raises:
        InputError: if it cannot be written.
    """
    line = _LINE.dump_json(entry, by_alias=True, warnings=False).decode()
    append_durably(Path(folder) / FILE, line + "\n", base_folder=Path(folder))


def read_verifications(folder: str | Path) -> tuple[PastVerification, ...]:
    """All verifications of a cell's folder, as they were made; none if there is no file.

    Raises:
        DatasetError: if a line cannot be read as written; a last line that was cut off is left out.
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
        raise DatasetError(path, f"{problem.message}; take the line out", number, field_name(problem.loc)) from None
