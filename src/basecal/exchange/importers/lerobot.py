"""A robot's joints from an episode of LeRobot."""

from __future__ import annotations

from pathlib import Path

from basecal.errors import UsageError
from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.joint_model import joint_model
from basecal.exchange.lerobot import JointUnit, joint_rows, read_episode, read_motor_ranges


def read_lerobot(
    cell: str | Path,
    folder: str | Path,
    /,
    *,
    robot: str,
    unit: JointUnit,
    episode: int = 0,
    every_s: float = 1.0,
    calibration: Path | None = None,
    urdf: Path | None = None,
    base_link: str | None = None,
    flange_link: str | None = None,
    offset_sigma_deg: float | None = None,
) -> Imported:
    """Import a robot's joints from an episode that LeRobot recorded (v2 or v3).

    The gripper is left out, the other motors are found by the names of the
    URDF's joints, or taken in order. Samples that have times are paired by time;
    where nothing is recorded a frame a second makes a sample. Values are degrees
    (`use_degrees=true`), or normalised to -100 to 100, which needs the arm's
    calibration file. Films are not read: save their frames under their times,
    and import them by `basecal import images --by time`.

    For example:

        basecal import lerobot mycell my_dataset --robot left --unit deg \\
            --urdf so101.urdf --base-link base_link --flange-link gripper_link \\
            --offset-sigma-deg 2

    Args:
        cell: Folder of the cell.
        folder: Folder of the dataset, with meta/ and data/ in it.
        robot: Name of the robot.
        unit: What the joints are in.
        episode: Which episode.
        every_s: Time between frames that are taken [s]; 0 for all.
        calibration: LeRobot's calibration file of the arm, for normalised values.
        urdf: The robot's URDF, where the cell has none of it.
        base_link: Link of that URDF that the robot stands on.
        flange_link: Link of that URDF that is the flange.
        offset_sigma_deg: How far each joint's zero may be off, one sigma; they are then estimated with the rest.

    Raises:
        UsageError: if options do not go together, or a number is out of range.
        MissingExtra: if the library of parquet is not installed.
        InputError: if it cannot be read, or does not fit the robot.
    """
    if calibration is not None and unit != "normalised":
        raise UsageError("--calibration belongs to --unit normalised")
    if episode < 0 or not every_s >= 0:
        raise UsageError("--episode and --every-s are at least 0")
    model = joint_model(cell, robot, urdf, base_link, flange_link, offset_sigma_deg)
    ranges = None if calibration is None else read_motor_ranges(calibration)
    recorded = read_episode(Path(folder), episode)
    rows = joint_rows(recorded, robot, model.chain, unit, ranges, every_s)
    what = f"{len(rows)} of {len(recorded.stamps_s)} frames of episode {episode}: joints of {robot!r} in {unit}"
    advice = "check --unit, the calibration and the URDF"
    return Imported(str(folder), what, rows, model.entry, files=model.files, advice=advice)
