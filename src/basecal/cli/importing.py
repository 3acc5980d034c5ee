"""`basecal import`: a verb for each importer, with the parameters of its function as options."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import is_dataclass
from inspect import Parameter as Argument
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_origin

from cyclopts import App, Parameter

from basecal.accuracy.fixing.offers import is_fixable
from basecal.accuracy.input_screening.importing import import_into
from basecal.cli.next_step import fill_in_command, next_step
from basecal.cli.terminal import progress, progress_bar, quote_path, say
from basecal.errors import BasecalError, count_text, list_names
from basecal.exchange.importers.registry import IMPORTERS
from basecal.exchange.importing.bring_in import ImportResult
from basecal.exchange.importing.imported import Imported, OneOf

_HELP = """Make a cell and its recording from other programs' files, or add to existing
ones. --replace overwrites recorded data and keeps the originals in
CELL/originals; without it no recorded data are overwritten. --session adds a
second recording of the same arms.

For example:

    basecal import images mycell photos --camera wrist --on left
    basecal import poses mycell --robot left ur.csv --format ur"""
_PROGRESS = "progress"  # a parameter that is not an option
_REPLACE = Argument(
    "replace",
    Argument.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, Parameter(help="Replace the recorded data, which are kept in CELL/originals.")],
)
_SESSION = Argument(
    "session",
    Argument.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, Parameter(help="Add the rows as new samples, as of another day or another arm.")],
)
_PAIRING_WORDS = {
    "order": "in order",
    "image": "by the names of images",
    "sample": "by the number of the sample",
    "stamp_s": "by time",
}


def import_app() -> App:
    """The verb `import` with a sub-verb for each importer."""
    importers_app = App(name="import", help=_HELP, help_format="plaintext")
    for position, (name, read) in enumerate(IMPORTERS.items()):
        importers_app.command(import_verb(read, name), name=name, sort_key=position)
    return importers_app


def import_verb(read: Callable[..., Imported], name: str = "") -> Callable[..., int]:
    """A command with the parameters and the docstring of an importer, which adds the imported data to a cell."""
    declared = signature(read, eval_str=True)
    parameters = [_option(each) for each in declared.parameters.values() if each.name != _PROGRESS]
    parameters += [_REPLACE, _SESSION]

    def verb(cell: Path, *sources: Path, **options: Any) -> int:
        """Read, import and report."""
        modes = {each.name: options.pop(each.name, each.default) for each in (_REPLACE, _SESSION)}
        with progress_bar("reading") as step:
            progress_option = {_PROGRESS: step} if _PROGRESS in declared.parameters else {}
            imported = read(cell, *sources, **options, **progress_option)
        return finish_import(cell, imported, name, **modes)

    verb.__doc__ = read.__doc__
    vars(verb)["__signature__"] = declared.replace(parameters=parameters, return_annotation=int)
    return verb


def _option(parameter: Argument) -> Argument:
    """Convert a parameter of an importer to an option of the command line."""
    kind: Any = parameter.annotation
    for each in getattr(kind, "__metadata__", ()):
        if isinstance(each, OneOf):
            kind = Annotated[kind, Parameter(help=f"{each.description}: {', '.join(each.names)}.")]
    if is_dataclass(kind):
        kind = Annotated[kind, Parameter(name="*")]
    elif get_origin(kind) is tuple:
        kind = Annotated[kind, Parameter(consume_multiple=True)]
    elif kind == str | Path:
        kind = Path
    elif kind == str | Path | None:
        kind = Path | None
    return parameter.replace(annotation=kind)


def finish_import(
    folder: Path, imports: Imported, importer: str = "", replace: bool = False, session: bool = False
) -> int:
    """Add imported data to a cell, report, and return the exit code; if that fails, the cell is unchanged.

    Args:
        folder: Folder of the cell, which is made if it is missing.
        imports: The imported data.
        importer: Name of the importer.
        replace: Whether the data replace recorded data.
        session: Whether the data are new samples.

    Raises:
        InputError: if the data are implausible, do not fit the cell, or would overwrite recorded data.
    """
    for note in imports.notes:
        say(note)
    if imports.is_preview:
        return 0
    brought = import_into(folder, imports, replace=replace, session=session)
    for doubt in (*imports.warnings, *brought.doubts):
        say(f"basecal: warning: {doubt}", sys.stderr)
    for line in (f"read {imports.source}: {imports.what}", *_pairing_lines(brought)):
        say(line)
    if brought.changed and not brought.is_new_cell:
        say(f"written to cell.yaml: {list_names(brought.changed)}")
    missing = next_step(brought.cell, brought.recording, folder, importer=importer)
    next_words = missing or f"next: basecal calibrate {quote_path(folder)}"
    if missing is None and (wrong_conventions := say_conventions(folder, brought.cell, brought.recording)):
        is_known = all(is_fixable(brought.cell, finding) for finding in wrong_conventions)
        cure = f"basecal fix {quote_path(folder)}" if is_known else "correct cell.yaml"
        next_words = f"next: {cure}, or import again with --replace"
    say(f"{_written_files(folder, brought)}: {next_words}")
    return 0


def _written_files(folder: Path, import_result: ImportResult) -> str:
    """Description of the written files."""
    if not import_result.pairing.numbers:
        return f"wrote {folder / 'cell.yaml'}"
    count = len(import_result.recording.samples)
    is_new = import_result.made >= count  # samples that will not be used do not count
    samples = count_text(count, "sample")
    text = f"wrote {samples}" if is_new else f"completed the {samples}"
    if 0 < import_result.made < count:
        text += f", {import_result.made} of them new,"
    and_cell = " and cell.yaml" if import_result.is_new_cell else ""
    return f"{text}{and_cell} {'to' if is_new else 'of'} {folder}"


def _pairing_lines(import_result: ImportResult) -> list[str]:
    pairing = import_result.pairing
    lines = []
    paired_count = sum(number is not None for number in pairing.numbers) - import_result.made
    if paired_count:
        lines.append(f"paired with {count_text(paired_count, 'sample')} {_PAIRING_WORDS[pairing.by]}")
    if pairing.unpaired_rows:
        lines.append(f"not paired, and left out: {list_names(pairing.unpaired_rows)}")
    if pairing.unpaired_samples:
        lines.append(f"samples without imported data: {list_names([str(n) for n in pairing.unpaired_samples])}")
    return lines


app = import_app()
"""The verb `import`."""


if TYPE_CHECKING:
    from basecal.cell import Cell, Finding, Recording


def say_conventions(folder: Path, cell: Cell, recording: Recording) -> tuple[Finding, ...]:
    """Test with a few samples whether recorded poses and views are consistent in the assumed conventions, and report.

    Args:
        folder: The cell's folder, which caches detections.
        cell: The current cell.
        recording: The whole current recording.

    Returns:
        Findings of severity `error`: conventions that are certainly wrong.
    """
    from basecal.accuracy.input_screening.quick_look import QuickLook, preview_samples, quick_look

    few = preview_samples(recording)
    try:
        if any(sample.images for sample in few.samples):
            from basecal.vision.detect import detect

            with progress_bar("looking at images") as step:
                few = detect(cell, few, folder, progress=step)
    except BasecalError as error:
        look = QuickLook(0, undetermined=str(error))
    else:
        with progress("testing conventions"):
            look = quick_look(cell, few, len(few.samples) == len(recording.samples))
    for finding in look.findings:
        message = fill_in_command(finding, folder).message
        say(f"basecal: warning: {finding.code}, by {count_text(look.views, 'view')}: {message}", sys.stderr)
    if look.error is not None:
        others = "no other direction, unit, order or pairing does better"
        say(f"conventions hold: each of {look.views} views is predicted by the others to {look.error}, and {others}")
    elif not look.findings:
        of_views = f" by {count_text(look.views, 'view')}" if look.views else ""
        say(f"conventions are not determined{of_views}: {look.undetermined}")
    return tuple(finding for finding in look.findings if finding.severity == "error")
