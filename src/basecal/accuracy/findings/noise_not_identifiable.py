"""`noise-not-identifiable`: noise of robots that state none, which the data cannot tell."""

from __future__ import annotations

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.estimation.noise.robot_noise import stops_made
from basecal.estimation.problem.problem import Problem

FEWEST_STOPS = 12  # estimated sigmas scatter by a quarter from 15 boards (benchmarks.consistency), hardly count below


def robots_with_few_stops(problem: Problem) -> dict[str, int]:
    """Stops of each robot that states no noise and moved, but too seldom to estimate it."""
    counts = {name: stops_made(problem, name) for name in sorted(problem.unstated)}
    return {name: count for name, count in counts.items() if 1 < count < FEWEST_STOPS}


def noise_not_identifiable(of: Evidence) -> list[Finding]:
    """Infos about robots whose noise was not estimated, or is one with something else."""
    few = robots_with_few_stops(of.recorded) if of.settings.robot_noise is None else {}
    return [*([_few_stops(few)] if few else []), *of.solution.findings]


def _few_stops(few: dict[str, int]) -> Finding:
    made = " and ".join(f"{name} made {count} stops" for name, count in few.items())
    message = (
        f"{made}, too few to estimate noise that is not stated: the robots are taken for exact; state their noise, "
        f"record at least {FEWEST_STOPS} stops, or estimate it all the same (`--robot-noise estimated`)"
    )
    return Finding("noise-not-identifiable", "info", tuple(few), message)
