"""What an exporter is given."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from xml.dom import minidom
from xml.etree.ElementTree import tostring

import pytest
from ruamel.yaml import YAML

from basecal.cell import Cell, Robot
from basecal.exchange.exports.exporter import comments, csv_row, describe_transform, provenance, xml_comment, yaml_word
from export_example import BASE, CALIBRATION, FIXED, wanted

TEXTS = ("a", "", '"', "\\", "a\nb", "a\x85\u2028\x00b", "]: {#", "\U0001f600", "- a", "e\u0301", "\t")


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


@pytest.mark.parametrize("text", TEXTS)
def test_yaml_reads_the_same_text(text):
    """By the rules of both versions."""
    for version in ("1.1", "1.2"):
        yaml = YAML(typ="safe", pure=True)
        yaml.version = version
        assert yaml.load(f"a: [{yaml_word(text)}, b]") == {"a": [text, "b"]}


@pytest.mark.parametrize("text", TEXTS)
def test_csv_reads_the_same_text(text):
    """In its own cell of its own row; formulas are texts."""
    row = csv_row(["a", text, "b"], ["-1"])
    prefix = "'" if text[:1] in ("-", "\t") and text else ""
    assert list(csv.reader(io.StringIO(row, newline=""))) == [["a", prefix + text, "b", "-1"]]
    assert csv_row(["=1+1", "@x", "+1"]) == "'=1+1,'@x,'+1"


@pytest.mark.parametrize("text", ["--->", "----", "-", "--><a/><!--", "\x01", "]]>"])
def test_a_comment_ends_where_it_ends(text):
    """Whatever it holds, the element after it is the only one."""
    document = minidom.parseString(f"<r>{tostring(xml_comment(text), encoding='unicode')}<b/></r>")
    assert [node.nodeName for node in document.documentElement.childNodes] == ["#comment", "b"]
