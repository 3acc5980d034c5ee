"""A certificate where it is asked for or needed, and better optima followed as far as they go."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from basecal.accuracy import certify as module
from basecal.accuracy.certify import prove_solution
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


@dataclass(frozen=True)
class Answer:
    """A solution at some state."""

    state: int
    disputed: bool = False
    problem: str = "problem"
    findings: tuple[str, ...] = ("finding",)


@dataclass(frozen=True)
class Found:
    """A certificate, and a better state or none."""

    certificate: str
    better: int | None


@pytest.fixture
def better_by_one(monkeypatch):
    """Every state up to the fourth has a better one, where the descent from it ends; what was solved is kept."""
    solved = []

    def solve_from(problem, state, settings, findings):
        solved.append((problem, state, settings, findings))
        return Answer(state)

    monkeypatch.setattr(module, "certify", lambda of: Found(f"of {of.state}", of.state + 1 if of.state < 4 else None))
    monkeypatch.setattr(module, "solve_from", solve_from)
    return solved


def test_none_unless_asked_for_or_disputed(better_by_one):
    """The solution is given back as it is."""
    assert prove_solution(Answer(9), Settings()) == (Answer(9), None)
    assert prove_solution(Answer(9), Settings(certify=True)) == (Answer(9), "of 9")
    assert prove_solution(Answer(9, disputed=True), Settings()) == (Answer(9, disputed=True), "of 9")
    assert better_by_one == []


@pytest.mark.parametrize(("start", "end"), [(2, 4), (1, 4), (0, 3)])
def test_better_optima_are_gone_to_three_times_at_most(better_by_one, start, end):
    """One after another, each solved by the same settings; that starts differed stays known."""
    settings = Settings(certify=True)
    best, certificate = prove_solution(Answer(start, disputed=True), settings)
    assert best == Answer(end, disputed=True)
    assert certificate == f"of {end}"
    assert better_by_one == [("problem", k, settings, ("finding",)) for k in range(start + 1, end + 1)]


def test_a_well_posed_cell_is_proven():
    """Poses seen by two arms: global, and the solution is that which was given."""
    made = simulate(Scenario(target="pose", samples=12), 1)
    solution = solve(made.cell, made.recording)
    best, certificate = prove_solution(replace(solution, disputed=True), Settings())
    assert certificate is not None
    assert certificate.is_global is True
    assert best.state is solution.state
