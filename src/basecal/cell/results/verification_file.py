"""`verifications.jsonl`: what verifications of a cell found, one a line, appended as they are made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from basecal.bounded_file import read_bounded
from basecal.cell.format.writing import append_durably
from basecal.errors import DatasetError
from basecal.geometry import Array

FILE = "verifications.jsonl"
_LARGEST_BYTES = 2**26  # 64 MB: a verification every minute of some months
_Number = Annotated[float, Field(allow_inf_nan=False)]
_Three = tuple[_Number, _Number, _Number]
_Sigmas = tuple[Annotated[_Number, Field(ge=0)], Annotated[_Number, Field(ge=0)], Annotated[_Number, Field(ge=0)]]


@dataclass(frozen=True, eq=False)
class MeasuredShift:
    """By how much a transform seemed to have moved since its calibration: a right tangent, its first three numbers.

    Attributes:
        t_m: (3,) [m].
        sigma_m: (3,) [m].
    """

    t_m: Array
    sigma_m: Array


@dataclass(frozen=True, eq=False)
class PastVerification:
    """A verification that was made.

    Attributes:
        when: UTC.
        run: Name of the run that was verified.
        samples: How many new samples there were.
        moved: Whether something had moved; None where it could not be told.
        chance: Of samples so far off, where nothing moved.
        detectable_m: The shift that would have been seen [m]; None where none.
        frame: What had moved; None where nothing had.
        shifts: By transform asked for, whether it moved or not.
    """

    when: datetime
    run: str
    samples: int
    moved: bool | None
    chance: float
    detectable_m: float | None
    frame: str | None
    shifts: Mapping[str, MeasuredShift]


class _Shift(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    t_m: _Three
    sigma_m: _Sigmas


class _Line(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    when: datetime
    run: str
    samples: Annotated[int, Field(ge=0)]
    moved: bool | None
    p: Annotated[_Number, Field(ge=0, le=1)]
    detectable_m: Annotated[_Number, Field(ge=0)] | None
    frame: str | None
    shifts: dict[str, _Shift]


def append_verification(folder: str | Path, entry: PastVerification) -> None:
    """Append a verification to those of a cell's folder.

    Raises:
        InputError: if it cannot be written.
    """
    line = {
        "when": entry.when.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "run": entry.run,
        "samples": entry.samples,
        "moved": entry.moved,
        "p": entry.chance,
        "detectable_m": entry.detectable_m,
        "frame": entry.frame,
        "shifts": {n: {"t_m": s.t_m.tolist(), "sigma_m": s.sigma_m.tolist()} for n, s in entry.shifts.items()},
    }
    append_durably(Path(folder) / FILE, json.dumps(line, allow_nan=False) + "\n", within=Path(folder))


def read_verifications(folder: str | Path) -> tuple[PastVerification, ...]:
    """All verifications of a cell's folder, as they were made; none where there is no file.

    Raises:
        DatasetError: if a line cannot be read as written; a last line that was cut off is left out.
    """
    path = Path(folder) / FILE
    if not path.exists():
        return ()
    *lines, _ = read_bounded(path, _LARGEST_BYTES).split(b"\n")
    verifications = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            said = _Line.model_validate_json(line)
        except ValidationError as error:
            first = error.errors()[0]
            field = ".".join(str(part) for part in first["loc"])
            message = f"{field or 'line'}: {first['msg'][:1].lower()}{first['msg'][1:]}; take the line out"
            raise DatasetError(str(path), message, number) from None
        when = said.when if said.when.tzinfo is not None else said.when.replace(tzinfo=UTC)
        shifts = {name: MeasuredShift(np.array(s.t_m), np.array(s.sigma_m)) for name, s in said.shifts.items()}
        verifications.append(
            PastVerification(when, said.run, said.samples, said.moved, said.p, said.detectable_m, said.frame, shifts)
        )
    return tuple(verifications)
