"""What comments say."""

from __future__ import annotations

from dataclasses import replace

from basecal.exchange.exports.remarks import comments, describe_transform, provenance
from export_example import BASE, CALIBRATION, FIXED, wanted


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
