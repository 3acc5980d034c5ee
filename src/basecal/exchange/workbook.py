"""Text of Excel workbooks (.xlsx), which a process with limits of memory, time and output converts."""

from __future__ import annotations

import os

from basecal.box import frames
from basecal.errors import DatasetError, InputError


def workbook_text(path: str, size: int) -> str:
    """Comma-separated text of the first visible sheet, one line per row; cells of formulas have their last value.

    Args:
        path: The workbook.
        size: Its size [bytes], with which the limits increase.

    Raises:
        DatasetError: if the file is not a workbook, or exceeds a limit.
    """
    try:
        parts = [content for _, content in frames("basecal.exchange.workbook_boxed", [os.path.abspath(path)], size)]
    except InputError as error:
        raise DatasetError(path, f"{error}: save it as CSV, and import that") from None
    return b"".join(parts).decode()
