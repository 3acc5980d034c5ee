"""Tests of the finding `unit-length`: the length with its sigma."""

from __future__ import annotations

from types import SimpleNamespace

from basecal.accuracy.findings.unit_length import unit_lengths
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


def test_unit_length_is_stated_with_sigma() -> None:
    """A board whose poses were assumed in metres has a unit of one metre, to half a percent.

    Without units there is no finding.
    """
    made = simulate(Scenario(target="pose", layout="eye_in_hand", robot_noise=(1e-4, 2e-4)), 1)
    solution = solve(made.cell, made.recording)
    assert unit_lengths(SimpleNamespace(solution=solution, units_m={})) == []
    (found,) = unit_lengths(SimpleNamespace(solution=solution, units_m={"board": 1.0}))
    assert (found.code, found.severity, found.about) == ("unit-length", "info", ("board",))
    words = found.what.split()
    length, sigma = float(words[words.index("is") + 1]), float(words[words.index("±") + 1])
    assert abs(length - 1e3) < 3 * sigma < 15
