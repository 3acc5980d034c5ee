"""`prior-dominated` and `fixed-gauge` of robots' joints: offsets and compliances that the data do not tell."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.robot_parameters import deflection, joint_offsets
from basecal.cell import Cell, Finding
from basecal.estimation.problem.robot_parameters import RobotModel
from basecal.geometry import BoolArray


def unobserved_joint_parameters(of: Evidence) -> list[Finding]:
    """Infos about each robot's offsets and compliances that stay at their prior, or at zero."""
    models, solution = of.solution.problem.models, of.solution
    offsets, compliances = joint_offsets(solution), deflection(solution)
    return [
        *(_offsets(of.cell, models[r], each.seen) for r, each in offsets.items() if not each.seen.all()),
        *(_compliances(models[r], each.seen) for r, each in compliances.items() if not each.seen.all()),
    ]


def _offsets(cell: Cell, model: RobotModel, observable: BoolArray) -> Finding:
    joints, base = _listed(model, observable), cell.base_name(model.robot)
    base = "the other bases" if model.robot == cell.reference else base
    reasons = _reasons(np.flatnonzero(~observable).tolist(), model.chain.n)
    if model.offset_sigma is not None:
        message = (
            f"{model.robot}: offsets known from their prior alone: {joints}: {reasons}; the sigmas of {base} and of "
            "the mounts contain what they leave open"
        )
        return Finding("prior-dominated", "info", (model.robot,), message)
    message = (
        f"{model.robot}: offsets that are unobservable and fixed at zero as a gauge: {joints}: {reasons}; {base} and "
        "the mounts make up for them"
    )
    return Finding("fixed-gauge", "info", (model.robot,), message)


def _compliances(model: RobotModel, observable: BoolArray) -> Finding:
    reason = "the torque of gravity about them is small in these samples, or the same in all of them"
    code, how = ("prior-dominated", "known from their prior alone")
    if model.compliance_sigma is None:
        code, how = ("fixed-gauge", "that are unobservable")
    message = f"{model.robot}: compliances {how}: {_listed(model, observable)}: {reason}"
    return Finding(code, "info", (model.robot,), message)


def _listed(model: RobotModel, observable: BoolArray) -> str:
    """Joints that are not observable: "joints 1 (pan), 2 (lift) and 6 (tool)"."""
    names = [f"{j + 1} ({model.chain.joint_names[j]})" for j in np.flatnonzero(~observable).tolist()]
    return f"joint {names[0]}" if len(names) == 1 else f"joints {', '.join(names[:-1])} and {names[-1]}"


def _reasons(joints: list[int], n: int) -> str:
    known = {0: "the first joint moves the arm as its base does", n - 1: "the last one as the mounts on its flange do"}
    reasons = [known[j] for j in joints if j in known]
    if any(j not in known for j in joints):
        reasons.append("the samples hardly move the others by themselves")
    return ", ".join(reasons)
