"""`long-mount`: the mount on a flange is estimated to be long, and the static mount to be near the base.

Inverse poses of one robot exchange the two mounts: they fit equally well, with the camera on the other end.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import WORLD, Cell, Finding

_LEAST_M = 0.4  # [m] length of a mount from its flange: most are within 0.2 m; assumed
_LEAST_RATIO = 2.0  # length of the mount over the distance of the static device from the base; assumed


def long_mount(evidence: Evidence) -> list[Finding]:
    """A warning if the two mounts of a cell with one robot seem to be exchanged."""
    cell, found = evidence.cell, evidence.solution.state.transforms
    if len(cell.robots) != 1 or len(cell.cameras) != 1 or len(cell.targets) != 1 or not evidence.solution.converged:
        return []
    ((robot, camera, target),) = zip(cell.robots, cell.cameras, cell.targets, strict=True)
    if any(end.joints is not None for end in evidence.solution.problem.robot_ends(robot)):
        return []
    carried, static = (camera, target) if cell.cameras[camera].on == robot else (target, camera)
    names = cell.mount_name(carried), cell.mount_name(static)
    if _carrier(cell, static) != WORLD or any(cell.transforms[name].status != "free" for name in names):
        return []
    mount_m, static_m = (float(np.linalg.norm(found[name].translation)) for name in names)
    if mount_m < max(_LEAST_M, _LEAST_RATIO * static_m):
        return []
    what = f"{carried} is {mount_m:.2f} m from the flange of {robot}, and {static} {static_m:.2f} m from its base."
    why = f"Inverse poses of {robot} fit equally well, with {static} on {robot} and {carried} on the ground."
    do = (
        f"Check what carries {camera}.",
        f"If {carried} is not on {robot}, import the inverse poses, with {carried} on {WORLD}.",
    )
    return [Finding("long-mount", "warning", (robot,), what, do, why)]


def _carrier(cell: Cell, thing: str) -> str:
    return cell.cameras[thing].on if thing in cell.cameras else cell.targets[thing].on
