"""What was found of the robots' own kinematics, in plain text."""

from __future__ import annotations

import numpy as np

from basecal.cell import Calibration, Compliances, JointOffsets, LinkParameters
from basecal.geometry import Array


def robot_blocks(calibration: Calibration) -> list[list[str]]:
    """Lines of each robot's joint offsets, link errors and compliances, a heading first."""
    return [
        *(_joint_offsets(robot, of) for robot, of in calibration.joint_offsets.items()),
        *(_links(robot, of) for robot, of in calibration.link_parameters.items()),
        *(_compliances(robot, of) for robot, of in calibration.deflection.items()),
    ]


def _row(values: Array) -> str:
    return "".join(f"{round(float(value), 4) + 0.0:10.4f}" for value in values)


def _joint_offsets(robot: str, offsets: JointOffsets) -> list[str]:
    width = max(map(len, offsets.joints))
    rows = zip(offsets.joints, np.degrees(offsets.rad), np.degrees(offsets.sigma_rad), offsets.seen, strict=True)
    lines = [
        f"  {k}  {name:<{width}}  {_offset(value, sigma, observable)}"
        for k, (name, value, sigma, observable) in enumerate(rows, 1)
    ]
    return [f"joint offsets of {robot}, to be added to its recorded joints", *lines]


def _offset(value: float, sigma: float, observable: bool) -> str:
    if not np.isfinite(value):
        return "      unobservable"
    return f"{round(value, 4) + 0.0:+10.4f} deg    sigma {sigma:.4f} deg{'' if observable else '    prior-dominated'}"


def _links(robot: str, links: LinkParameters) -> list[str]:
    lines = [
        f"  {k:<3}t {_row(tangent[:3] * 1e3)} mm   r {_row(np.degrees(tangent[3:]))} deg"
        for k, tangent in enumerate(links.tangents, 1)
    ]
    return [f"link errors of {robot}, right tangents of each joint's origin, then of the tip", *lines]


def _compliances(robot: str, of: Compliances) -> list[str]:
    width = max(map(len, of.joints))
    rows = zip(of.joints, 1e6 * of.rad_per_nm, 1e6 * of.sigma, of.seen, strict=True)
    lines = [
        f"  {k}  {name:<{width}}  {_compliance(value, sigma, observable)}"
        for k, (name, value, sigma, observable) in enumerate(rows, 1)
    ]
    return [f"compliances of the joints of {robot} under the torque of gravity", *lines]


def _compliance(value: float, sigma: float, observable: bool) -> str:
    if not np.isfinite(value):
        return "      unobservable"
    return f"{value:+10.2f} urad/Nm    sigma {sigma:.2f} urad/Nm{'' if observable else '    prior-dominated'}"
