"""Names of a cell."""

from __future__ import annotations

import pytest

from basecal.cell.schema.names import name_problems
from basecal.fields.problems import field_name


def problems(**changed):
    data = {"reference": "eye", "robots": {"eye": {}, "hand": {}}, "bases": {"hand": {}}}
    data |= {"cameras": {"wrist": {"on": "eye"}, "hall": {"on": "world"}}, "targets": {"board": {"on": "hand"}}}
    return {field_name(p.loc): p.message for p in name_problems(data | changed)}


def test_a_well_formed_cell_has_none():
    """Nor has one without any sections, or with rubbish in their place."""
    assert problems() == {}
    assert problems(robots={"eye": {}, "a1_b": {}, "hand": {}}) == {}
    assert name_problems({}) == []
    assert problems(cameras=[1], targets="x", bases=None) == {}


@pytest.mark.parametrize("name", ["Arm", "1a", "_a", "a-b", "a b", "", "a_from_b", "a_in_b", 5, "ä"])
def test_ill_formed_names(name):
    """Only a-z, 0-9 and _, a letter first, and nothing that reads as a transform or a point."""
    (message,) = problems(targets={name: {"on": "eye"}}).values()
    assert message.startswith("expected a name of a-z, 0-9 and _, a letter first, without _from_ or _in_; rename ")


def test_world_is_taken():
    """It is the base of the reference."""
    assert problems(targets={"world": {"on": "eye"}}) == {
        "targets.world": "'world' is the base of the reference robot; choose another name"
    }


@pytest.mark.parametrize(
    ("name", "owner"),
    [
        ("eye", "robots.eye"),
        ("wrist", "cameras.wrist"),
        ("hand_base", "a frame of 'hand'"),
        ("eye_flange", "a frame of 'eye'"),
    ],
)
def test_names_are_unique(name, owner):
    """Over all sections, and beside the frames of robots."""
    (message,) = problems(targets={name: {"on": "eye"}}).values()
    assert message == f"the name {name!r} is taken by {owner}; names are unique"


def test_what_is_referred_to_exists():
    """The reference, what carries cameras and targets, and the robots of bases."""
    assert problems(reference="eyes", bases={})["reference"] == (
        "no robot 'eyes' (did you mean 'eye'?); there are: eye, hand"
    )
    assert problems(targets={"board": {"on": "hind"}})["targets.board.on"].endswith("there are: eye, hand, world")
    assert problems(cameras={"wrist": {"on": "moon"}})["cameras.wrist.on"].startswith("no robot 'moon'")
    assert problems(bases={"arm": {}})["bases.arm"].startswith("no robot 'arm'")
    assert problems(bases={"eye": {}})["bases.eye"] == "the base of the reference 'eye' is `world` itself; remove it"
    assert problems(robots={}, bases={}, cameras={}, targets={})["reference"].endswith("there are: none")
