"""Tests of the finding about bases that nearly coincide."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

from basecal.accuracy.findings.near_bases import near_bases
from basecal.cell import Unknown
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from evidence import evidence_of

NAME = "eye_base_from_hand_base"


def test_robots_in_one_frame_are_named() -> None:
    """Hand poses in the eye's frame give coinciding bases, which are named; separate bases are not."""
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


def find_pairs(
    places_m: dict[str, float],
    fixed: tuple[str, ...] = (),
    stated: tuple[str, ...] = ("b", "c"),
    hidden: tuple[str, ...] = (),
) -> list[str]:
    """Named pairs of robots a (the reference), b and c with bases along x; hidden ones are unobservable."""
    cell = SimpleNamespace(
        reference="a",
        base_name=lambda name: name,
        bases={name: SimpleNamespace(status="fixed" if name in fixed else "free") for name in stated},
    )
    at = {name: SE3.from_rotvec([0, 0, 0], [x, 0, 0]) for name, x in places_m.items() if name != "a"}
    solution = SimpleNamespace(
        state=SimpleNamespace(transforms=at),
        problem=SimpleNamespace(robots=(*places_m,)),
        observability=SimpleNamespace(unobservable=frozenset(hidden)),
    )
    found = near_bases(SimpleNamespace(cell=cell, solution=solution))
    return ["".join(each.about) for each in found]


def test_bases_within_a_decimetre_are_near() -> None:
    """Bases within 10 cm are near, for every pair with one base that is not stated and both observable."""
    assert find_pairs({"a": 0.0, "b": 0.099}) == ["ab"]
    assert find_pairs({"a": 0.0, "b": 0.101}) == []
    assert find_pairs({"a": 0.0, "b": 1.0, "c": 1.05}) == ["bc"]
    assert find_pairs({"a": 0.0, "b": 0.05, "c": -0.04}) == ["ab", "ac", "bc"]
    assert find_pairs({"a": 0.0, "b": 0.05, "c": -0.04}, fixed=("b",)) == ["ac", "bc"]
    assert find_pairs({"a": 0.0, "b": 0.05, "c": -0.04}, fixed=("b", "c")) == []
    assert find_pairs({"a": 0.0, "b": 0.05}, stated=()) == []
    assert find_pairs({"a": 0.0, "b": 0.05, "c": -0.04}, hidden=("b",)) == ["ac"]
