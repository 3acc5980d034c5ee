"""Bases that are found nearly in one place."""

from __future__ import annotations

from dataclasses import replace

from basecal.accuracy.findings.near_bases import near_bases
from basecal.cell import Unknown
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from evidence import evidence_of

NAME = "eye_base_from_hand_base"


def test_robots_in_one_frame_are_named() -> None:
    """Poses of the hand in the eye's frame give bases that coincide; where they stand apart nothing is said."""
    made = simulate(Scenario(samples=10), 0)
    evidence = evidence_of(made.cell, solve(made.cell, made.recording))
    assert near_bases(evidence) == []
    state = evidence.solution.state
    moved = replace(state, transforms={**state.transforms, NAME: SE3.from_rotvec([0, 0, 0], [0.016, 0, 0])})
    near = replace(evidence, solution=replace(evidence.solution, state=moved))
    (finding,) = near_bases(near)
    assert (finding.severity, finding.about) == ("info", ("eye", "hand"))
    assert finding.what == "The bases of eye and hand are 16 mm apart."
    stated = near.cell.with_transform(NAME, Unknown("fixed", moved.transforms[NAME]))
    assert near_bases(replace(near, cell=stated)) == []
