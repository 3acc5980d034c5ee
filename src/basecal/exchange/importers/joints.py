"""A robot's joints from a table."""

from __future__ import annotations

from pathlib import Path

from basecal.exchange import joints
from basecal.exchange.importing.imported import Imported
from basecal.exchange.joints import joint_model


def read_joints(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    robot: str,
    deg: bool = False,
    urdf: Path | None = None,
    base_link: str | None = None,
    flange_link: str | None = None,
    offset_sigma_deg: float | None = None,
    still: bool = False,
) -> Imported:
    """Import a robot's joints; they are checked against the limits of its URDF.

    The file is a table in the order of the URDF's joints, or with a header that
    names or numbers them (j1, q1, A1). Commas, semicolons, tabs or spaces
    separate its columns. Rows belong to the samples that are there in order,
    unless a column `image`, `sample` or `stamp_s` says otherwise. A robot that
    has no URDF in the cell yet gets it here; it is copied into the cell.

    For example:

        basecal import joints mycell --robot left joints.csv --deg \\
            --urdf left.urdf --base-link base_link --flange-link tool0
        basecal import joints mycell --robot right right.csv
        basecal import joints mycell --robot still still.csv --still

    Args:
        cell: Folder of the cell.
        file: Joints, a row for each sample.
        robot: Name of the robot.
        deg: They are in degrees; radians where not said.
        urdf: The robot's URDF, where the cell has none of it.
        base_link: Link of that URDF that the robot stands on.
        flange_link: Link of that URDF that is the flange.
        offset_sigma_deg: How far each joint's zero may be off, one sigma; they are then estimated with the rest.
        still: The robot stands still: the one row of its file is of every sample.

    Raises:
        UsageError: if options do not go together.
        InputError: if it cannot be read, or does not fit the robot's limits.
    """
    model = joint_model(cell, robot, urdf, base_link, flange_link, offset_sigma_deg)
    rows = joints.read_joints(str(file), robot, model.chain, deg)
    of_chain = f"{len(rows)} x {model.chain.n} joints of {robot!r} in {'deg' if deg else 'rad'}"
    what = f"{of_chain}: {', '.join(model.chain.joint_names)}"
    advice = "check --deg, the order of the joints and the URDF"
    return Imported(str(file), what, rows, model.entry, files=model.files, advice=advice, is_still=still)
