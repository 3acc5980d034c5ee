"""`noise-not-identifiable`: noise of robots that state none, which the data cannot tell."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.estimation.noise.robot_noise import stops_made
from basecal.estimation.problem.problem import Problem

FEWEST_STOPS = 12  # estimated sigmas scatter by a quarter from 15 boards (benchmarks.consistency), by more below


def robots_with_few_stops(problem: Problem) -> dict[str, int]:
    """Stops of each robot that states no noise and moved, but too seldom to tell it."""
    counts = {name: stops_made(problem, name) for name in sorted(problem.unstated)}
    return {name: count for name, count in counts.items() if 1 < count < FEWEST_STOPS}


def robots_with_one_stop(problem: Problem) -> list[str]:
    """Robots that state no noise and never moved."""
    return [name for name in sorted(problem.unstated) if stops_made(problem, name) == 1]


def noise_not_identifiable(of: Evidence) -> list[Finding]:
    """Infos about robots whose noise the recording hardly tells."""
    if of.settings.robot_noise == "stated":
        return list(of.solution.findings)
    findings = []
    if few := robots_with_few_stops(of.recorded):
        made = " and ".join(f"{name} made {count} stops" for name, count in few.items())
        message = (
            f"{made}, too few to estimate noise that is not stated by them alone: what arms have in general tells it "
            "as much, and the covariance is the wider for it; state their noise, or record at least "
            f"{FEWEST_STOPS} stops"
        )
        findings.append(Finding("noise-not-identifiable", "info", tuple(few), message))
    for robot in robots_with_one_stop(of.recorded):
        message = (
            f"{robot} made a single stop, where an error of its recorded pose shows in no residual; it is taken to be "
            "as noisy as the others, or as arms in general: state its noise, or move it"
        )
        findings.append(Finding("noise-not-identifiable", "info", (robot,), message))
    return [*findings, *of.solution.findings]
