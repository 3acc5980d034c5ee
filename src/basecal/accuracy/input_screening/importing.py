"""Import of rows into a cell, with a check for implausible input.

`benchmarks.slips` judges its limits.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace as dataclass_replace
from pathlib import Path

import numpy as np

from basecal.accuracy.input_check.plausibility import UNITS_M, impossible_input
from basecal.cell import Cell, Recording
from basecal.errors import DatasetError, InputError, list_names
from basecal.exchange.importing.bring_in import ImportResult, add_to_cell
from basecal.exchange.importing.imported import Imported

# Limits of the distance of a flange over the usual one, and of the inverse: inches among metres are 39 times farther,
# and metres among millimetres 1000 times nearer.
_FARTHER_RATIO, _NEARER_RATIO = 20, 200
_UNITS = {"millimetres": "mm", "centimetres": "cm", "inches": "inch"}
_USUAL_RATIO = 2  # most distances of a robot's flange are within this factor of the usual one


def import_into(cell: str | Path, imports: Imported, *, replace: bool = False, session: bool = False) -> ImportResult:
    """Import the rows of an importer into a cell's folder; if this fails, the folder is unchanged.

    Args:
        cell: The folder; the cell is created if there is none.
        imports: Data read for this cell, such as by `basecal.read_poses`.
        replace: Whether to replace recorded data; the previous files are kept in `originals`.
        session: Whether to add new samples, such as of a recording on another day.

    Raises:
        InputError: if the data are implausible, do not fit the cell, or would overwrite recorded data.
    """
    if not isinstance(imports, Imported):
        raise InputError(f"expected what an importer read, such as basecal.read_poses, got {imports!r}")
    imports = dataclass_replace(imports, is_session=session or imports.is_session)
    if imports.is_preview:
        raise InputError(f"{imports.source} was only listed: read it without list=True to import it")

    def implausible(cell: Cell, recording: Recording) -> tuple[str, ...]:
        """Describe implausible input in one line; empty if all input is plausible."""
        if (error := next(_unit_errors(imports), None)) is not None:
            if imports.is_strict:
                raise error
            return (str(error),)
        found = impossible_input(cell, recording)
        problem_text = f"{imports.source}: {'; '.join(found)}: implausible"
        if found and imports.is_strict:
            raise InputError(f"{problem_text}, nothing is imported; {imports.advice}")
        return (f"{problem_text}; {imports.advice}",) if found else ()

    try:
        return add_to_cell(Path(cell), imports, implausible, replace)
    finally:
        if imports.scratch is not None:
            imports.scratch.cleanup()


def _unit_errors(imports: Imported) -> Iterator[DatasetError]:
    """An error for each robot with a few rows in another length unit than most."""
    has_lines = all(row.line is not None for row in imports.rows)
    for robot in dict.fromkeys(name for row in imports.rows for name in row.robots):
        states = [(row.line or k, row.robots.get(robot)) for k, row in enumerate(imports.rows, start=1)]
        poses = [(number, state.base_from_flange) for number, state in states if state is not None]
        places = [(number, float(np.linalg.norm(pose.translation))) for number, pose in poses if pose is not None]
        usual = float(np.median([distance for _, distance in places])) if places else 0.0
        few = [(n, far) for n, far in places if far > _FARTHER_RATIO * usual > 0 or 0 < far < usual / _NEARER_RATIO]
        if few:
            what = f"flange of {robot} {few[0][1]:.3g} m from its base, {usual:.3g} m in most rows"
            place = ("line" if has_lines else "row") + "s" * (len(few) > 1)
            names = f"{place} {list_names([str(number) for number, _ in few])}"
            do = _describe_cure(names, few[0][1] / usual) + ("; nothing is imported" if imports.is_strict else "")
            yield DatasetError(imports.source, f"{what}: {do}", few[0][0] if has_lines else None)


def _describe_cure(names: str, ratio: float) -> str:
    """Advice on rows whose distance is `ratio` times the usual one, with their likely unit."""
    likely = [name for name, unit in _UNITS.items() if 1 / _USUAL_RATIO < ratio * UNITS_M[unit] < _USUAL_RATIO]
    if len(likely) != 1:
        return f"another length unit? Correct {names}"
    return f"{names} look like {likely[0]}, divide their lengths by {1 / UNITS_M[_UNITS[likely[0]]]:.4g}"
