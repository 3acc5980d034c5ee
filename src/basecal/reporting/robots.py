"""What was found of the robots' own kinematics, in plain text."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from basecal.cell import Calibration
from basecal.geometry import Array, BoolArray


def robot_blocks(calibration: Calibration) -> list[list[str]]:
    """Lines of each robot's joint offsets, link errors and compliances, a heading first."""
    blocks = []
    for robot, offsets in calibration.joint_offsets.items():
        found = _by_joint(
            offsets.joints, np.degrees(offsets.rad), np.degrees(offsets.sigma_rad), offsets.seen, "deg", 4
        )
        blocks.append([f"joint offsets of {robot}, to be added to its recorded joints", *found])
    for robot, links in calibration.link_parameters.items():
        heading = f"link errors of {robot}, right tangents of each joint's origin, then of the tip"
        rows = [(_row(tangent[:3] * 1e3), _row(np.degrees(tangent[3:]))) for tangent in links.tangents]
        blocks.append([heading, *(f"  {k:<3}t {shift} mm   r {turn} deg" for k, (shift, turn) in enumerate(rows, 1))])
    for robot, of in calibration.deflection.items():
        found = _by_joint(of.joints, 1e6 * of.rad_per_nm, 1e6 * of.sigma, of.seen, "urad/Nm", 2)
        blocks.append([f"compliances of the joints of {robot} under the torque of gravity", *found])
    return blocks


def _row(values: Array) -> str:
    return "".join(f"{round(float(value), 4) + 0.0:10.4f}" for value in values)


def _by_joint(
    joints: Sequence[str], values: Array, sigmas: Array, seen: BoolArray, unit: str, digits: int
) -> list[str]:
    """A line for each joint; NaN is unobservable, and what is not seen is the prior's."""
    lines, width = [], max(map(len, joints))
    for k, (name, value, sigma, observable) in enumerate(zip(joints, values, sigmas, seen, strict=True), 1):
        found = f"{round(value, digits) + 0.0:+10.{digits}f} {unit}    sigma {sigma:.{digits}f} {unit}"
        found += "" if observable else "    prior-dominated"
        lines.append(f"  {k}  {name:<{width}}  {found if np.isfinite(value) else '      unobservable'}")
    return lines
