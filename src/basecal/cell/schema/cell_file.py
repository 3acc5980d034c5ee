"""`cell.yaml`: read with every error at once, and written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from basecal.cell.cell import Cell
from basecal.cell.format.paths import inside, own_file
from basecal.cell.format.writing import write_atomically
from basecal.cell.format.yaml_text import parse_yaml, read_text, yaml_text
from basecal.cell.schema.cell_dict import cell_to_dict
from basecal.cell.schema.cell_nouns import cell_noun
from basecal.cell.schema.cell_schema import SCHEMA, CellEntry
from basecal.cell.schema.errors import check_schema, collect_problems
from basecal.cell.schema.names import name_problems
from basecal.errors import BasecalError, InputError, check_type
from basecal.fields.problems import Loc, Problem, dataset_error
from basecal.kinematics import SerialChain, read_chain

FILE = "cell.yaml"
_OTHER_NAMES = ("cell.yml", "Cell.yaml", "cell.yaml.txt", "cell.json")


def read_cell(folder: str | Path) -> Cell:
    """The cell that `cell.yaml` in a folder describes.

    Raises:
        DatasetError: if it cannot be read as written; the message has a line for each mistake.
    """
    path = own_file(folder, FILE)
    document = parse_yaml(read_text(path, _missing_cell_advice(Path(folder))), str(path))
    return _check_cell(document.data, str(path), Path(folder), document.lines)


def _missing_cell_advice(folder: Path) -> str:
    """Advice for a folder without a cell."""
    other = next((name for name in _OTHER_NAMES if (folder / name).is_file()), None)
    if other is not None:
        return f"there is {other}: rename it {FILE}"
    if (folder.parent / FILE).is_file():
        return f"there is one in {folder.parent}: give that folder"
    return f"a cell is a folder with a {FILE} (docs/data_format.md): basecal new makes one"


def cell_from_dict(data: Any, path: str = FILE, folder: str | Path | None = None) -> Cell:
    """The cell that the data of a `cell.yaml` describes.

    Args:
        data: Mappings, lists and scalars.
        path: What to call it in an error.
        folder: Where its URDF files are; not needed where robots have none.

    Raises:
        DatasetError: if it cannot be read as written; the message has a line for each mistake.
    """
    return _check_cell(data, path, None if folder is None else Path(folder), {})


def write_cell(cell: Cell, folder: str | Path) -> Path:
    """Path of the `cell.yaml` written into a folder, in place of one that is there.

    URDF files are named, not copied.

    Raises:
        InputError: if it is no cell, or cannot be written.
    """
    check_type("cell", cell, Cell)
    path = Path(folder) / FILE
    write_atomically(path, yaml_text(cell_to_dict(cell)))
    return path


def _check_cell(data: Any, path: str, folder: Path | None, lines: Mapping[Loc, int]) -> Cell:
    problems = name_problems(check_schema(data, SCHEMA, path, lines))
    try:
        entry = CellEntry.model_validate(data)
    except ValidationError as error:
        problems += collect_problems(error, CellEntry)
    chains, urdf_problems = _chains(data.get("robots"), folder)
    problems += urdf_problems
    if problems:
        raise dataset_error(path, problems, lines)
    return cell_noun(entry, chains)


def _chains(robots: Any, folder: Path | None) -> tuple[dict[str, SerialChain], list[Problem]]:
    chains: dict[str, SerialChain] = {}
    problems: list[Problem] = []
    for name, robot in robots.items() if isinstance(robots, dict) else ():
        parts = [robot.get(key) for key in ("urdf", "base_link", "flange_link")] if isinstance(robot, dict) else [None]
        if not all(part and isinstance(part, str) for part in parts):
            continue
        try:
            chains[name] = _chain(folder, *parts)
        except BasecalError as error:
            problems.append(Problem(("robots", name, "urdf"), str(error)))
    return chains, problems


def _chain(folder: Path | None, urdf: str, base_link: str, flange_link: str) -> SerialChain:
    if folder is None:
        raise InputError("a URDF is looked for in the cell's folder; give `folder`")
    path = folder / inside(str(folder))(urdf)
    if not path.is_file():
        raise InputError(f"there is no file {urdf!r} in the cell; copy the URDF into it")
    return read_chain(path, base_link, flange_link, folder)
