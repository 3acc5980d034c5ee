"""`noise-not-identifiable`: unstated noise of robots that the data do not determine."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.errors import count_text
from basecal.estimation.noise.robot_noise import count_stops
from basecal.estimation.problem.problem import Problem

FEWEST_STOPS = 12  # estimated sigmas scatter by a quarter for 15 boards (benchmarks.consistency), by more for fewer


def robots_with_few_stops(problem: Problem) -> dict[str, int]:
    """Number of stops of each robot with unstated noise that moved, but has too few stops to determine it."""
    counts = {name: count_stops(problem, name) for name in sorted(problem.unstated)}
    return {name: count for name, count in counts.items() if 1 < count < FEWEST_STOPS}


def robots_with_one_stop(problem: Problem) -> list[str]:
    """Robots with unstated noise that never moved."""
    return [name for name in sorted(problem.unstated) if count_stops(problem, name) == 1]


def noise_not_identifiable(evidence: Evidence) -> list[Finding]:
    """Infos about robots whose noise the recording hardly determines."""
    if evidence.settings.robot_noise == "stated":
        return list(evidence.solution.findings)
    findings = []
    if few := robots_with_few_stops(evidence.recorded):
        counts = " and ".join(f"{count_text(count, 'stop')} of {name}" for name, count in few.items())
        what = f"{counts} are too few to estimate unstated noise."
        why = "Typical values of robot arms are used as well; the covariance is wider."
        do = (f"Record at least {FEWEST_STOPS} stops, or state `noise` in cell.yaml.",)
        findings.append(Finding("noise-not-identifiable", "info", tuple(few), what, do, why))
    for robot in robots_with_one_stop(evidence.recorded):
        what = f"{robot} made a single stop, so that no residual shows an error of its pose."
        why = "It is assumed to be as noisy as the others, or as arms in general."
        findings.append(
            Finding("noise-not-identifiable", "info", (robot,), what, ("State its noise, or move it.",), why)
        )
    return [*findings, *evidence.solution.findings]
