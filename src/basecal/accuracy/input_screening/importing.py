"""What an importer read is brought into a cell, unless it is implausible."""

from __future__ import annotations

from dataclasses import replace as dataclass_replace
from pathlib import Path

from basecal.accuracy.input_check.plausibility import impossible_input
from basecal.cell import Cell, Recording
from basecal.errors import InputError
from basecal.exchange.importing.bring_in import Brought, add_to_cell
from basecal.exchange.importing.imported import Imported


def import_into(cell: str | Path, imported: Imported, *, replace: bool = False, session: bool = False) -> Brought:
    """Bring what an importer read into a cell's folder, all of it or nothing.

    Args:
        cell: The folder; the cell is made if there is none.
        imported: What was read for this cell, as by `basecal.read_poses`.
        replace: Whether it stands in for what is recorded; the files as they were are kept in `originals`.
        session: Whether it makes samples of its own, as what was recorded on another day.

    Raises:
        InputError: if it is implausible, does not fit the cell, or would overwrite what is recorded.
    """
    imported = dataclass_replace(imported, is_session=session or imported.is_session)
    if imported.is_preview:
        raise InputError(f"{imported.source} was only listed: read it without list=True to import it")

    def implausible(described: Cell, added: Recording) -> tuple[str, ...]:
        """What of the input is implausible, in a line; none if all is plausible."""
        found = impossible_input(described, added)
        told = f"{imported.source}: {'; '.join(found)}: that cannot be"
        if found and imported.is_strict:
            raise InputError(f"{told}, nothing is imported; {imported.advice}")
        return (f"{told}; {imported.advice}",) if found else ()

    try:
        return add_to_cell(Path(cell), imported, implausible, replace)
    finally:
        if imported.scratch is not None:
            imported.scratch.cleanup()
