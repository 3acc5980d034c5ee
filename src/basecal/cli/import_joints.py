"""`basecal import joints`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import CycloptsError

from basecal.cli.imported import finish_import, robot_entry
from basecal.errors import InputError

if TYPE_CHECKING:
    from basecal.kinematics import SerialChain


def import_joints(
    cell: Path,
    file: str,
    /,
    *,
    robot: str,
    deg: bool = False,
    urdf: Path | None = None,
    base_link: str | None = None,
    flange_link: str | None = None,
) -> int:
    """Import a robot's joints; they are checked against the limits of its URDF.

    The file is a table in the order of the URDF's joints, or with a header that
    names them or numbers them (j1, q1, A1), separated by commas, semicolons, tabs
    or spaces. Rows belong to the samples that are there in order, unless a column
    `image`, `sample` or `stamp_s` says otherwise. A robot that has no URDF in the
    cell yet gets it here; it is copied into the cell.

    For example:

        basecal import joints mycell --robot left joints.csv --deg \\
            --urdf left.urdf --base-link base_link --flange-link tool0
        basecal import joints mycell --robot right right.csv

    Args:
        cell: Folder of the cell.
        file: Joints, a row for each sample.
        robot: Name of the robot.
        deg: They are in degrees; radians where not said.
        urdf: The robot's URDF, where the cell has none of it.
        base_link: Link of that URDF that the robot stands on.
        flange_link: Link of that URDF that is the flange.
    """
    from basecal.exchange.importing.imported import Imported
    from basecal.exchange.joints import read_joints

    links = (urdf, base_link, flange_link)
    if any(each is not None for each in links) and None in links:
        raise CycloptsError(msg="--urdf, --base-link and --flange-link go together: give all three")
    if urdf is not None and base_link is not None and flange_link is not None:
        chain, entry, files = _new_model(cell, robot, urdf, base_link, flange_link)
    else:
        chain, entry, files = _known_model(cell, robot), {}, {}
    rows = read_joints(file, robot, chain, deg)
    what = f"{len(rows)} x {chain.n} joints of {robot!r} in {'deg' if deg else 'rad'}: {', '.join(chain.joint_names)}"
    imported = Imported(file, what, rows, entry, files=files)
    return finish_import(cell, imported, advice="check --deg, the order of the joints and the URDF")


def _new_model(
    cell: Path, robot: str, urdf: Path, base_link: str, flange_link: str
) -> tuple[SerialChain, dict[str, Any], dict[str, Path]]:
    """The chain of a URDF, the robot's entry in `cell.yaml` and where the file goes."""
    from basecal.kinematics import read_chain

    chain = read_chain(urdf, base_link, flange_link)
    entry = robot_entry(cell, robot)
    entry["robots"] = {robot: {"urdf": urdf.name, "base_link": base_link, "flange_link": flange_link}}
    return chain, entry, {urdf.name: urdf}


def _known_model(cell: Path, robot: str) -> SerialChain:
    from basecal.cell.files import read_cell

    robots = read_cell(cell).robots if (cell / "cell.yaml").exists() else {}
    chain = robots[robot].chain if robot in robots else None
    if chain is None:
        give = "give --urdf FILE --base-link LINK --flange-link LINK"
        raise InputError(f"{cell} has no URDF of {robot!r}, which joints need: {give}")
    return chain
