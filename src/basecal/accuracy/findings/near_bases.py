"""`near-bases`: two robots whose estimated bases are closer together than is possible."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.geometry import SE3

_LEAST_DISTANCE_M = 0.1  # [m] less than the width of the foot of a small robot: 128 mm for a UR3e, by its data sheet


def near_bases(evidence: Evidence) -> list[Finding]:
    """An info about each pair of robots whose estimated bases are closer together than their feet allow."""
    cell, solution, origin = evidence.cell, evidence.solution, SE3.identity()
    found, hidden = solution.state.transforms, solution.observability.unobservable
    bases = {name: cell.base_name(name) for name in solution.problem.robots}
    placed = [name for name in bases if name == cell.reference or (name in cell.bases and bases[name] not in hidden)]
    world_from_base = {name: found.get(bases[name], origin) for name in placed}
    findings = []
    for first, second in combinations(world_from_base, 2):
        apart_m = float(np.linalg.norm(world_from_base[first].translation - world_from_base[second].translation))
        is_stated = all(name == cell.reference or cell.bases[name].status == "fixed" for name in (first, second))
        if apart_m < _LEAST_DISTANCE_M and not is_stated:
            what = f"The bases of {first} and {second} are {1e3 * apart_m:.0f} mm apart."
            why = "A base is the frame that poses were recorded in: both robots may have recorded in one frame."
            do = (f"Check the base frame that is set in the controllers of {first} and {second}.",)
            findings.append(Finding("near-bases", "info", (first, second), what, do, why))
    return findings
