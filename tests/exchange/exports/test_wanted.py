"""What an exporter is given."""

from __future__ import annotations

from dataclasses import replace

from basecal.cell import Cell, Robot
from basecal.exchange.exports.wanted import comments, describe_transform, provenance
from export_example import BASE, CALIBRATION, FIXED, wanted


def test_own_frames_are_those_of_the_name():
    """Whatever they are called elsewhere."""
    (one,) = wanted(BASE).transforms
    assert one.own_frames == ("eye_base", "hand_base")
    assert (one.parent, one.child) == ("left base's", "right_base")


def test_a_controller_that_is_not_known_may_be_of_any_kind():
    """One whose format is stated is of that kind alone."""
    robots = {"a": Robot("a", controller={"format": "kuka"}), "b": Robot("b")}
    request = replace(wanted(BASE), cell=Cell("a", robots))
    assert request.may_have_controller("a", "kuka")
    assert not request.may_have_controller("a", "abb")
    assert request.may_have_controller("b", "abb")
    assert request.may_have_controller("c", "abb")
    assert replace(request, cell=None).may_have_controller("a", "abb")


def test_provenance_has_run_and_hash():
    """On one line where nothing is doubtful."""
    (line,) = provenance(CALIBRATION, "20260102T030405Z")
    assert line.startswith("made by basecal ")
    assert "run 20260102T030405Z from recording/samples.jsonl sha256:0123456789ab" in line
    assert line.endswith("89ab")
    (bare,) = provenance(replace(CALIBRATION, inputs={}))
    assert "run" not in bare
    assert "from" not in bare


def test_what_is_doubtful_says_why():
    """By the codes of findings that count."""
    assert provenance(replace(CALIBRATION, verdict="doubtful"))[1].startswith("DOUBTFUL: poor-fit; ")


def test_direction_units_and_sigma_are_said():
    """And that nothing is known of the error of what is fixed."""
    (base,), (fixed,) = wanted(BASE).transforms, wanted(FIXED).transforms
    assert describe_transform(base, "m") == (
        "eye_base_from_hand_base: the pose of hand_base in eye_base, m; 1 sigma 0.62 mm and 0.057 deg"
    )
    assert describe_transform(fixed, "m").endswith("the pose of board in hand_flange, m; fixed")


def test_a_comment_is_one_line():
    """Whatever a name holds."""
    assert comments(["a\nos.system('x')", "b\x1b[2J"], "#") == ["# a os.system('x')", "# b\\x1b[2J"]
