"""Import of an importer's rows into a cell, unless they are implausible."""

from __future__ import annotations

from dataclasses import replace as dataclass_replace
from pathlib import Path

from basecal.accuracy.input_check.plausibility import impossible_input
from basecal.cell import Cell, Recording
from basecal.errors import InputError
from basecal.exchange.importing.bring_in import Brought, add_to_cell
from basecal.exchange.importing.imported import Imported


def import_into(cell: str | Path, imports: Imported, *, replace: bool = False, session: bool = False) -> Brought:
    """Bring what an importer read into a cell's folder, all of it or nothing.

    Args:
        cell: The folder; the cell is made if there is none.
        imports: What was read for this cell, as by `basecal.read_poses`.
        replace: Whether it stands in for what is recorded; the files as they were are kept in `originals`.
        session: Whether it makes samples of its own, as what was recorded on another day.

    Raises:
        InputError: if it is implausible, does not fit the cell, or would overwrite what is recorded.
    """
    if not isinstance(imports, Imported):
        raise InputError(f"expected what an importer read, such as basecal.read_poses, got {imports!r}")
    imports = dataclass_replace(imports, is_session=session or imports.is_session)
    if imports.is_preview:
        raise InputError(f"{imports.source} was only listed: read it without list=True to import it")

    def implausible(cell: Cell, recording: Recording) -> tuple[str, ...]:
        """The implausible input, in a line; empty if all is plausible."""
        found = impossible_input(cell, recording)
        told = f"{imports.source}: {'; '.join(found)}: that cannot be"
        if found and imports.is_strict:
            raise InputError(f"{told}, nothing is imported; {imports.advice}")
        return (f"{told}; {imports.advice}",) if found else ()

    try:
        return add_to_cell(Path(cell), imports, implausible, replace)
    finally:
        if imports.scratch is not None:
            imports.scratch.cleanup()
