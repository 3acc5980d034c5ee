"""Tests of the text of Excel workbooks, written by openpyxl, and of damaged ones, made by the standard library."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, time, timedelta
from io import BytesIO
from pathlib import Path
from tempfile import NamedTemporaryFile
from zipfile import ZIP_DEFLATED, ZipFile

import pytest
from openpyxl import Workbook
from openpyxl.cell.rich_text import CellRichText
from openpyxl.styles import Alignment
from openpyxl.utils.datetime import CALENDAR_MAC_1904

from basecal.cell.files import read_recording
from basecal.cli import main
from basecal.errors import DatasetError, InputError
from basecal.exchange import workbook_boxed
from basecal.exchange.controller_poses import PoseFormat, read_controller_poses
from basecal.exchange.workbook_boxed import read_frames

HEADER = ("x", "y", "z", "rx", "ry", "rz")


def workbook_bytes(book: Workbook) -> bytes:
    data = BytesIO()
    book.save(data)
    return data.getvalue()


def workbook(*rows: tuple[object, ...]) -> bytes:
    book = Workbook()
    for row in rows:
        book.worksheets[0].append(row)
    return workbook_bytes(book)


def replace_part(data: bytes, name: str, change: Callable[[str], str]) -> bytes:
    """Return the workbook with the text of one part replaced."""
    result = BytesIO()
    with ZipFile(BytesIO(data)) as source, ZipFile(result, "w", ZIP_DEFLATED) as archive:
        for part in source.namelist():
            text = source.read(part).decode()
            archive.writestr(part, change(text) if part == name else text)
    return result.getvalue()


def workbook_text(data: bytes) -> str:
    """Return the text of a workbook."""
    with NamedTemporaryFile() as file:
        file.write(data)
        file.flush()
        return b"".join(content for _, content in read_frames([file.name])).decode()


def text(**cells: object) -> str:
    """Return the text of a workbook whose first sheet has these cells."""
    book = Workbook()
    for place, value in cells.items():
        book.worksheets[0][place] = value
    return workbook_text(workbook_bytes(book))


def test_first_sheet_becomes_csv_text() -> None:
    """Text, numbers and missing cells of the first sheet become rows."""
    data = workbook(("a, b", "c"), (1.5, None, -2e-05), (3, True, 0.1))
    assert workbook_text(data).splitlines() == ['"a, b",c', "1.5,,-2e-05", "3,True,0.1"]


def test_skipped_rows_keep_line_numbers() -> None:
    """A line of the text has the row number that Excel shows; cells with only a style are empty."""
    book = Workbook()
    sheet = book.worksheets[0]
    sheet["A2"], sheet["A5"] = "two", "five"
    sheet["C7"].alignment = Alignment(horizontal="center")
    assert workbook_text(workbook_bytes(book)) == "\ntwo\n\n\nfive\n\n\n"


def test_poses_are_imported_from_workbook(tmp_path: Path) -> None:
    """A table with a header is read like its CSV, by every importer of tables."""
    rows = [HEADER, *((0.4, 0.1 * k, 0.3, 0.1, 0.2 * k, 0.0) for k in range(3))]
    (tmp_path / "ur.xlsx").write_bytes(workbook(*rows))
    words = ["import", "poses", str(tmp_path / "c"), "--robot", "arm", str(tmp_path / "ur.xlsx"), "--format", "ur"]
    assert main(words) == 0
    pose = read_recording(tmp_path / "c").samples[2].robots["arm"].base_from_flange
    assert pose is not None
    assert pose.translation.tolist() == pytest.approx([0.4, 0.2, 0.3])


def test_workbook_with_title_and_units_row_is_read(tmp_path: Path) -> None:
    """A title, a row of units, decimal commas as text, and a comment of two lines are handled."""
    title, units = ("Messung, Halle 4",), ("mm", "mm", "mm", "deg", "deg", "deg")
    header = ("X", "Y", "Z", "A", "B", "C", "comment")
    rows = [title, header, units, ("400,5", "10", "300", "12,4", "90,0", "178,2", "good,\nvery"), (1.5, 2, 3, 4, 5, 6)]
    (tmp_path / "kuka.xlsx").write_bytes(workbook(*rows))
    found = read_controller_poses(str(tmp_path / "kuka.xlsx"), "arm", PoseFormat("kuka"))
    assert [row.robots["arm"].base_from_flange.translation.tolist() for row in found] == [
        pytest.approx([0.4005, 0.01, 0.3]),
        pytest.approx([0.0015, 0.002, 0.003]),
    ]
    (tmp_path / "kuka.xlsx").write_bytes(workbook(header, ("m", *units[1:]), rows[3]))
    with pytest.raises(DatasetError, match=r"X \[m\]: the unit is m, but another is expected"):
        read_controller_poses(str(tmp_path / "kuka.xlsx"), "arm", PoseFormat("kuka"))


SHEET, BOOK, CONTENT = "xl/worksheets/sheet1.xml", "xl/workbook.xml", "[Content_Types].xml"
OVERRIDE = (
    '<Override PartName="/xl/sharedStrings.xml" '
    'ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.sharedStrings+xml"/>'
)
STRINGS = '<sst xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><si><t>{}</t></si></sst>'
ENTITY = '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"PK\x03\x04", "is a damaged Excel workbook"),
        (workbook((1.0,))[:200], "is a damaged Excel workbook"),
        (replace_part(workbook((1.0,)), SHEET, lambda _: ENTITY), "is a damaged Excel workbook"),
        (replace_part(workbook((1.0,)), SHEET, lambda part: part[:-40]), "is a damaged Excel workbook"),
        (
            replace_part(workbook((1,)), SHEET, lambda part: part.replace('t="n"', 't="s"')),
            "is a damaged Excel workbook",
        ),
        (replace_part(workbook((1.0,)), CONTENT, lambda _: "<a/>"), "is a damaged Excel workbook"),
        (
            replace_part(workbook((1.0,)), SHEET, lambda part: part + " " * 2**25),
            "sheet1.xml' that unpacks to more than 32 MB",
        ),
        (replace_part(workbook((1.0,)), BOOK, lambda part: part.replace("visible", "hidden")), "holds no sheet"),
    ],
)
def test_damaged_workbook_is_refused(data: bytes, message: str) -> None:
    """Damaged files, entities, decompression bombs and other archives are each reported on one line."""
    with pytest.raises(InputError, match=message):
        workbook_text(data)


def test_part_of_another_name_is_limited_too() -> None:
    """The size of a sheet is limited whatever its name ends in."""
    result = BytesIO()
    with ZipFile(BytesIO(workbook((1.0,)))) as source, ZipFile(result, "w", ZIP_DEFLATED) as archive:
        for part in source.namelist():
            content = source.read(part).replace(b"sheet1.xml", b"sheet1.bin")
            archive.writestr(part.replace("sheet1.xml", "sheet1.bin"), content + b" " * 2**25 * (part == SHEET))
    with pytest.raises(InputError, match=r"sheet1\.bin' that unpacks to more than 32 MB"):
        workbook_text(result.getvalue())


def test_repeated_text_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells that repeat one long text are refused before they fill the memory."""
    monkeypatch.setattr(workbook_boxed, "_MOST_TEXT", 2**20)
    cells = '<row><c t="s"><v>0</v></c></row>' * 300
    data = BytesIO(
        replace_part(workbook((1,)), SHEET, lambda part: part.replace("</sheetData>", cells + "</sheetData>"))
    )
    with ZipFile(data, "a", ZIP_DEFLATED) as archive:
        archive.writestr("xl/sharedStrings.xml", STRINGS.format("a" * 30_000))
    shared = replace_part(data.getvalue(), CONTENT, lambda part: part.replace("<Override", f"{OVERRIDE}<Override", 1))
    with pytest.raises(InputError, match="more than 1 MB of text in its first sheet"):
        workbook_text(shared)


@pytest.mark.parametrize(("place", "column"), [("A1", 0), ("BA1", 52), ("IV1", 255), ("IW1", None), ("XFD1", None)])
def test_columns_beyond_limit_are_ignored(place: str, column: int | None) -> None:
    """At most 256 columns are read."""
    assert text(**{place: 7}) == ("\n" if column is None else "," * column + "7\n")


def test_row_numbers_beyond_excel_limit_end_table() -> None:
    """A row with a larger number ends the table, without cost in time or memory."""
    data = replace_part(
        workbook((1.0,), (2.0,)), SHEET, lambda part: part.replace('<row r="2"', '<row r="99999999999"')
    )
    assert workbook_text(data) == "1\n" + "\n" * (2**20 - 1)


def test_cell_text_is_one_line() -> None:
    """Line ends within a cell become blanks, and text with several fonts is joined."""
    assert text(A1="a\nb\n c", B1=CellRichText("d", " e")) == "a b c,d e\n"


@pytest.mark.parametrize(("first", "state"), [("Poses", "visible"), ("Old", "hidden")])
def test_first_visible_tab_is_read(first: str, state: str) -> None:
    """Tabs may have been moved, and hidden sheets are skipped."""
    book = Workbook()
    book.worksheets[0].append(["notes"])
    book.create_sheet("Poses", 0).append(["poses"])
    if first == "Old":
        book.create_sheet("Old", 0).append(["old"])
        book.worksheets[0].sheet_state = state
    assert book.sheetnames[0] == first
    assert workbook_text(workbook_bytes(book)) == "poses\n"


def test_formula_gives_stored_value() -> None:
    """Excel stores the last value beside the formula."""
    data = replace_part(workbook((2, "=A1*2")), SHEET, lambda part: part.replace("<v />", "<v>4</v>"))
    assert workbook_text(data) == "2,4\n"


@pytest.mark.parametrize("epoch", [None, CALENDAR_MAC_1904])
def test_dates_are_written_in_iso_format(epoch: datetime | None) -> None:
    """Excel counts days from 1900 or 1904; a time alone belongs to day zero."""
    book = Workbook()
    if epoch is not None:
        book.epoch = epoch
    noon = datetime(2026, 5, 1, 12)
    book.worksheets[0].append([noon, noon.date(), noon + timedelta(seconds=0.25), time(12, 30), timedelta(hours=30)])
    book.worksheets[0].append([46143.5])
    dates, numbers = workbook_text(workbook_bytes(book)).splitlines()
    assert dates.split(",") == [
        "2026-05-01T12:00:00",
        "2026-05-01T00:00:00",
        "2026-05-01T12:00:00.250000",
        "1899-12-30T12:30:00",
        "1899-12-31T06:00:00",
    ]
    assert numbers == "46143.5"


@pytest.mark.parametrize("code", ["0.000", '0.0 "mm"', "[Red]0.0"])
def test_formatted_numbers_are_not_dates(code: str) -> None:
    """Date letters in quoted text, and colours, do not make a number a date."""
    book = Workbook()
    book.worksheets[0]["A1"] = 46143.5
    book.worksheets[0]["A1"].number_format = code
    assert workbook_text(workbook_bytes(book)) == "46143.5\n"


def test_date_beyond_range_gives_value_error() -> None:
    """The cell has the text that Excel shows, which no table reads as a number."""
    book = Workbook()
    book.worksheets[0]["A1"] = 1e300
    book.worksheets[0]["A1"].number_format = "yyyy-mm-dd"
    assert workbook_text(workbook_bytes(book)) == "#VALUE!\n"
