"""`identity-poses`: a robot's driver that gave nothing but the identity."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Input
from basecal.cell import Finding
from basecal.estimation.observability.motions import attached
from basecal.geometry import SE3


def identity_poses(given: Input) -> list[Finding]:
    """About each robot whose recorded poses are all the identity, exactly; joints are never that.

    An info where all that the robot carries is fixed: it may stand for something that never moves.
    """
    poses: dict[str, list[SE3]] = {}
    for group in given.problem.groups:
        ends = (
            (group.eye, group.eye_joints, group.eye_base_from_eye_flange),
            (group.hand, group.hand_joints, group.hand_base_from_hand_flange),
        )
        for robot, joints, recorded in ends:
            if robot is not None and joints is None:
                poses.setdefault(robot, []).append(recorded)
    findings = []
    for robot, of_robot in sorted(poses.items()):
        if all(np.all(each.matrix == np.eye(4)) for each in of_robot):
            fixed = all(given.problem.unknowns[name].status == "fixed" for name in attached(given.problem, robot))
            what, do = (
                f"All recorded poses of {robot} are the identity.",
                (f"Check that the driver of {robot} is connected.",),
            )
            findings.append(Finding("identity-poses", "info" if fixed else "warning", (robot,), what, do))
    return findings
