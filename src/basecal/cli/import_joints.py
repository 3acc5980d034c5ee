"""`basecal import joints`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.imported import finish_import
from basecal.cli.joint_model import SigmaDeg, joint_model, with_offsets


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
    offset_sigma_deg: SigmaDeg | None = None,
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
        offset_sigma_deg: How far each joint's zero may be off, one sigma; they are then estimated with the rest.
    """
    from basecal.exchange.importing.imported import Imported
    from basecal.exchange.joints import read_joints

    chain, entry, files = joint_model(cell, robot, urdf, base_link, flange_link)
    entry = with_offsets(entry, robot, offset_sigma_deg)
    rows = read_joints(file, robot, chain, deg)
    what = f"{len(rows)} x {chain.n} joints of {robot!r} in {'deg' if deg else 'rad'}: {', '.join(chain.joint_names)}"
    imported = Imported(file, what, rows, entry, files=files)
    return finish_import(cell, imported, advice="check --deg, the order of the joints and the URDF")
