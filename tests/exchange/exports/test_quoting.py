"""Texts of others as one word of YAML, CSV and XML; `tests/torment/exports.py` tries all exporters."""

from __future__ import annotations

import csv
import io
from xml.dom import minidom
from xml.etree.ElementTree import tostring

import pytest
from ruamel.yaml import YAML

from basecal.exchange.exports.quoting import csv_row, xml_comment, yaml_word

TEXTS = ("a", "", '"', "\\", "a\nb", "a\x85\u2028\x00b", "]: {#", "\U0001f600", "- a", "e\u0301", "\t")


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
