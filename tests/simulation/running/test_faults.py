"""Faults as they are switched on."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.simulation.running.faults import FAULTS, read_faults


def test_sizes_in_their_units():
    """A size counts in the unit of its kind, one that is left out is the usual one, and what is off has none."""
    faults = read_faults(["joint-offsets=1", "sag", "base-bumped=3@7"])
    assert faults.size("joint-offsets") == pytest.approx(np.radians(1))
    assert faults.size("sag") == pytest.approx(np.radians(FAULTS["sag"].usual))
    assert (faults.size("base-bumped"), faults.delay_moves("base-bumped")) == (pytest.approx(0.003), 7)
    assert faults.size("backlash") == 0


def test_every_fault_can_be_switched_on():
    """Each has a usual size above 0, which is what its name alone gives."""
    faults = read_faults(list(FAULTS))
    assert all(faults.size(name) == kind.usual * kind.scale > 0 for name, kind in FAULTS.items())


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (["joint-offset"], "did you mean 'joint-offsets'"),
        (["sag=much"], r"expected sag, sag=SIZE \[deg\]"),
        (["sag=-1"], "size above 0"),
        (["sag=nan"], "size above 0"),
        (["sag=1@3"], "there from the start"),
        (["base-bumped=1@-3"], "moves of 0 or more"),
        (["sag", "sag=1"], "given twice"),
    ],
)
def test_what_is_no_fault(written, message):
    """It is refused in a line that says what was expected."""
    with pytest.raises(InputError, match=message):
        read_faults(written)
