"""Without a guess the solver ends at the optimum that it reaches from the truth."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from tests.shared.kinds import KINDS
from tests.shared.start_trial import trial

from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.start.first_state import _Known, _loop, _unknown, first_state, light_states
from basecal.estimation.start.pair_views import pair_views
from basecal.simulation import Scenario, simulate
from quick import quick


@pytest.mark.parametrize("seed", quick([4000, 4001], [4000]))
@pytest.mark.parametrize("kind", KINDS)
def test_one_optimum(kind: str, seed: int) -> None:
    """The two descents of a cell of 15 to 30 samples end alike (1e-6 m and rad), and everything is observable."""
    assert trial(kind, seed).verdict == "same"


@pytest.mark.slow
def test_one_optimum_in_nearly_all() -> None:
    """Of eight cells of every kind at least 99.5 % end alike."""
    trials = [trial(kind, seed) for kind in KINDS for seed in range(5000, 5008)]
    same, other = (sum(t.verdict == verdict for t in trials) for verdict in ("same", "other"))
    assert same >= 0.995 * (same + other)
    assert same + other >= 0.95 * len(trials)


def test_ends_of_a_search_for_a_light() -> None:
    """The best of clean ones is where the start without a guess ends; a board, which has a closed form, has none."""
    made = simulate(Scenario(samples=25, target="led"), 2)
    problem, _ = build_problem(made.cell, made.recording)
    states = list(light_states(problem, made.cell, 12))
    costs = np.array([linearise(problem, state).cost for state in states])
    first = bundle_adjust(problem, first_state(problem, made.cell, thorough=False), 1).cost
    best = bundle_adjust(problem, states[int(np.argmin(costs))], 1).cost
    assert best == pytest.approx(first, rel=1e-6)
    assert len(states) == 12
    board = simulate(Scenario(samples=10), 0)
    assert list(light_states(build_problem(board.cell, board.recording)[0], board.cell, 12)) == []


@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "eye_to_hand"])
def test_what_is_unknown_of_a_pair_is_what_its_loop_lacks(layout: str) -> None:
    """Whatever is known already: mounts by their names, bases where both are known."""
    made = simulate(Scenario(layout=layout, samples=5), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    sight = pair_views(group, made.cameras[group.camera], 5, 5)
    names = sorted(problem.unknowns)
    for count in range(len(names) + 1):
        for chosen in combinations(names, count):
            known = _Known({name: made.truth[name] for name in chosen})
            assert _unknown(sight, known) == _loop(sight, known).unknown
