"""Conversion of the positions of a Yaskawa job (`.JBI`) to rows of a table.

Positions after `///RECTAN` are `C00000=X,Y,Z,Rx,Ry,Rz` [mm, deg], those after `///PULSE` are motor pulses. Their frames
are stated by `///TOOL`, `///USER` and `///POSTYPE`. Instructions follow `//INST`.
Source: Yaskawa, Relative Job Function.
"""

from __future__ import annotations

import re

from basecal.errors import DatasetError

_POSITION = re.compile(r"\s*(?:C|P|EC|BC|BP)\d+\s*=(.*)")
_FRAME = re.compile(r"///(TOOL|USER|POSTYPE)\s+(\S+)")
_NUMBERS = 6  # numbers of a position; those of external axes follow


def is_job(text: str) -> bool:
    """Whether a text is a Yaskawa job."""
    return text.lstrip("\ufeff \t\r\n").upper().startswith("/JOB")


def job_positions(text: str, path: str) -> str:
    """Convert positions to rows of six numbers on the same lines as in the job; other lines are empty.

    Raises:
        DatasetError: if a position is given in motor pulses, the positions have different frames, or there are none.
    """
    rows, form, frames = [], "", dict[str, str]()
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("//INST"):
            break
        if (frame := _FRAME.match(line)) and frames.setdefault(frame[1], frame[2]) != frame[2]:
            what = f"positions of {frame[1]} {frames[frame[1]]} and {frame[2]}: save those of each in a job of its own"
            raise DatasetError(path, what, number)
        form = line.strip("/ ").upper() if line.startswith(("///RECTAN", "///PULSE")) else form
        found = _POSITION.match(line)
        if found and form == "PULSE":
            raise DatasetError(path, "a position in pulses: save it as a relative job, which has X, Y, Z in mm", number)
        rows.append(",".join(found[1].split(",")[:_NUMBERS]) if found else "")
    if not any(rows):
        raise DatasetError(path, "a Yaskawa job without positions: expected lines such as C00000=X,Y,Z,Rx,Ry,Rz")
    return "\n".join(rows)
