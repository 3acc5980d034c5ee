"""YAML as it is written by hand."""

from __future__ import annotations

import pytest
from ruamel.yaml.error import MarkedYAMLError, StringMark

from basecal.cell.format.yaml_text import parse_yaml, read_text, yaml_entry, yaml_fault, yaml_text
from basecal.errors import DatasetError


def test_data_and_the_lines_of_its_keys():
    """Numbers, truth and nothing are read as such, all else is text; every place knows its line."""
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
def test_what_no_cell_needs_is_refused(text, message):
    """Half documents, references, tags, keys given twice, deep nests."""
    with pytest.raises(DatasetError) as caught:
        parse_yaml(text, "f")
    assert message in str(caught.value)


@pytest.mark.parametrize("text", ['{"a": [1, 2', '{"a": 0x\n "b": 1', '{"a": \x00}'])
def test_half_a_json_file_is_not_json(text):
    """The message speaks of the format that the file's name promises."""
    with pytest.raises(DatasetError, match=r"^f\.json(:\d)?: not JSON: "):
        parse_yaml(text, "f.json")


def test_thirty_two_levels_are_read():
    """The deepest nest that is read."""
    assert parse_yaml("[" * 32 + "]" * 32, "f").data is not None


def test_what_is_written_is_read_back():
    """Keys in their order, text that looks like something else, the same list twice, umlauts; a line per inner list."""
    inner = [1.0, 2]
    data = {"z": {"t": "1", "n": None, "f": "no"}, "a": [inner, inner], "ü": "ß", "e": {}, "l": [1e-12, 1e22]}
    text = yaml_text(data)
    assert parse_yaml(text, "f").data == data
    assert list(parse_yaml(text, "f").data) == list(data)
    assert "- [1.0, 2]\n- [1.0, 2]" in text
    assert "ü: ß" in text


def test_an_entry_is_one_line_as_a_cell_has_it():
    """Nested mappings, numbers, words that need quotes: it is read back as it was."""
    value = {"status": "prior", "sigma_rad": 0.02, "about": [[1, 2], ["true", True, None]]}
    line = yaml_entry("robots.eye.joint_offsets", value)
    assert line == "robots.eye.joint_offsets: {status: prior, sigma_rad: 0.02, about: [[1, 2], ['true', true, null]]}"
    assert parse_yaml(line, "x").data == {"robots.eye.joint_offsets": value}
    assert yaml_entry("status", "free") == "status: free"


def test_files_are_utf_8(tmp_path):
    """With or without a mark at their start; else an error says from which byte on, or what to do."""
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


def test_what_a_parser_would_take_minutes_for_is_not_read(tmp_path):
    """A file of a megabyte is no cell: an error says so before any of it is parsed."""
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
def test_slips_of_the_hand_have_their_line_and_fix(text: str, line: int, words: str) -> None:
    """Without the words of the parser, on the line where it is to be mended."""
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
def test_faults_without_a_place_are_told_in_the_parsers_words(context, problem, reason):
    """In one line; what it is most often for needs no place where the words alone say it."""
    assert yaml_fault("a: 1\n", MarkedYAMLError(context, None, problem, None)) == (reason, None)


def test_a_fault_is_on_the_line_of_its_mark():
    """Counted from 1, that of what was opened where it was not closed."""
    begun, mark = (StringMark("x", 0, line, 3, "", 0) for line in (1, 4))
    found = yaml_fault("a: [1\n" * 6, MarkedYAMLError("while parsing", begun, "expected ',' or ']', but got x", mark))
    assert found == ("the bracket that opens here is not closed: add ]", 2)
    found = yaml_fault("a: 'x\n" * 6, MarkedYAMLError("while scanning a quoted scalar", begun, "found end", mark))
    assert found == ("the quote that opens here is not closed: add another", 2)
    found = yaml_fault("a: 1\n" * 6, MarkedYAMLError(None, None, "something else", mark))
    assert found == ("something else", 5)
    tab = yaml_fault("a: 1\n  \tb: 2\n\tc: 3\n", MarkedYAMLError(None, None, "something else", mark))
    assert tab == ("this line is indented with a tab, which YAML does not allow: use spaces", 2)
