"""A rival beside the model in use, and which of the two to believe."""

import numpy as np
import pytest

from basecal.accuracy.model_comparison.comparison import Decision, decide


@pytest.mark.parametrize(("chance", "decision"), [
    (0.9e-3, Decision.TAKE), (1.1e-3, Decision.UNDECIDED), (0.019, Decision.UNDECIDED), (0.021, Decision.KEEP),
    (1.0, Decision.KEEP),
])  # fmt: skip
def test_a_rival_is_taken_below_one_chance_and_doubted_below_another(chance, decision):
    found = decide("links", 3.0, np.log(chance), 1e-3, 0.02)
    assert (found.rival, found.gain, found.decision) == ("links", 3.0, decision)
    assert found.chance == pytest.approx(chance)
    assert found.is_taken == (decision is Decision.TAKE)


def test_without_a_doubt_the_model_in_use_is_kept():
    """Of one level there are two decisions; a chance above one counts as one."""
    assert decide("", 0.0, np.log(0.5), 1e-3).decision is Decision.KEEP
    assert decide("", 0.0, 2.0, 1e-3).chance == 1.0
