"""`identity-poses`: a robot's driver that gave nothing but the identity."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Input
from basecal.cell import Finding
from basecal.estimation.observability.motions import attached
from basecal.estimation.problem.problem import Problem
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
    still = [robot for robot, recorded in sorted(poses.items()) if all(map(_is_identity, recorded))]
    return [_finding(given.problem, robot) for robot in still]


def _is_identity(poses: SE3) -> bool:
    return bool(np.all(poses.matrix == np.eye(4)))


def _finding(problem: Problem, robot: str) -> Finding:
    message = f"all recorded poses of {robot} are the identity: is its driver connected?"
    fixed = all(problem.unknowns[name].status == "fixed" for name in attached(problem, robot))
    return Finding("identity-poses", "info" if fixed else "warning", (robot,), message)
