"""Import of a robot's joints from a table."""

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
    separate its columns. Rows are assigned to the existing samples in order,
    unless a column `image`, `sample` or `stamp_s` assigns them. If the cell has
    no URDF of the robot, give it here; it is copied into the cell.

    For example:

        basecal import joints mycell --robot left joints.csv --deg \\
            --urdf left.urdf --base-link base_link --flange-link tool0
        basecal import joints mycell --robot right right.csv
        basecal import joints mycell --robot still still.csv --still

    Args:
        cell: Folder of the cell.
        file: Joints, one row per sample.
        robot: Name of the robot.
        deg: Joints are in degrees; by default in radians.
        urdf: The robot's URDF, if the cell has none.
        base_link: Base link of the robot in that URDF.
        flange_link: Flange link of the robot in that URDF.
        offset_sigma_deg: Sigma of each joint's offset [deg]; the offsets are then estimated.
        still: The robot is at rest: the single row of its file belongs to every sample.

    Raises:
        UsageError: if options are inconsistent.
        InputError: if the file cannot be read, or joints exceed the robot's limits.
    """
    model = joint_model(cell, robot, urdf, base_link, flange_link, offset_sigma_deg)
    rows = joints.read_joints(str(file), robot, model.chain, deg)
    joints_text = f"{len(rows)} x {model.chain.n} joints of {robot!r} in {'deg' if deg else 'rad'}"
    what = f"{joints_text}: {', '.join(model.chain.joint_names)}"
    advice = "check --deg, the order of the joints and the URDF"
    return Imported(str(file), what, rows, model.entry, files=model.files, advice=advice, is_still=still)
