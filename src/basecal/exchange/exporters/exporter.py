"""The face of an exporter, and how one is found."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

from basecal.cell import Calibration, Cell


class Exporter(Protocol):
    """What a module of this folder has."""

    def exported(self, cell: Cell, folder: Path, calibration: Calibration, of: str) -> str:
        """Text of a file for another program.

        Args:
            cell: What was calibrated.
            folder: Where the cell's files are.
            calibration: What came out.
            of: What of the cell is to be exported.
        """


def exporter(name: str) -> Exporter:
    """The exporter of a registered name."""
    module: Any = import_module(f"basecal.exchange.exporters.{name}")
    found: Exporter = module
    return found
