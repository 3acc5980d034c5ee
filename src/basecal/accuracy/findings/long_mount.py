"""`long-mount`: what a flange carries is found far from it, and what stands on the ground near the base.

Inverse poses of one robot exchange mount and base: they fit as exactly, with the camera on the other end.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import WORLD, Cell, Finding

_LEAST_M = 0.4  # of a mount from its flange: most are within 0.2 m; assumed
_TIMES_NEARER = 2.0  # what stands on the ground is to its base; assumed


def long_mount(evidence: Evidence) -> list[Finding]:
    """A warning about the robot of a cell whose mount and base look exchanged."""
    cell, found = evidence.cell, evidence.solution.state.transforms
    if len(cell.robots) != 1 or len(cell.cameras) != 1 or len(cell.targets) != 1 or not evidence.solution.converged:
        return []
    ((robot, camera, target),) = zip(cell.robots, cell.cameras, cell.targets, strict=True)
    if any(end.joints is not None for end in evidence.solution.problem.robot_ends(robot)):
        return []
    carried, standing = (camera, target) if cell.cameras[camera].on == robot else (target, camera)
    names = cell.mount_name(carried), cell.mount_name(standing)
    if _carrier(cell, standing) != WORLD or any(cell.transforms[name].status != "free" for name in names):
        return []
    mount_m, stand_m = (float(np.linalg.norm(found[name].translation)) for name in names)
    if mount_m < max(_LEAST_M, _TIMES_NEARER * stand_m):
        return []
    what = f"{carried} is {mount_m:.2f} m from the flange of {robot}, and {standing} {stand_m:.2f} m from its base."
    why = f"Inverse poses of {robot} fit as exactly, with {standing} on {robot} and {carried} on the ground."
    do = (
        f"Check what carries {camera}.",
        f"If {carried} is not on {robot}, import the inverse poses, with {carried} on {WORLD}.",
    )
    return [Finding("long-mount", "warning", (robot,), what, do, why)]


def _carrier(cell: Cell, thing: str) -> str:
    return cell.cameras[thing].on if thing in cell.cameras else cell.targets[thing].on
