"""Tests of export requests and their text functions."""

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


def test_own_frames_come_from_transform_name():
    """Own frames are those of the name, whatever they are called in other programs."""
    (one,) = wanted(BASE).transforms
    assert one.own_frames == ("eye_base", "hand_base")
    assert (one.parent, one.child) == ("left base's", "right_base")


def test_unknown_controller_may_be_any_kind():
    """A robot with a stated format has that kind of controller only."""
    robots = {"a": Robot("a", controller={"format": "kuka"}), "b": Robot("b")}
    request = replace(wanted(BASE), cell=Cell("a", robots))
    assert request.may_have_controller("a", "kuka")
    assert not request.may_have_controller("a", "abb")
    assert request.may_have_controller("b", "abb")
    assert request.may_have_controller("c", "abb")
    assert replace(request, cell=None).may_have_controller("a", "abb")


def test_provenance_has_run_and_hash():
    """The provenance is on one line if the calibration is not doubtful."""
    (line,) = provenance(CALIBRATION, "20260102T030405Z")
    assert line.startswith("made by basecal ")
    assert "run 20260102T030405Z from recording/samples.jsonl sha256:0123456789ab" in line
    assert line.endswith("89ab")
    (bare,) = provenance(replace(CALIBRATION, inputs={}))
    assert "run" not in bare
    assert "from" not in bare


def test_doubtful_provenance_has_finding_codes():
    """A doubtful calibration lists the codes of the relevant findings."""
    assert provenance(replace(CALIBRATION, verdict="doubtful"))[1].startswith("DOUBTFUL: poor-fit; ")


def test_description_has_direction_unit_and_sigma():
    """A fixed transform is described as fixed, since its error is unknown."""
    (base,), (fixed,) = wanted(BASE).transforms, wanted(FIXED).transforms
    assert describe_transform(base, "m") == (
        "eye_base_from_hand_base: the pose of hand_base in eye_base, m; 1 sigma 0.62 mm and 0.057 deg"
    )
    assert describe_transform(fixed, "m").endswith("the pose of board in hand_flange, m; fixed")


def test_comment_is_one_line():
    """A comment stays on one line, whatever a name contains."""
    assert comments(["a\nos.system('x')", "b\x1b[2J"], "#") == ["# a os.system('x')", "# b\\x1b[2J"]


@pytest.mark.parametrize("text", TEXTS)
def test_yaml_word_is_read_back(text):
    """YAML 1.1 and 1.2 read the same text."""
    for version in ("1.1", "1.2"):
        yaml = YAML(typ="safe", pure=True)
        yaml.version = version
        assert yaml.load(f"a: [{yaml_word(text)}, b]") == {"a": [text, "b"]}


@pytest.mark.parametrize("text", TEXTS)
def test_csv_row_is_read_back(text):
    """Text stays in its own cell of its own row; formulas are escaped as text."""
    row = csv_row(["a", text, "b"], ["-1"])
    prefix = "'" if text[:1] in ("-", "\t") and text else ""
    assert list(csv.reader(io.StringIO(row, newline=""))) == [["a", prefix + text, "b", "-1"]]
    assert csv_row(["=1+1", "@x", "+1"]) == "'=1+1,'@x,'+1"


@pytest.mark.parametrize("text", ["--->", "----", "-", "--><a/><!--", "\x01", "]]>"])
def test_xml_comment_contains_its_text(text):
    """Whatever the comment contains, the element after it is the only one."""
    document = minidom.parseString(f"<r>{tostring(xml_comment(text), encoding='unicode')}<b/></r>")
    assert [node.nodeName for node in document.documentElement.childNodes] == ["#comment", "b"]
