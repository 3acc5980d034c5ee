"""Excel workbooks of poses, damaged by a seed: their archive, the XML in it, and cells that tables seldom hold."""

from __future__ import annotations

import re
from datetime import datetime, time, timedelta
from io import BytesIO
from pathlib import Path
from random import Random
from typing import Any
from warnings import catch_warnings
from zipfile import ZIP_DEFLATED, ZipFile

from openpyxl import Workbook
from openpyxl.comments import Comment
from openpyxl.utils.datetime import CALENDAR_MAC_1904

from basecal.exchange.controller_poses import PoseFormat, read_controller_poses
from torment.damage import HOSTILE_TEXTS, ODD_NUMBERS, torn, torn_bytes
from torment.outcome import run_reader

_HEADER = ("image", "x [mm]", "y [mm]", "z [mm]", "A [deg]", "B [deg]", "C [deg]")
_ODD_CELLS: tuple[Any, ...] = (
    *(datetime(2026, 5, 1, 12), time(12, 30), timedelta(hours=30), True, None, "1,5", " ", "1e3"),
    *("=A2*2", "=1/0", "=HYPERLINK(A1)", "#REF!", "#N/A", "-"),
)
_NUMBERS = [number for number in ODD_NUMBERS if number != 10**400]  # which openpyxl does not write
_SHEET = "xl/worksheets/sheet1.xml"
_FORBIDDEN = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_PLACES = ("A1", "XFD1", "XFD1048576", "ZZZ1", "AAAA1", "A0", "A99999999999", "1A", "", "A1:G9")
_BOMBS = (  # many cells by few bytes, deep, and wide
    '<row><c r="XFD1"><v>1</v></c></row>' * 200_000,
    "<row>" + "<c/>" * 500_000 + "</row>",
    "<row>" * 50_000,
    " " * 2**25,
    '<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>',
)
_BOMB = 0.1  # of the odd sheets: each takes seconds
_ENTITIES = '<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>'


def read_damaged_workbook(chance: Random, folder: Path) -> str:
    """A damaged workbook of poses, read by the process that is made for it."""
    path = write_damaged_workbook(chance, folder)
    return run_reader(lambda: read_controller_poses(str(path), "arm", PoseFormat("kuka")))


def write_damaged_workbook(chance: Random, folder: Path) -> Path:
    """Write a workbook with odd cells, of which the XML or the bytes may be damaged; its path."""
    path, data, kind = folder / chance.choice(["poses.xlsx", "poses.csv"]), _workbook(chance), chance.random()
    if kind < 0.5:
        data = _other_part(data, chance)
    elif kind < 0.7:
        data = torn_bytes(data, chance)
    path.write_bytes(data)
    return path


def _workbook(chance: Random) -> bytes:
    """Rows of poses, some of whose cells are odd, merged, or on other sheets."""
    book, data = Workbook(), BytesIO()
    sheet: Any = book.worksheets[0]
    if chance.random() < 0.2:
        sheet.append([chance.choice(["Poses", "Messung, Halle 4", 5])])
    sheet.append(_HEADER)
    for row in range(chance.randint(0, 6)):
        sheet.append([f"{row}.png", *(round(chance.uniform(-180, 180), 2) for _ in range(6))])
    for _ in range(chance.choice([0, 0, 1, 2])):
        _odd_cell(sheet, chance)
    if chance.random() < 0.2:
        sheet.merge_cells(chance.choice(["A1:G1", "B2:C3", "A2:G2", "A1:XFD1", "B2:B9"]))
    if chance.random() < 0.2:
        book.create_sheet("Notes", chance.choice([0, 1])).append(["notes"])
        sheet.sheet_state = chance.choice(["visible", "hidden", "veryHidden"])
    if chance.random() < 0.1:
        book.epoch = CALENDAR_MAC_1904
    book.save(data)
    return data.getvalue()


def _odd_cell(sheet: Any, chance: Random) -> None:
    """A cell of another kind, format or place."""
    row, column = chance.choice([1, 2, 3, 9, 2**20]), chance.choice([1, 2, 5, 8, 2**14])
    value = chance.choice([*_ODD_CELLS, *HOSTILE_TEXTS, *_NUMBERS])
    cell = sheet.cell(row, column)
    cell.value = _FORBIDDEN.sub("?", value) if isinstance(value, str) else value
    if chance.random() < 0.3:
        cell.number_format = chance.choice(["yyyy-mm-dd", "[h]:mm", "0.00E+00", '0.0 "mm"', "General;[Red]", "@"])
    if chance.random() < 0.1:
        cell.comment = Comment("by hand", "me")


def _other_part(data: bytes, chance: Random) -> bytes:
    """The archive with one part of it damaged, missing, twice, or of another name."""
    result = BytesIO()
    with ZipFile(BytesIO(data)) as source, ZipFile(result, "w", ZIP_DEFLATED) as archive:
        names = source.namelist()
        chosen, kind = chance.choice([_SHEET, _SHEET, *names]), chance.random()
        for name in names:
            text = source.read(name).decode()
            if name != chosen or kind > 0.2:
                archive.writestr(
                    name, _damaged_part(text, chance).encode("utf-8", "surrogatepass") if name == chosen else text
                )
            elif kind > 0.1:
                archive.writestr(chance.choice(["../a.xml", f"/{name}", name.upper(), f"{name}\n"]), text)
            elif kind > 0.05:
                archive.writestr(name, text)
                with catch_warnings(action="ignore"):  # about the second one
                    archive.writestr(name, text)
    return result.getvalue()


def _damaged_part(text: str, chance: Random) -> str:
    """XML with a value torn, entities, an odd place of a cell, or cells without end."""
    values = list(re.finditer(r'"([^"]*)"|>([^<]+)<', text))
    kind = chance.randrange(5)
    if kind == 0:
        return torn(text, chance)
    if kind == 1 and chance.random() < 0.5:
        return _ENTITIES + re.sub(r">[^<]+<", ">&b;<", text, count=1)
    if kind == 2 and chance.random() < _BOMB:
        return text.replace("</sheetData>", chance.choice(_BOMBS) + "</sheetData>")
    if kind == 3:
        return re.sub(r'(<(?:c|row) r=")[^"]*', lambda found: found[1] + chance.choice(_PLACES), text, count=1)
    value = chance.choice(values)
    other = chance.choice([torn(value[0][1:-1], chance), str(chance.choice(ODD_NUMBERS))])
    return text[: value.start() + 1] + _FORBIDDEN.sub("", other) + text[value.end() - 1 :]
