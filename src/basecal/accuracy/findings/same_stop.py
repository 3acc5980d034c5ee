"""`same-stop`: recorded poses at one place differ slightly, and are treated as one stop."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Input
from basecal.cell import Finding
from basecal.errors import count_text
from basecal.estimation.noise.estimate import ROUNDING
from basecal.fields.digits import two_digits
from basecal.numerics.batch import concatenate


def same_stop(inputs: Input) -> list[Finding]:
    """An info about each robot whose recorded poses vary within its stops; empty for robots on continuous paths."""
    if inputs.on_paths:
        return []
    findings = []
    for robot in inputs.problem.robots:
        ends = inputs.problem.robot_ends(robot)
        stand, poses = (
            np.concatenate([end.stop_number for end in ends]),
            concatenate([end.base_from_flange for end in ends]),
        )
        first = np.unique(stand, return_index=True)[1]
        off = (poses[first[np.searchsorted(stand[first], stand)]].inverse() @ poses).log()
        far_m, far_rad = (float(np.linalg.norm(half, axis=1).max()) for half in (off[:, :3], off[:, 3:]))
        # Rotations that were recorded as quaternions differ by rounding alone.
        if far_m < ROUNDING and far_rad < ROUNDING:
            continue
        far = f"{two_digits(1e3 * far_m)} mm and {two_digits(1e3 * far_rad)} mrad"
        what = f"Poses within one stop of {robot} differ by up to {far}, at {count_text(len(first), 'stop')}."
        why = "They are treated as one stop with one pose error."
        findings.append(Finding("same-stop", "info", (robot,), what, why=why))
    return findings
