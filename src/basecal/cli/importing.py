"""`basecal import`: a verb for each importer, whose options are the parameters of the function that reads."""

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
from basecal.cli.next_step import name_folder, next_step
from basecal.cli.terminal import counting, progress, quote_path, say
from basecal.errors import BasecalError, list_names
from basecal.exchange.importers.registry import IMPORTERS
from basecal.exchange.importing.bring_in import Brought
from basecal.exchange.importing.imported import Imported, OneOf

_HELP = """Make a cell and its recording from other programs' files, or complete what is
there. --replace overwrites what is recorded, and keeps what was there in
CELL/originals; without it nothing that is recorded is overwritten. A second
recording of the same arms is added by --session.

For example:

    basecal import images mycell photos --camera wrist --on left
    basecal import poses mycell --robot left ur.csv --format ur"""
_PROGRESS = "progress"  # the parameter that is no option
_REPLACE = Argument(
    "replace",
    Argument.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, Parameter(help="Let it stand in for what is recorded, which CELL/originals keeps.")],
)
_SESSION = Argument(
    "session",
    Argument.KEYWORD_ONLY,
    default=False,
    annotation=Annotated[bool, Parameter(help="Its rows are samples of their own: another day, another arm still.")],
)
_IN_WORDS = {
    "order": "in order",
    "image": "by the names of images",
    "sample": "by the number of the sample",
    "stamp_s": "by time",
}


def import_app() -> App:
    """The verb with a verb for each importer."""
    made = App(name="import", help=_HELP, help_format="plaintext")
    for place, (name, read) in enumerate(IMPORTERS.items()):
        made.command(import_verb(read, name), name=name, sort_key=place)
    return made


def import_verb(read: Callable[..., Imported], name: str = "") -> Callable[..., int]:
    """A command with the parameters and the docstring of an importer of that name, which brings in what it reads."""
    declared = signature(read, eval_str=True)
    parameters = [_option(each) for each in declared.parameters.values() if each.name != _PROGRESS]
    parameters += [_REPLACE, _SESSION]

    def verb(cell: Path, *sources: Path, **options: Any) -> int:
        """Read, bring in and report."""
        manner = {each.name: options.pop(each.name, each.default) for each in (_REPLACE, _SESSION)}
        with counting("reading") as step:
            watched = {_PROGRESS: step} if _PROGRESS in declared.parameters else {}
            imported = read(cell, *sources, **options, **watched)
        return finish_import(cell, imported, name, **manner)

    verb.__doc__ = read.__doc__
    vars(verb)["__signature__"] = declared.replace(parameters=parameters, return_annotation=int)
    return verb


def _option(parameter: Argument) -> Argument:
    """A parameter as the command line takes it."""
    kind: Any = parameter.annotation
    for each in getattr(kind, "__metadata__", ()):
        if isinstance(each, OneOf):
            kind = Annotated[kind, Parameter(help=f"{each.about}: {', '.join(each.names)}.")]
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
    """The exit code, after all that was read is in the cell and reported; nothing is there if that fails.

    Args:
        folder: The cell, or where one is to be made.
        imports: What was read.
        importer: By which importer.
        replace: Whether it stands in for what is recorded.
        session: Whether it makes samples of its own.

    Raises:
        InputError: if it is implausible, does not fit the cell, or would overwrite what is recorded.
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
        say(f"written into cell.yaml: {list_names(brought.changed)}")
    missing = next_step(brought.cell, brought.recording, folder, importer=importer)
    then = missing or f"next: basecal calibrate {quote_path(folder)}"
    if missing is None and (wrong := say_conventions(folder, brought.cell, brought.recording)):
        is_known = all(is_fixable(brought.cell, finding) for finding in wrong)
        cure = f"basecal fix {quote_path(folder)}" if is_known else "correct cell.yaml"
        then = f"next: {cure}, or import again with --replace"
    say(f"{_written_files(folder, brought)}: {then}")
    return 0


def _written_files(folder: Path, import_result: Brought) -> str:
    """Description of the written files."""
    if not import_result.pairing.numbers:
        return f"wrote {folder / 'cell.yaml'}"
    count = len(import_result.recording.samples)
    told = f"wrote {count} samples" if import_result.made == count else f"completed the {count} samples"
    if 0 < import_result.made < count:
        told += f", {import_result.made} of them new,"
    made = " and cell.yaml" if import_result.is_new_cell else ""
    return f"{told}{made} {'to' if import_result.made == count else 'of'} {folder}"


def _pairing_lines(import_result: Brought) -> list[str]:
    pairing = import_result.pairing
    lines = []
    joined = sum(number is not None for number in pairing.numbers) - import_result.made
    if joined:
        lines.append(f"paired with {joined} samples {_IN_WORDS[pairing.by]}")
    if pairing.unpaired_rows:
        lines.append(f"not paired, and left out: {list_names(pairing.unpaired_rows)}")
    if pairing.unpaired_samples:
        lines.append(f"samples that nothing was imported to: {list_names([str(n) for n in pairing.unpaired_samples])}")
    return lines


app = import_app()
"""The verb `import`."""


if TYPE_CHECKING:
    from basecal.cell import Cell, Finding, Recording


def say_conventions(folder: Path, cell: Cell, recording: Recording) -> tuple[Finding, ...]:
    """Report whether what is recorded closes its loops as it was read, by a few of its samples.

    Args:
        folder: The cell's, where detections are kept.
        cell: As it is now.
        recording: Likewise, whole.

    Returns:
        Errors: what was certainly read otherwise than it was meant.
    """
    from basecal.accuracy.input_screening.quick_look import QuickLook, preview_samples, quick_look

    few = preview_samples(recording)
    try:
        if any(sample.images for sample in few.samples):
            from basecal.vision.detect import detect

            with counting("looking at images") as step:
                few = detect(cell, few, folder, progress=step)
    except BasecalError as error:
        look = QuickLook(0, untold=str(error))
    else:
        with progress("testing conventions"):
            look = quick_look(cell, few, len(few.samples) == len(recording.samples))
    for finding in look.findings:
        message = name_folder(finding, folder).message
        say(f"basecal: warning: {finding.code}, by {look.views} views: {message}", sys.stderr)
    if look.error is not None:
        others = "no other direction, unit, order or pairing does better"
        say(f"conventions hold: each of {look.views} views is predicted by the others to {look.error}, and {others}")
    elif not look.findings:
        say(f"conventions are not determined by {look.views} views: {look.untold}")
    return tuple(finding for finding in look.findings if finding.severity == "error")
