"""Reading and writing of `cell.yaml`; reading reports all errors at once."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from basecal.cell.cell import WORLD, Cell, grip_name
from basecal.cell.format.paths import own_file, path_resolver
from basecal.cell.format.writing import write_atomically
from basecal.cell.format.yaml_text import parse_yaml, read_text, yaml_text
from basecal.cell.schema.cell_dict import cell_to_dict
from basecal.cell.schema.cell_objects import cell_from_entry
from basecal.cell.schema.cell_schema import SCHEMA, CellEntry
from basecal.cell.schema.errors import check_schema, collect_problems
from basecal.cell.schema.touching import clamp_names, mark_names
from basecal.errors import BasecalError, InputError, check_type, spelling_hint
from basecal.fields.problems import SHORT_LENGTH, Loc, Problem, dataset_error, shorten
from basecal.kinematics import SerialChain, read_chain

FILE = "cell.yaml"
_OTHER_NAMES = ("cell.yml", "Cell.yaml", "cell.yaml.txt", "cell.json")
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_SECTIONS = ("robots", "cameras", "targets", "tips", "marks")


def read_cell(folder: str | Path) -> Cell:
    """Read the cell from `cell.yaml` in a folder.

    Raises:
        DatasetError: if the file is missing or invalid; the message has a line for each error.
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
    """Create a cell from the data of a `cell.yaml`.

    Args:
        data: Mappings, lists and scalars.
        path: Name of the data in errors.
        folder: Folder of the URDF files; not needed without URDF files.

    Raises:
        DatasetError: if the data are invalid; the message has a line for each error.
    """
    return _check_cell(data, path, None if folder is None else Path(folder), {})


def write_cell(cell: Cell, folder: str | Path) -> Path:
    """Write `cell.yaml` into a folder, replacing an existing one, and return its path.

    URDF files are referenced, not copied.

    Raises:
        InputError: if the argument is not a cell, or the file cannot be written.
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
    return cell_from_entry(entry, chains)


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
    path = folder / path_resolver(str(folder))(urdf)
    if not path.is_file():
        raise InputError(f"there is no file {urdf!r} in the cell; copy the URDF into it")
    return read_chain(path, base_link, flange_link, folder)


def name_problems(data: dict[str, Any]) -> list[Problem]:
    """Problems of the names in the data of a cell."""
    return [*_invalid_names(data), *_unknown_robots(data)]


def _section(data: dict[str, Any], name: str) -> dict[str, Any]:
    section = data.get(name)
    return section if isinstance(section, dict) else {}


def _invalid_names(data: dict[str, Any]) -> Iterator[Problem]:
    robots = _section(data, "robots")
    owners = {f"{robot}_{end}": f"a frame of {robot!r}" for robot in robots for end in ("base", "flange")}
    named = [(section, name) for section in _SECTIONS for name in _section(data, section)]
    named += [("marks", name) for _, name in mark_names(data)]
    named += [("clamp", each) for name, _ in clamp_names(data) for each in (name, grip_name(name))]
    for section, name in named:
        if not (isinstance(name, str) and _NAME.fullmatch(name)) or "_from_" in name or "_in_" in name:
            expected = "expected a name of a-z, 0-9 and _, a letter first, without _from_ or _in_"
            yield Problem((section, name), f"{expected}; rename {shorten(name)}")
        elif name == WORLD:
            yield Problem((section, name), f"{WORLD!r} is the base of the reference robot; choose another name")
        if name in owners:
            yield Problem((section, name), f"the name {name!r} is taken by {owners[name]}; names are unique")
        owners[name] = f"{section}.{name}"


def _unknown_robots(data: dict[str, Any]) -> Iterator[Problem]:
    reference, robots = data.get("reference"), list(_section(data, "robots"))
    carriers = [*robots, WORLD]
    if isinstance(reference, str) and reference not in robots:
        yield Problem(("reference",), _no_robot(reference, robots))
    for section in ("cameras", "targets", "tips"):
        for name, entry in _section(data, section).items():
            on = entry.get("on") if isinstance(entry, dict) else None
            known = robots if section == "tips" else carriers
            if isinstance(on, str) and on not in known:
                yield Problem((section, name, "on"), _no_robot(on, known))
    for name, entry in clamp_names(data):
        holders = entry.get("robots") if isinstance(entry, dict) else None
        for robot in holders if isinstance(holders, list) else ():
            if isinstance(robot, str) and robot not in robots:
                yield Problem(("clamp", name, "robots"), _no_robot(robot, robots))
    for name in _section(data, "bases"):
        if name not in robots:
            yield Problem(("bases", name), _no_robot(name, robots))
        elif name == reference:
            yield Problem(("bases", name), f"the base of the reference {name!r} is `world` itself; remove it")


def _no_robot(name: str, robots: list[str]) -> str:
    names = ", ".join(map(str, robots)) or "none"
    return f"no robot {shorten(name)}{spelling_hint(str(name)[:SHORT_LENGTH], robots)}; there are: {names}"
