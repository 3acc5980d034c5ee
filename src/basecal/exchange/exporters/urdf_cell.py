"""Export of one URDF of all robots of a cell, each at its estimated pose."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from pathlib import Path

from basecal.bounded_file import read_bounded
from basecal.cell import Cell
from basecal.errors import InputError, count_text
from basecal.exchange.exporters.urdf import applied_kinds, corrected_text
from basecal.exchange.exports.exporter import Exporter, ExportRequest, comments
from basecal.exchange.urdf import RobotPart, link_names, merged_urdf
from basecal.kinematics.urdf import LARGEST_BYTES, joint_origins


def export_text(request: ExportRequest) -> str:
    """Merge one URDF per robot: the given ones in the order of cell.yaml, or those of the cell.

    Base poses are valid together with the estimated joint offsets and link errors. They are therefore applied to URDFs
    of the cell; a comment names given URDFs without them.

    A robot's base link is `base_link` in cell.yaml, or the base of its `frames`, or the root of its URDF.

    Raises:
        FrameNotFound: if a base link does not exist.
        InputError: if the numbers of URDFs and robots differ, one URDF holds two robots, or the pose of a base is
            unknown.
        DatasetError: if a URDF cannot be used.
    """
    cell = request.cell
    if cell is None or request.folder is None:
        raise InputError("a URDF of a cell needs the cell and its folder")
    own_paths = [request.folder / robot.urdf for robot in cell.robots.values() if robot.urdf is not None]
    paths = list(request.urdfs) or own_paths
    if len(paths) != len(cell.robots):
        robots = ", ".join(cell.robots)
        count = f"{count_text(len(paths), 'URDF')} for {count_text(len(cell.robots), 'robot')}"
        raise InputError(f"{count}: give one each, --urdf for {robots}")
    parts, corrections = {}, {}
    for robot, path in zip(cell.robots.values(), paths, strict=True):
        text, corrections[robot.name] = _robot_text(request, robot.name, path)
        base_link = robot.base_link or robot.frames.get("base")
        if base_link is None:
            child_links = joint_origins(text, str(path))
            base_link = next(link for link in link_names(text) if link not in child_links)
        parts[robot.name] = RobotPart(text, base_link, str(path))
    _check_separate(cell, parts)
    known = request.calibration.known_transforms(cell)
    others = [name for name in cell.robots if name != cell.reference]
    for name in others:
        if cell.base_name(name) not in known:
            raise InputError(f"the pose of {name!r} is unknown: there is no {cell.base_name(name)}")
    bases = {name: known[cell.base_name(name)] for name in others}
    notes = [
        f"{name}: {Path(part.path).name}, its base is the link {part.base_link}{corrections[name]}"
        for name, part in parts.items()
    ]
    return merged_urdf(parts, cell.reference, bases, comments([*request.remarks, *notes], ""))


def _check_separate(cell: Cell, parts: Mapping[str, RobotPart]) -> None:
    """Raise InputError if one URDF holds several robots: it would be merged as often as there are robots."""
    flanges = {name: robot.flange_link or robot.frames.get("flange") for name, robot in cell.robots.items()}
    for (name, part), (other, second) in combinations(parts.items(), 2):
        first_link, second_link = flanges[name], flanges[other]
        if part.path != second.path or first_link is None or second_link is None:
            continue
        if first_link not in _ancestor_links(part, second_link) and second_link not in _ancestor_links(
            part, first_link
        ):
            raise InputError(
                f"{part.path} holds both {name} and {other}: with --to urdf_joint --urdf {part.path} "
                "the joint between them is set in it"
            )


def _ancestor_links(part: RobotPart, link: str) -> list[str]:
    """A link and those above it, up to the root."""
    joints, links = joint_origins(part.text, part.path), [link]
    while links[-1] in joints:
        links.append(joints[links[-1]].parent)
    return links


def _robot_text(request: ExportRequest, name: str, path: Path) -> tuple[bytes, str]:
    """A robot's URDF, corrected if it is the cell's own, and a remark about the correction."""
    cell, folder = request.cell, request.folder
    assert cell is not None
    assert folder is not None
    kinds = applied_kinds(request.calibration, name)
    if kinds and path not in request.urdfs:
        return corrected_text(cell, folder, request.calibration, name).encode(), f"; {kinds} applied"
    text = read_bounded(path, LARGEST_BYTES)
    is_applied = f"{kinds} applied".encode() in text
    return text, "" if not kinds else f"; {kinds} applied" if is_applied else f"; {kinds} are not in it"


EXPORTER = Exporter(
    "one URDF of all robots, each at its estimated base and corrected; with --urdf FILE... made of these files",
    export_text,
    options=("urdf",),
)
