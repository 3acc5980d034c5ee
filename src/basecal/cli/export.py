"""`basecal export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from basecal.errors import FrameNotFound, InputError

if TYPE_CHECKING:
    from basecal.cell import Calibration, Cell
    from basecal.geometry import Array


def export(cell: Path, /, *, urdf: str, output: Annotated[Path, Parameter(alias="-o")]) -> int:
    """Write the latest calibration for another program.

    The URDF of a robot is written with its joint offsets and link errors in
    the origins of its joints: at the joints that the robot records, its
    flange then is where the calibrated one is. All else stays as it is.

    For example:

        basecal export mycell --urdf hand -o hand_corrected.urdf

    Args:
        cell: Folder of the cell.
        urdf: Name of the robot whose URDF to correct.
        output: File to write.
    """
    from basecal.cell.files import latest_run, read_calibration, read_cell
    from basecal.cell.format.paths import write_whole
    from basecal.exchange.urdf import corrected_urdf

    described, run = read_cell(cell), latest_run(cell)
    if run is None:
        raise InputError(f"{cell} has no run yet: basecal calibrate {cell}")
    name, base_link, flange_link = _urdf_of(described, urdf)
    text = (cell / name).read_bytes()
    offsets, links = _found(read_calibration(run), urdf)
    write_whole(output, corrected_urdf(text, base_link, flange_link, offsets, links))
    print(f"written: {output}")
    return 0


def _urdf_of(cell: Cell, robot: str) -> tuple[str, str, str]:
    if robot not in cell.robots:
        raise FrameNotFound(robot, list(cell.robots))
    of = cell.robots[robot]
    if of.urdf is None or of.base_link is None or of.flange_link is None:
        raise InputError(f"robot {robot!r} has no urdf in cell.yaml: there is nothing to correct")
    return of.urdf, of.base_link, of.flange_link


def _found(calibration: Calibration, robot: str) -> tuple[Array | None, Array | None]:
    """Offsets, those that nothing is known of as zero, and link errors."""
    import numpy as np

    offsets, links = calibration.joint_offsets.get(robot), calibration.link_parameters.get(robot)
    if offsets is None and links is None:
        raise InputError(
            f"the latest calibration has no joint offsets of {robot!r}: "
            "write `joint_offsets: {status: prior, sigma_rad: 0.005}` there in cell.yaml and calibrate again"
        )
    return None if offsets is None else np.nan_to_num(offsets.rad), None if links is None else links.tangents
