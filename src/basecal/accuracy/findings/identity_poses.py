"""`identity-poses`: a robot's driver returned only the identity."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Input
from basecal.cell import Finding
from basecal.estimation.observability.motions import mount_names


def identity_poses(inputs: Input) -> list[Finding]:
    """A warning about each robot whose recorded poses are all exactly the identity; recorded joints are ignored.

    An info if all mounts on the robot are fixed: the robot may represent something that never moves.
    """
    findings = []
    for robot in inputs.problem.robots:
        poses = [end.base_from_flange for end in inputs.problem.robot_ends(robot) if end.joints is None]
        if poses and all(np.all(each.matrix == np.eye(4)) for each in poses):
            fixed = all(inputs.problem.unknowns[name].status == "fixed" for name in mount_names(inputs.problem, robot))
            what, do = (
                f"All recorded poses of {robot} are the identity.",
                (f"Check that the driver of {robot} is connected.",),
            )
            findings.append(Finding("identity-poses", "info" if fixed else "warning", (robot,), what, do))
    return findings
