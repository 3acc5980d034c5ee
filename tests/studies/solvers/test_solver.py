"""Tests of the interface of solvers."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.studies.solvers.registry import SOLVERS
from basecal.studies.solvers.solver import no_answers
from study_example import study


@pytest.mark.parametrize("name", SOLVERS)
def test_every_solver_implements_the_interface(name: str) -> None:
    """Each solver has its blocks per chunk, the reason of a refusal, and the function that solves."""
    found = SOLVERS[name]
    assert found.blocks >= 1
    assert callable(found.solve)
    refusal = found.refusal_reason(study(hold="layout: chain").points[0].settings)
    assert refusal is None if name == "maximum_likelihood" else name in refusal


def test_no_answers_have_only_a_reason() -> None:
    """Trials without answers have only a reason."""
    none = no_answers(3, "because")
    assert not none.solved.any()
    assert (len(none.transform), none.covariance, none.reason) == (3, None, "because")
    assert np.array_equal(none.transform.matrix[0], np.eye(4))
