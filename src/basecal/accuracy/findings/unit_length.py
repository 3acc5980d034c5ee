"""`unit-length`: length unit of poses known up to scale."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.systematic_errors.expected_sizes import unit_error
from basecal.accuracy.systematic_errors.situation import situate
from basecal.cell import Finding
from basecal.effects.faces.effect import format_with_sigma


def unit_lengths(evidence: Evidence) -> list[Finding]:
    """An info about the length unit of each target whose poses are known up to scale."""
    solution = evidence.solution
    if not evidence.units_m or not solution.converged:
        return []
    situation = situate(solution)
    found = []
    for name, unit_m in evidence.units_m.items():
        longer, sigma = unit_error(situation, name)
        length = format_with_sigma(1e3 * unit_m * (1 + longer), 1e3 * unit_m * sigma)
        found.append(Finding("unit-length", "info", (name,), f"A unit of {name}'s poses is {length} mm long."))
    return found
