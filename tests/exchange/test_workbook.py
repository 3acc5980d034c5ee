"""Workbooks of Excel: parts as ECMA-376 has them, packed by the standard library."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

from basecal.cell.files import read_recording
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.controller_poses import Reading, read_controller_poses
from basecal.exchange.workbook import workbook_text

MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
HEADER = ("x", "y", "z", "rx", "ry", "rz")


def workbook(rows: list[tuple[object, ...]], **parts: str) -> bytes:
    """Texts are shared strings, as Excel writes them; a None is a cell that is left out."""
    strings = [cell for row in rows for cell in row if isinstance(cell, str)]
    lines = []
    for number, row in enumerate(rows, start=1):
        cells = []
        for letter, cell in zip("ABCDEFGH", row, strict=False):
            if isinstance(cell, str):
                cells.append(f'<c r="{letter}{number}" t="s"><v>{strings.index(cell)}</v></c>')
            elif cell is not None:
                cells.append(f'<c r="{letter}{number}"><v>{cell!r}</v></c>')
        lines.append(f'<row r="{number}">{"".join(cells)}</row>')
    named = {
        "xl/worksheets/sheet1.xml": f"<worksheet {MAIN}><sheetData>{''.join(lines)}</sheetData></worksheet>",
        "xl/sharedStrings.xml": f"<sst {MAIN}>{''.join(f'<si><t>{text}</t></si>' for text in strings)}</sst>",
        **{name.replace("__", "/") + ".xml": text for name, text in parts.items()},
    }
    data = BytesIO()
    with ZipFile(data, "w", ZIP_DEFLATED) as archive:
        for name, text in named.items():
            archive.writestr(name, text)
    return data.getvalue()


def test_the_first_sheet_is_rows_of_text() -> None:
    """Shared and inline strings, numbers, and cells that are left out."""
    inline = (
        f'<worksheet {MAIN}><sheetData><row><c t="inlineStr"><is><t>second</t></is></c></row></sheetData></worksheet>'
    )
    data = workbook([("a, b", "c"), (1.5, None, -2e-05)], xl__worksheets__sheet2=inline)
    assert workbook_text(data, "w.xlsx").splitlines() == ['"a, b",c', "1.5,,-2e-05"]
    assert workbook_text(workbook([], xl__worksheets__sheet1=inline), "w.xlsx") == "second\n"


def test_rows_that_are_left_out_count() -> None:
    """A line of the text has the number that Excel shows."""
    rows = "".join(f'<row r="{n}"><c t="inlineStr"><is><t>{n}</t></is></c></row>' for n in (2, 5))
    sheet = f"<worksheet {MAIN}><sheetData>{rows}</sheetData></worksheet>"
    assert workbook_text(workbook([], xl__worksheets__sheet1=sheet), "w.xlsx") == "\n2\n\n\n5\n"


def test_poses_of_a_workbook_are_imported(tmp_path: Path) -> None:
    """A table with a header is read like its CSV, by every importer of tables."""
    rows = [HEADER, *((0.4, 0.1 * k, 0.3, 0.1, 0.2 * k, 0.0) for k in range(3))]
    (tmp_path / "ur.xlsx").write_bytes(workbook(list(rows)))
    words = ["import", "poses", str(tmp_path / "c"), "--robot", "arm", str(tmp_path / "ur.xlsx"), "--format", "ur"]
    assert main(words) == 0
    pose = read_recording(tmp_path / "c").samples[2].robots["arm"].base_from_flange
    assert pose is not None
    assert pose.translation.tolist() == pytest.approx([0.4, 0.2, 0.3])


def test_a_workbook_as_people_fill_it(tmp_path: Path) -> None:
    """A title, units in a row of their own, decimal commas as text, and a comment of two lines."""
    title, units = ("Messung, Halle 4",), ("mm", "mm", "mm", "deg", "deg", "deg")
    header = ("X", "Y", "Z", "A", "B", "C", "comment")
    rows = [title, header, units, ("400,5", "10", "300", "12,4", "90,0", "178,2", "good,\nvery"), (1.5, 2, 3, 4, 5, 6)]
    (tmp_path / "kuka.xlsx").write_bytes(workbook(list(rows)))
    found = read_controller_poses(str(tmp_path / "kuka.xlsx"), "arm", Reading("kuka"))
    assert [row.robots["arm"].base_from_flange.translation.tolist() for row in found] == [
        pytest.approx([0.4005, 0.01, 0.3]),
        pytest.approx([0.0015, 0.002, 0.003]),
    ]
    (tmp_path / "kuka.xlsx").write_bytes(workbook([header, ("m", *units[1:]), rows[3]]))
    with pytest.raises(DatasetError, match=r"X \[m\]: the unit is m, but another is read"):
        read_controller_poses(str(tmp_path / "kuka.xlsx"), "arm", Reading("kuka"))


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"PK\x03\x04", "is a damaged Excel workbook: save it as CSV"),
        (workbook([(1.0,)])[:200], "is a damaged Excel workbook"),
        (workbook([], xl__worksheets__sheet1='<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'), "is a damaged Excel"),
        (workbook([], xl__worksheets__sheet1=" " * 2**26), "unpacks to more than 32 MB"),
        (workbook([])[:0] + workbook([], other="<a/>").replace(b"sheet1", b"sheetX"), "holds no sheet"),
    ],
)
def test_what_is_no_workbook_is_said(data: bytes, said: str) -> None:
    """Damaged files, entities, bombs and archives of something else are one line each."""
    with pytest.raises(DatasetError, match=said):
        workbook_text(data, "w.xlsx")


def sheet(rows: str) -> str:
    """The text of a sheet of these rows."""
    text = f"<worksheet {MAIN}><sheetData>{rows}</sheetData></worksheet>"
    return workbook_text(workbook([], xl__worksheets__sheet1=text), "w.xlsx")


@pytest.mark.parametrize(
    ("place", "column"),
    [("A1", 0), ("Z1", 25), ("AA1", 26), ("AZ1", 51), ("BA1", 52), ("IV1", 255), ("IW1", None), ("AAA1", None)],
)
def test_columns_have_letters(place: str, column: int | None) -> None:
    """Up to 256 of them; what is beyond is left out."""
    assert sheet(f'<row r="1"><c r="{place}"><v>7</v></c></row>') == ("\n" if column is None else "," * column + "7\n")


def test_cells_without_a_place_follow_one_another() -> None:
    """Rows likewise; text in parts is one, and ends of lines in it are blanks."""
    parts = '<c t="inlineStr"><is><r><t>a</t></r><r><t> b\n c</t></r></is></c>'
    assert sheet(f"<row><c><v>1</v></c>{parts}</row><row><c><v>2</v></c></row>") == "1,a b c\n2\n"
    assert sheet('<row r="2"><c r="B2"><v>1</v></c><c r="A2"><v> </v></c></row>') == "\n,1\n"


def test_the_sheet_of_the_lowest_number_is_the_first() -> None:
    """Not that of the first name."""
    body = "<sheetData><row><c><v>{}</v></c></row></sheetData>"
    texts = {f"xl__worksheets__sheet{k}": f"<worksheet {MAIN}>{body.format(k)}</worksheet>" for k in (10, 2)}
    data = workbook([], **texts).replace(b"xl/worksheets/sheet1.xml", b"xl/worksheets/sheeta.xml")
    assert workbook_text(data, "w.xlsx") == "2\n"


@pytest.mark.parametrize(
    ("target", "state"), [("worksheets/sheet2.xml", "visible"), ("/xl/worksheets/data.xml", "hidden")]
)
def test_the_first_tab_is_the_first_sheet(target: str, state: str) -> None:
    """Tabs may have been moved, files may have other names, and hidden sheets are left out."""
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    tabs = [("Notes", "visible", "r1"), ("Poses", "visible", "r2")]
    tabs = [("Old", "hidden", "r1"), tabs[1]] if state == "hidden" else tabs[::-1]
    sheets = "".join(f'<sheet name="{name}" sheetId="9" state="{shown}" r:id="{key}"/>' for name, shown, key in tabs)
    places = {"r1": "worksheets/sheet1.xml", "r2": target}
    links = "".join(f'<Relationship Id="{key}" Target="{place}"/>' for key, place in places.items())
    body = f"<worksheet {MAIN}><sheetData><row><c><v>{{}}</v></c></row></sheetData></worksheet>"
    parts = {
        "xl__workbook": f'<workbook {MAIN} xmlns:r="{office}"><sheets>{sheets}</sheets></workbook>',
        "xl__worksheets__sheet1": body.format(1),
        f"xl__worksheets__{Path(target).stem}": body.format(2),
    }
    data = BytesIO(workbook([], **parts))
    with ZipFile(data, "a") as archive:
        archive.writestr("xl/_rels/workbook.xml.rels", f"<Relationships>{links}</Relationships>")
    assert workbook_text(data.getvalue(), "w.xlsx") == "2\n"


def test_a_string_that_is_not_there_is_damage() -> None:
    """A number beyond the shared strings."""
    with pytest.raises(DatasetError, match="is a damaged Excel workbook"):
        sheet('<row><c t="s"><v>0</v></c></row>')


@pytest.mark.parametrize(
    ("numbers", "text"),
    [("1 3", "1\n\n3\n"), ("1 2 4", "1\n2\n\n4\n"), ("2 - 5", "\n2\n-\n\n5\n"), ("2 1 4", "\n2\n1\n4\n")],
)
def test_rows_have_their_numbers(numbers: str, text: str) -> None:
    """A row without a number follows the last one, and so does a row of a number that is passed."""
    places = {n: "" if n == "-" else f' r="{n}"' for n in numbers.split()}
    rows = (f'<row{place}><c t="inlineStr"><is><t>{n}</t></is></c></row>' for n, place in places.items())
    assert sheet("".join(rows)) == text


@pytest.mark.parametrize(
    ("code", "is_date"),
    [
        ("yyyy\\-mm\\-dd hh:mm:ss.000", True),
        ("[h]:mm:ss", True),
        ("0.000", False),
        ('0.0 "mm"', False),
        ("[Red]0.0", False),
    ],
)
def test_dates_are_dates(code: str, is_date: bool) -> None:
    """Excel counts them in days, which were read as seconds."""
    styles = (
        f"<styleSheet {MAIN}><numFmts><numFmt numFmtId=\"164\" formatCode='{code}'/></numFmts>"
        '<cellStyleXfs><xf numFmtId="14"/></cellStyleXfs>'
        '<cellXfs><xf numFmtId="0"/><xf numFmtId="22"/><xf numFmtId="164"/></cellXfs></styleSheet>'
    )
    cells = '<c s="0"><v>46143.5</v></c><c s="1"><v>46143.5</v></c><c s="2"><v>46143.520833333336</v></c>'
    text = f"<worksheet {MAIN}><sheetData><row>{cells}</row></sheetData></worksheet>"
    found = workbook_text(workbook([], xl__worksheets__sheet1=text, xl__styles=styles), "w.xlsx").strip().split(",")
    assert found[:2] == ["46143.5", "2026-05-01T12:00:00"]
    assert found[2] == ("2026-05-01T12:30:00" if is_date else "46143.520833333336")


def test_a_date_beyond_all_years_is_damage() -> None:
    """One line, as of any other damage."""
    styles = f'<styleSheet {MAIN}><cellXfs><xf numFmtId="22"/></cellXfs></styleSheet>'
    text = f'<worksheet {MAIN}><sheetData><row><c s="0"><v>1e300</v></c></row></sheetData></worksheet>'
    with pytest.raises(DatasetError, match="is a damaged Excel workbook"):
        workbook_text(workbook([], xl__worksheets__sheet1=text, xl__styles=styles), "w.xlsx")
