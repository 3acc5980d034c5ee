"""Tests of reading and writing YAML written by hand."""

from __future__ import annotations

import pytest
from ruamel.yaml.error import MarkedYAMLError, StringMark

from basecal.cell.format.yaml_text import parse_yaml, read_text, yaml_entry, yaml_fault, yaml_text
from basecal.errors import DatasetError


def test_yaml_values_and_key_lines():
    """Numbers, booleans and nulls are read as such, everything else as text; each key has its line."""
    document = parse_yaml("a: 1\nb:\n  c: [1.5, yes, 'x']\n  d: true\ne: ~\nf: 2020-01-01\n", "f")
    assert document.data == {"a": 1, "b": {"c": [1.5, "yes", "x"], "d": True}, "e": None, "f": "2020-01-01"}
    assert document.lines[("a",)] == 1
    assert document.lines[("b", "c")] == 3
    assert document.lines[("b", "c", 2)] == 3
    assert document.lines[("e",)] == 5
    assert parse_yaml("", "f").data is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: [1", "f:2: not YAML"),
        ("a: 1\nb: &x 2\n", "f:2: aliases and anchors"),
        ("a: [1, *x]\n", "aliases and anchors"),
        ("a: 1\nb: !!python/name:os.system 1\n", "f:2: tags"),
        ("a: 1\nb: 2\na: 3\n", "f:3: a: given twice, first on line 1; keep one"),
        ("a: {b: 1, b: 2}\n", "f:1: a.b: given twice"),
        ("{[1]: 2}", "f:1: a key on line 1 is not a name"),
        ("a: 0x\nb: 1__2__\n c: 3", "not YAML"),
        ("[" * 33 + "]" * 33, "nested deeper than 32 levels"),
        ("a: \x00", "not YAML"),
    ],
)
def test_unsupported_yaml_is_refused(text, message):
    """Truncated documents, references, tags, duplicate keys and deep nesting are refused."""
    with pytest.raises(DatasetError) as caught:
        parse_yaml(text, "f")
    assert message in str(caught.value)


@pytest.mark.parametrize("text", ['{"a": [1, 2', '{"a": 0x\n "b": 1', '{"a": \x00}'])
def test_json_error_message_names_json(text):
    """The message for a `.json` file calls it JSON, not YAML."""
    with pytest.raises(DatasetError, match=r"^f\.json(:\d)?: not JSON: "):
        parse_yaml(text, "f.json")


def test_nesting_of_32_levels_is_read():
    """32 levels are the deepest nesting that is read."""
    assert parse_yaml("[" * 32 + "]" * 32, "f").data is not None


def test_yaml_round_trip():
    """Key order, text that looks like other types, a repeated list and umlauts survive.

    Each inner list takes one line.
    """
    inner = [1.0, 2]
    data = {"z": {"t": "1", "n": None, "f": "no"}, "a": [inner, inner], "ü": "ß", "e": {}, "l": [1e-12, 1e22]}
    text = yaml_text(data)
    assert parse_yaml(text, "f").data == data
    assert list(parse_yaml(text, "f").data) == list(data)
    assert "- [1.0, 2]\n- [1.0, 2]" in text
    assert "ü: ß" in text


def test_yaml_entry_is_one_line():
    """Nested mappings, numbers and words that need quotes are written on one line and read back the same."""
    value = {"status": "prior", "sigma_rad": 0.02, "about": [[1, 2], ["true", True, None]]}
    line = yaml_entry("robots.eye.joint_offsets", value)
    assert line == "robots.eye.joint_offsets: {status: prior, sigma_rad: 0.02, about: [[1, 2], ['true', true, null]]}"
    assert parse_yaml(line, "x").data == {"robots.eye.joint_offsets": value}
    assert yaml_entry("status", "free") == "status: free"


def test_text_files_must_be_utf_8(tmp_path):
    """UTF-8 with or without a byte-order mark is read.

    Otherwise the error states the first invalid byte or what to do.
    """
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: \xc3\xbc")
    assert read_text(path, "") == "a: ü"
    path.write_bytes(b"a: \xfc")
    with pytest.raises(DatasetError, match=r"not UTF-8 text \(byte 3\); save it as UTF-8"):
        read_text(path, "")
    with pytest.raises(DatasetError, match="there is no such file; make one"):
        read_text(tmp_path / "none", "make one")
    with pytest.raises(DatasetError, match="cannot be read"):
        read_text(tmp_path, "")


def test_oversized_file_is_refused_before_parsing(tmp_path):
    """A file of a megabyte is refused before parsing, since a parser would take minutes."""
    path = tmp_path / "a.yaml"
    path.write_bytes(b"#" * 2**20)
    with pytest.raises(DatasetError, match="has more than"):
        read_text(path, "")
    assert len(read_text(path, "", 2**20)) == 2**20


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("a:\n  b: 1\n\tc: 2\n", 3, "this line is indented with a tab"),
        ("a:\n  b:1\n  c: 2\n", 2, "a space after the colon is missing"),
        ("a:1\nb: 2\n", 1, "a space after the colon is missing"),
        ("a: [1, 2\nb: 3\n", 1, "the bracket that opens here is not closed: add ]"),
        ("a: {b: 1\nc: 2\n", 1, "the bracket that opens here is not closed: add }"),
        ("a: 'x\nb: 1\n", 1, "the quote that opens here is not closed"),
        ("a:\n  b: 1\n c: 2\n", 3, "indented unlike its neighbours"),
        ("a:\n  b: 1\n   c: 2\n", 3, "indented under a line that already has a value"),
        ("a: b: c\n", 1, "two colons"),
        ("x: 1\na: b: c\n", 2, "two colons"),
        ("on eye  # x: y\nb: 2\n", 1, "there is no colon"),
        ("on eye\n\n# one\n\nb: 2\n", 1, "there is no colon"),
        ("a:\n  b: 1\n\n   c: 2\n", 4, "indented under a line that already has a value"),
        ("a: @x\n", 1, "a value cannot start with '@'"),
        ("%YAM\n", 1, "the file ends without content: expected `key: value`"),
        ("a: }\n", 1, "a closing bracket } has no opening bracket"),
        ("a:\n  b: {c: d}}\n", 2, "a closing bracket } has no opening bracket"),
    ],
)
def test_common_yaml_mistakes_have_line_and_fix(text: str, line: int, words: str) -> None:
    """Common mistakes are explained without parser jargon, on the line to fix."""
    with pytest.raises(DatasetError) as caught:
        parse_yaml(text, "f")
    assert caught.value.line == line
    assert words in caught.value.reason
    assert "mapping" not in caught.value.reason


@pytest.mark.parametrize(
    ("context", "problem", "reason"),
    [
        ("while reading\n  a node", None, "while reading a node"),
        ("while reading", "found  an odd\n thing", "found an odd thing"),
        (None, "mapping values are not allowed here", "mapping values are not allowed here"),
        ("while scanning a quoted scalar", "found unexpected end of stream", "found unexpected end of stream"),
        (None, "expected ',' or ']', but got it", "expected ',' or ']', but got it"),
        (None, "but found ']'", "a closing bracket ] has no opening bracket: remove it"),
        (None, "found character '@' that cannot start any token", "a value cannot start with '@': put it in quotes"),
    ],
)
def test_unlocated_yaml_faults_keep_parser_words(context, problem, reason):
    """A fault without a position is reported in the parser's words on one line.

    If these words suffice, the usual fix is given.
    """
    assert yaml_fault("a: 1\n", MarkedYAMLError(context, None, problem, None)) == (reason, None)


def test_yaml_fault_line_is_that_of_its_mark():
    """Lines count from 1; for an unclosed bracket or quote the line is that of its opening."""
    begun, mark = (StringMark("x", 0, line, 3, "", 0) for line in (1, 4))
    found = yaml_fault("a: [1\n" * 6, MarkedYAMLError("while parsing", begun, "expected ',' or ']', but got x", mark))
    assert found == ("the bracket that opens here is not closed: add ]", 2)
    found = yaml_fault("a: 'x\n" * 6, MarkedYAMLError("while scanning a quoted scalar", begun, "found end", mark))
    assert found == ("the quote that opens here is not closed: add another", 2)
    found = yaml_fault("a: 1\n" * 6, MarkedYAMLError(None, None, "something else", mark))
    assert found == ("something else", 5)
    tab = yaml_fault("a: 1\n  \tb: 2\n\tc: 3\n", MarkedYAMLError(None, None, "something else", mark))
    assert tab == ("this line is indented with a tab, which YAML does not allow: use spaces", 2)
