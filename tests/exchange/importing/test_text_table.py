"""Tests of text tables as users paste them."""

from __future__ import annotations

import pytest

from basecal.errors import DatasetError
from basecal.exchange.controller_poses import keyed_rows
from basecal.exchange.importing import text_table
from basecal.exchange.importing.text_table import (
    TextTable,
    as_name,
    is_image,
    parse_number,
    parse_time,
    read_text_table,
    rows_of_numbers,
    select_robot,
)

NAMES = ("x", "y", "z")


def values(text: str) -> list[list[float]]:
    table = read_text_table(text, "t.csv", NAMES)
    return list(rows_of_numbers(table, NAMES))


@pytest.mark.parametrize(
    "text",
    [
        "x,y,z\n0.1,2,-3e1\n",
        "x;y;z\n0,1;2;-30\n",
        "x\ty\tz\n0,1\t2\t-30\n",
        "x y z\n0,1 2 -30\n",
        "# x, y, z\n0.1, 2, -30\n",
        "0.1 2 -30\n",
        "0,1;2;-30;\n",
        "0.1,\t2,\t-30\n",
        "z,x,y\n-30,0.1,2\n",
        "p[0.1, 2, -30]\n",
        "7 8 9 p[0.1, 2, -30]\n",
        "point;x;y;z\nP[1];0,1;2;-30\n",
        "x,y,z,point (taught)\n0.1,2,-30,P{1}\n",
        "pose\n[0.1, 2, -30]\n",
        "(0, [0.1, 2, -30])\n",
        "CONST pos p10:=[0.1,2,-30];\n",
        "{X 0.1, Y 2, Z -30, S 2, T 35}\n",
        "XP1={Z -30,X=0.1,Y: 2}\n",
        '"x","y","z"\n"0.1","2","-30"\n',
        "! a comment\n; another\n// and one more\n\n0.1 2 -30\n",
        "[[0.1, 2, -30], [1, 0, 0, 0], [0, 0, 0, 0]]\n",
        "; z x y\n-30 0.1 2\n",
        "// z, x, y, note [1]\n-30, 0.1, 2, good\n",
        "; z; x; y\n-30; 0,1; 2\n",
        ";z;x;y\n0;-30;0.1;2\n",
        "// x was low\n// z y x\n-30 2 0.1\n",
    ],
)
def test_row_notations_are_equivalent(text: str) -> None:
    """Separators, decimal commas, headers, brackets and names before numbers all give the same row."""
    assert values(text) == [[0.1, 2, -30]]


def test_leading_image_name_needs_no_header() -> None:
    """A first cell with an image's ending is the image name, also before a pose in brackets."""
    for line in ("a.png,1,2,3\n", "a.png;1;2;3\n", "a.png, p[1,2,3]\n", "a.png [1, 2, 3]\n"):
        (row,) = read_text_table(line, "t.csv", NAMES).rows
        assert row.cells["image"] == "a.png"
        assert [float(row.cells[name]) for name in NAMES] == [1, 2, 3]
    assert is_image("x/IMG.JPG")
    assert not is_image("p10")


@pytest.mark.parametrize(
    "text",
    [
        "x;y;z;comment\n1;2;3;\n4;5;6;good\n",
        "x;y;z;comment\n1;2;3\n4;5;6;good (2)\n",
        "x,y,z,note,comment\n1,2,3\n4,5,6,,good [1 2]\n",
        "x\ty\tz\tcomment\n1\t2\t3\t\n4\t5\t6\tgood\n",
        "x;y;z\n1;2;3;;;\n4;5;6\n",
        "1;2;3;;\n4;5;6\n",
        "Halle 4, Montag;;;\nx;y;z;\n1;2;3\n4;5;6\n",
        "x;y;z;comment\n[mm];[mm];[mm];\n1;2;3\n4;5;6;good\n",
    ],
)
def test_spreadsheet_additions_are_ignored(text: str) -> None:
    """Titles, units below the header, and empty trailing cells are handled; comments need not be in every row."""
    table = read_text_table(text, "t.csv", NAMES)
    columns = NAMES if table.header is None else table.header[:3]
    assert list(rows_of_numbers(table, columns)) == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no row of numbers, expected x, y, z"),
        ("x,y,z\n", "holds no row"),
        ("x,y,z\n1,2\n", "t.csv:2: z: is empty in this row"),
        ("1,2\n", "t.csv:1: 2 columns, expected x, y, z"),
        ("x,y,z\n0,1,0,2,0,3\n", "t.csv:2: 6 cells for 3 columns: decimal commas need another separator"),
        ("x,y,z\n1,zwei,3\n", "t.csv:2: y: 'zwei' is not a number"),
        ("x;y;z\n1;1,234.5;3\n", "t.csv:2: y: '1,234.5' is not a number: remove the thousands separators"),
        ("x,y,z\n1,nan,3\n", "t.csv:2: y: 'nan' is not finite"),
        ("x,y,z\n1,,3\n", "t.csv:2: y: is empty in this row"),
        ("p[1,2]\n", "t.csv:1: 2 numbers in brackets, expected x, y, z"),
        ("p[1,2,3]\np[1,2]\n", "t.csv:2: 2 numbers in brackets, expected x, y, z"),
        ("CONST robtarget p:=[[1,2],[1,0,0,0]];\n", "t.csv:1: 6 numbers in brackets"),
        ("1,2,3\np[1,2,3]\n", "t.csv:2: x: 'p[1' is not a number"),
        ("x,y,z,point\n1,2,3,A\n1,2,3,Mittelwert:\n", "t.csv:3: 'Mittelwert:' is not a measured row"),
        ("x,y,z\nfoot,foot,foot\n1,2,3\n", "t.csv:2: x: 'foot' is not a number"),
        ("x,y,q\n1,2,3\n", "t.csv:2: has no z but x, y, q"),
    ],
)
def test_invalid_tables_are_reported(text: str, message: str) -> None:
    """Each error has its line, and the fix if it is known."""
    with pytest.raises(DatasetError) as error:
        values(text)
    assert message in str(error.value)
    assert ("thousands" in str(error.value)) == ("thousands" in message)


def test_line_numbers_are_those_of_file() -> None:
    """Empty lines and comments count."""
    table: TextTable = read_text_table("x,y,z\n\n# one\n1,2,3\n", "t.csv", NAMES)
    assert table.rows[0].line == 4
    assert parse_number(" '1,5' ", "t.csv", 4, "x") == 1.5


@pytest.mark.parametrize(("text", "name"), [("A", "a"), (" Mark 1 ", "mark_1"), ("1", "mark_1"), ('"P-2"', "p_2")])
def test_names_are_normalised(text, name):
    """Names get lower-case letters, digits and _, and start with a letter."""
    assert as_name(text) == name


@pytest.mark.parametrize(
    "text",
    ["a = [[1, 2, 3], [4, 5, 6]]\n", "[[1], [2, 3], [9]], [[4], [5, 6], [9]]\n", "[[1,2,3],[4,5,6],[7,8,9]],\n"],
)
def test_several_poses_in_line_are_refused(text: str) -> None:
    """Before, all but the first were ignored."""
    with pytest.raises(DatasetError, match=r"t.csv:1: several poses in one line: write one pose per line"):
        values(text)


def test_json_records_are_rows() -> None:
    """Lists and objects are read, on one line or on several."""
    assert values("[[1, 2, 3], [4, 5, 6]]") == [[1, 2, 3], [4, 5, 6]]
    assert values('[\n {"z": 3,\n  "x": 1,\n  "y": 2}]') == [[1, 2, 3]]
    assert values('{"z": 3, "x": 1, "y": 2}\n{"z": 6, "x": 4, "y": 5, "note": "a"}\n') == [[1, 2, 3], [4, 5, 6]]
    with pytest.raises(DatasetError, match=r"t.csv:3: y: is empty in this row"):
        values('[\n{"z": 3, "x": 1, "y": 2},\n{"z": 6, "x": 4}]')


@pytest.mark.parametrize(
    ("cell", "seconds"),
    [("12.5", 12.5), ("1970-01-01 00:01:00.5", 60.5), ("1970-01-01T01:01:00+01:00", 60.0), ("20240501", 20240501.0)],
)
def test_times_are_seconds_or_iso_dates(cell: str, seconds: float) -> None:
    """ISO 8601 is in UTC if no zone is given; digits alone are seconds."""
    assert parse_time(cell, "t.csv", 3, "time") == seconds


@pytest.mark.parametrize("cell", ["01.05.2024 12:30:00", "12:30:00", "soon"])
def test_other_time_formats_are_refused(cell: str) -> None:
    """The message shows an accepted form."""
    with pytest.raises(DatasetError, match=r"t.csv:3: time: .* is not a number"):
        parse_time(cell, "t.csv", 3, "time")


def test_unit_in_cell_is_refused() -> None:
    """The error advises to write the unit in the header."""
    with pytest.raises(DatasetError, match=r"'264.3 mm' is not a number: write its unit in the header"):
        values("x,y,z\n264.3 mm,1,2\n")


def test_robot_column_selects_rows() -> None:
    """The column `robot` selects rows. A table with a single robot name belongs to the robot that the user names."""
    table = read_text_table("Robot,x,y,z\nUR 5,1,2,3\nkuka,4,5,6\nUR 5,7,8,9\n", "t.csv", NAMES)
    assert [row.line for row in select_robot(table, "ur_5").rows] == [2, 4]
    with pytest.raises(DatasetError, match="no row belongs to robot 'left'; there are: ur_5, kuka"):
        select_robot(table, "left")
    alone = read_text_table("Robot,x,y,z\nUR 5,1,2,3\n", "t.csv", NAMES)
    assert select_robot(alone, "left") is alone


@pytest.mark.parametrize("count", [2, 3])
def test_row_count_is_limited(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """A table may have as many rows as a recording, and one more is refused."""
    monkeypatch.setattr(text_table, "MOST_SAMPLES", 2)
    text = "x,y,z\n" + "1,2,3\n" * count
    if count == 2:
        assert len(values(text)) == 2
    else:
        with pytest.raises(DatasetError, match=r"t\.csv: 3 rows, expected at most 2"):
            values(text)


@pytest.mark.parametrize("line", ['1, 2, 3, "a, b"', '1,2,3,"a, b"', '1 ,2 , 3,  "a, b"'])
def test_quoted_cells_may_contain_separators(line: str) -> None:
    """Quotes are recognised after a blank, too, in rows and in the header."""
    table = read_text_table(f'x, y, z, "note, more"\n{line}\n', "t.csv", NAMES)
    assert table.header == ("x", "y", "z", "note, more")
    assert list(table.rows[0].cells.values()) == ["1", "2", "3", "a, b"]


@pytest.mark.parametrize(("line", "image"), [
    ("a.png[1,2,3]", "a.png"), ("'a.png';[1,2,3]", "a.png"), ("a.png b.png p[1,2,3]", "a.png"), ("7 p[1,2,3]", None),
    ("[1,2,3] a.png", None),
])  # fmt: skip
def test_image_name_precedes_its_pose(line: str, image: str | None) -> None:
    """The first word of a line is the image, with or without a separator; words after the pose are not."""
    (row,) = read_text_table(line, "t.csv", NAMES).rows
    assert row.cells.get("image") == image
    assert [row.cells[name] for name in NAMES] == ["1", "2", "3"]


@pytest.mark.parametrize(("rows", "message"), [
    ("1,2,3,4", "t.csv:2: 4 cells for 3 columns: decimal commas"),
    ("0,1,0,2,0,3,0", "t.csv:2: 7 columns, the header has 3"),
    ("0.1,2,0,3", "t.csv:2: 4 columns, the header has 3"),
])  # fmt: skip
def test_decimal_commas_are_suspected_by_cell_count(rows: str, message: str) -> None:
    """They are suspected for up to two cells per column, none with a point."""
    with pytest.raises(DatasetError) as error:
        values(f"x,y,z\n{rows}\n")
    assert message in str(error.value)
    with pytest.raises(DatasetError, match="4 columns, the header has 3"):
        values("x;y;z\n1;2;3;4\n")


@pytest.mark.parametrize(("cell", "value"), [("1e12", 1e12), ("-1e12", -1e12), ("1,5e2,", 150.0), ('"-.5"', -0.5)])
def test_numbers_up_to_1e12_are_parsed(cell: str, value: float) -> None:
    """Either sign is accepted; quotes and a trailing comma are not part of the number."""
    assert parse_number(cell, "t.csv", 4, "x") == value
    for beyond in ("1.01e12", "-1.01e12", "inf"):
        with pytest.raises(DatasetError, match="is not finite, or beyond 1e"):
            parse_number(beyond, "t.csv", 4, "x")
    with pytest.raises(DatasetError, match="'1_0' is not a number"):
        parse_number("1_0", "t.csv", 4, "x")


def test_units_below_header_join_column_names() -> None:
    """Columns without a unit keep their name; a row of other words is no row of units."""
    table = read_text_table("x;y;z;rx;n\n(mm);[mm];mm;deg\n1;2;3;4;5\n", "t.csv", NAMES)
    assert table.header == ("x [mm]", "y [mm]", "z [mm]", "rx [deg]", "n")
    assert [row.line for row in table.rows] == [3]
    with pytest.raises(DatasetError, match="4 columns, the header has 3"):
        read_text_table("x;y;z\nmm;mm;mm;mm\n1;2;3\n", "t.csv", NAMES)


@pytest.mark.parametrize(("line", "found"), [
    ("[0.1, 2, -30, 5]", True),  # further numbers of one list are ignored
    ("[[0.1, 2], [-30]]", True),
    ("[0, [0.1, 2, -30]]", True),
    ("{(0.1, 2), (-30, 5)}", False),  # joints
    ("{(0.1), (2)}", False),
])  # fmt: skip
def test_bracket_lists_end_at_pose_boundary(line: str, found: bool) -> None:
    """A pose ends at a bracket, or anywhere in a single list."""
    if found:
        assert values(line) == [[0.1, 2, -30]]
    else:
        with pytest.raises(DatasetError, match=r"t\.csv:1: \d numbers in brackets, expected x, y, z"):
            values(line)


@pytest.mark.parametrize("line", [
    "TOOL_DATA[1]={X 1, Y 2, Z 3}", "$BASE={X 1, Y 2, Z 3}", "PERS tooldata t:=[TRUE,[[1,2,3],[1,0,0,0]]];",
    "set_tcp(p[1,2,3])",
    "movej([1,2,3])", "wait (5)",
])  # fmt: skip
def test_settings_and_joints_are_skipped(line: str) -> None:
    """Tools, bases, and joints beside marked poses are ignored."""
    assert values(f"{line}\nmovel(p[0.1,2,-30])\n") == [[0.1, 2, -30]]


def test_krl_joints_are_no_pose() -> None:
    """Named numbers are read by their names only."""
    with pytest.raises(DatasetError, match="3 numbers in brackets"):
        values("{A1 1, A2 2, A3 3}\n")


def test_column_is_found_by_first_known_name() -> None:
    """Case and blanks are ignored; a missing column gives None, and an empty cell is refused."""
    table = read_text_table("x;y;z; Arm ;Mark\n1;2;3;A;b\n4;5;6;C;\n", "t.csv", NAMES)
    assert table.names("robot", "arm") == ["a", "c"]
    assert table.names("camera") is None
    with pytest.raises(DatasetError, match=r"t\.csv:3: Mark: is empty in this row"):
        table.names("mark")
    assert read_text_table("1 2 3", "t.csv", NAMES).names("arm") is None


def test_point_names_with_brackets_are_not_poses() -> None:
    """Brackets with fewer numbers than a pose belong to names of points."""
    table = read_text_table("point;x;y;z\nP[1];1;2;3\nP[2];4;5;6\n", "t.csv", NAMES)
    assert [row.cells["point"] for row in table.rows] == ["P[1]", "P[2]"]


@pytest.mark.parametrize("word", ["Mean", "avg:", "Max", "stdev", "SUMME "])
def test_summary_rows_are_refused(word: str) -> None:
    """Summary words are recognised in any column; a word that only contains one is a name."""
    with pytest.raises(DatasetError, match="is not a measured row: remove the row"):
        values(f"n,x,y,z\na,1,2,3\n{word},1,2,3\n")
    assert values("n,x,y,z\nmeander,1,2,3\n") == [[1, 2, 3]]


@pytest.mark.parametrize("title", ["Hall 4", "Hall 4;;", ";Hall 4"])
def test_title_line_has_one_cell(title: str) -> None:
    """A title precedes the header; a line of two or more words without a number is the header itself."""
    assert read_text_table(f"{title}\nx;y;z\n1;2;3\n", "t.csv", NAMES).header == ("x", "y", "z")
    table = read_text_table("Hall;Monday;late\nx;y;z\n1;2;3\n", "t.csv", NAMES)
    assert table.header == ("Hall", "Monday", "late")


def test_comma_beside_points_is_refused() -> None:
    """The comma separates thousands, so the value would be a thousand times too small."""
    assert values("x;y;z;note\n1,234;500,5;7;a.b\n") == [[1.234, 500.5, 7]]
    assert values("x;y;z\n1,2;0,125;7.5\n") == [[1.2, 0.125, 7.5]]
    with pytest.raises(DatasetError, match=r"t.csv:3: x: '1,234' has a comma, '500.5' a point: remove the thousands"):
        values("x;y;z\n1;500.5;7\n1,234;501;7\n")


def test_comment_line_may_be_header() -> None:
    """The header may be in a comment of any mark, with units and in capitals."""
    assert read_text_table("; Z X_mm Y\n1 2 3\n", "t.csv", NAMES).header == ("Z", "X_mm", "Y")
    assert read_text_table("// Z [mm], X [mm], Y [mm]\n1, 2, 3\n", "t.csv", NAMES).header == (
        "Z [mm]",
        "X [mm]",
        "Y [mm]",
    )
    assert read_text_table("; as of Monday\n1 2 3\n", "t.csv", NAMES).header is None


@pytest.mark.parametrize(
    "line",
    [
        "{roll: 1, pitch: 2, x: 3}",
        "- {a: 1, b: 2, c: 3}",
        "Pose(yaw=1, x=2, y=3)",
        "[b=1, c=2, d=3]",
        "{A 1, B 2, C 3}",
    ],
)
def test_named_numbers_are_not_positional(line: str) -> None:
    """Their names differ from the expected ones, so their order is unknown."""
    with pytest.raises(DatasetError):
        values(f"{line}\n" * 3)


def test_short_rows_use_no_memory_for_missing_cells() -> None:
    """A header of many columns above many short rows filled gigabytes before."""
    header = ",".join(["x", "y", "z", *(f"c{k}" for k in range(20_000))])
    table = read_text_table(header + "\n" + "1,2,3\n" * 2_000, "t.csv", NAMES)
    assert {len(row.cells) for row in table.rows} == {3}
    assert list(rows_of_numbers(table, NAMES)) == [[1, 2, 3]] * 2_000
    with pytest.raises(DatasetError, match=r"t.csv:2: c5: is empty in this row"):
        table.cell(table.rows[0], "c5")
    with pytest.raises(DatasetError, match=r"t.csv:2: has no w but x, y, z, c0, .* and 19983 more"):
        table.cell(table.rows[0], "w")


def test_missing_key_cell_is_refused() -> None:
    """The header has the key, so a row that ends before its time is an error."""
    text = "x,y,z,time\n1,2,3\n4,5,6,7\n"
    with pytest.raises(DatasetError, match=r"t.csv:2: time: is empty in this row"):
        keyed_rows(read_text_table(text, "t.csv", NAMES))
