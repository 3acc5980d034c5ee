"""`same-stop`: poses read back at one place differ a little, and are counted as one stop."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Input
from basecal.cell import Finding
from basecal.geometry import SE3

_ROUNDING = 1e-9  # [m, rad] of numbers written with all their digits


def same_stop(given: Input) -> list[Finding]:
    """An info about each robot whose recorded poses vary within its stops; arms on paths make none of their own."""
    if given.on_paths:
        return []
    robots = sorted({robot for g in given.problem.groups for robot in (g.eye, g.hand) if robot is not None})
    findings = []
    for robot in robots:
        of_eye = [(g.eye_stand, g.eye_base_from_eye_flange) for g in given.problem.groups if g.eye == robot]
        of_hand = [(g.hand_stand, g.hand_base_from_hand_flange) for g in given.problem.groups if g.hand == robot]
        stand = np.concatenate([stands for stands, _ in (*of_eye, *of_hand)])
        recorded = [pose for _, pose in (*of_eye, *of_hand)]
        poses = SE3(np.concatenate([p.rotation for p in recorded]), np.concatenate([p.translation for p in recorded]))
        first = np.unique(stand, return_index=True)[1]
        off = (poses[first[np.searchsorted(stand[first], stand)]].inverse() @ poses).log()
        far_m, far_rad = (float(np.linalg.norm(half, axis=1).max()) for half in (off[:, :3], off[:, 3:]))
        # Rotations that were read back as quaternions differ by rounding alone.
        if far_m < _ROUNDING and far_rad < _ROUNDING:
            continue
        far = f"{1e3 * far_m:.2g} mm and {1e3 * far_rad:.2g} mrad"
        what = f"Poses within one stop of {robot} differ by up to {far}, at {len(first)} stops."
        why = "They are treated as one stop with one pose error."
        findings.append(Finding("same-stop", "info", (robot,), what, why=why))
    return findings
