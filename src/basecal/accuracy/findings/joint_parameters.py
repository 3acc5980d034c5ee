"""`prior-dominated` and `fixed-gauge` of robots' joints: parameters that the data do not determine."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.cell import Finding
from basecal.effects.faces.robot_parameter import Unobserved
from basecal.effects.registry import ROBOT_PARAMETERS


def unobserved_joint_parameters(evidence: Evidence) -> list[Finding]:
    """Infos about the joint parameters of each robot that stay at their prior, or at zero."""
    findings = []
    for kind, by_robot in robot_parameters(evidence.solution).items():
        for robot, found in by_robot.items():
            rows = np.flatnonzero(~found.seen).tolist() if found.joints else []
            if not rows:
                continue
            by_prior = evidence.solution.problem.models[robot].columns[kind].sigma is not None
            base = "the other bases" if robot == evidence.cell.reference else evidence.cell.base_name(robot)
            names = [f"{row + 1} ({found.joints[row]})" for row in rows]
            joints = f"joint {names[0]}" if len(names) == 1 else f"joints {', '.join(names[:-1])} and {names[-1]}"
            unobserved = ROBOT_PARAMETERS[kind].unobserved
            if unobserved is None:
                continue
            text = unobserved(Unobserved(joints, tuple(rows), len(found.joints), base, by_prior))
            if by_prior:
                findings.append(Finding("prior-dominated", "info", (robot,), f"{robot}: {text}."))
            else:
                findings.append(Finding("fixed-gauge", "info", (robot,), f"{robot}: {text}."))
    return findings
