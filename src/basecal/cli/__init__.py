"""The command line: a table of verbs, each in a module that is imported on demand."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError, Parameter

from basecal.cli.help_page import HelpFormatter
from basecal.cli.study import study
from basecal.cli.terminal import say
from basecal.cli.typed_words import describe_misuse, normalise_words
from basecal.errors import BasecalError, DatasetError, describe_fault

_VERBS = {
    "new": "Write a working cell.yaml to fill in, and an empty recording.",
    "target": "Print a target at true scale, with rulers to check the print.",
    "simulate": "Simulate a cell and a recording with known truth, or run such a cell.",
    "demo": "Run two simulated arms, capture, calibrate, and compare with the truth.",
    "capture": "Record samples: move the arms, wait until they are at rest, and take images.",
    "detect": "Find the targets in the images of a recording.",
    "plan": "Plan which samples to record, and how many, to reach a tolerance at a task point.",
    "calibrate": "Estimate the requested transforms, with their covariance.",
    "fix": "Fix faults that the latest calibration found in the files of the cell, and calibrate again.",
    "verify": "Check with one or a few new samples whether a cell is unchanged.",
    "compare": "Report whether two runs or more agree, and what differs between them.",
    "report": "Print the latest calibration in plain text, and write its page.",
    "view": "Show the runs of a cell on a local page.",
    "export": "Write the results of a calibration in the format of another program.",
    "completion": "Print the completion script of a shell, or the manual page.",
    "merge": "Merge cells that were recorded separately, such as each arm with the other at rest.",
}
"""Verbs, with the first sentence of their help, so that no module is imported to list them."""
_END_CHARACTERS = 1000  # kept at both ends of a longer message
_IMPORT = "Make a cell and its recording from other programs' files, or add to existing ones."
_CHECK = "Measure whether the driver of a robot or camera does what it promises."
_PAPER = "Reproduce the simulations of the paper that introduced the axis-shift method."
_HELP = """Estimate the poses of robot bases relative to each other, with covariance,
from camera views of targets.

Start with `basecal demo`, or with `basecal new mycell`. Each verb has a page
of its own: `basecal VERB --help`.

Exit codes of a result: 0 good or tolerance met; 1 doubtful; 4 refused;
5 tolerance missed. Exit codes of a failure: 2 wrong usage; 3 unreadable input;
70 a fault of this program; 130 interrupted."""


def build_app(words: Sequence[str] = ()) -> App:
    """Build the command line with all verbs and their help.

    Args:
        words: The command's arguments; if they name a verb, only that verb is imported.
    """
    app = App(
        name="basecal",
        help=_HELP,
        help_format="plaintext",
        help_formatter=HelpFormatter(),
        result_action="return_value",
        version=_version,
        default_parameter=Parameter(negative=(), show_default=_default_text),
        suppress_keyboard_interrupt=False,
    )
    first = next(iter(words), "")
    for position, (verb, summary) in enumerate(_VERBS.items()):
        help_ = None if verb == first else summary
        app.command(f"basecal.cli.{verb}:{verb}", name=verb, help=help_, sort_key=position)
    import_help = None if first == "import" else _IMPORT
    app.command("basecal.cli.importing:app", name="import", help=import_help, sort_key=position)
    summary = "Measure what drivers of robots and cameras promise."
    drivers = App(name="driver", help=summary, help_format="plaintext", sort_key=len(_VERBS))
    check_help = None if list(words[:2]) == ["driver", "check"] else _CHECK
    drivers.command("basecal.cli.driver_check:driver_check", name="check", help=check_help)
    app.command(drivers)
    studies = App(name="study", help_format="plaintext", sort_key=len(_VERBS) + 1)
    studies.default(study)
    paper_help = None if list(words[:2]) == ["study", "paper"] else _PAPER
    studies.command("basecal.cli.study_paper:study_paper", name="paper", help=paper_help)
    app.command(studies)
    return app


def _default_text(value: object) -> str | None:
    """Text of an option's default in the help; None if there is nothing to show."""
    return None if value is None or value == () else str(value)


def _version() -> str:
    from importlib.metadata import version

    return version("basecal")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; an error is one line on stderr.

    Args:
        arguments: The arguments after `basecal`; those of this process if None.
    """
    # Matrices are small: more threads only wait for one another. NumPy reads this at its first import.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if arguments is None:
        _set_up_streams()
    try:
        words = list(normalise_words(sys.argv[1:] if arguments is None else arguments))
        result = build_app(words)(words, exit_on_error=False, print_error=False)
        if sys.stdout is not None:
            sys.stdout.flush()
    except CycloptsError as error:
        return _report_failure(describe_misuse(error), 2)
    except BasecalError as error:
        return _report_failure(error, error.exit_code)
    except BrokenPipeError:  # the reader of the output has closed it
        _discard_output()
        return 141
    except OSError as error:
        _discard_output()
        return _report_failure(f"{error.filename}: {error.strerror}" if error.filename else error, 3)
    except KeyboardInterrupt as error:
        return _report_failure(str(error) or "interrupted", 130)
    except Exception as error:
        return _report_failure(describe_fault(error), 70)
    return result if isinstance(result, int) else 0


def _discard_output() -> None:
    """Discard output that cannot be written; otherwise Python tries again at exit and prints its own error."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _set_up_streams() -> None:
    """Set up the standard streams of a process of its own, so that only this program's messages reach them.

    The descriptor of a closed stream is reused by the next opened file, into which libraries would then write. While an
    image is decoded, descriptor 2 is redirected to catch messages of libraries; `sys.stderr` gets another descriptor.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    stderr = sys.__stderr__
    if stderr is not None and sys.stderr is stderr:  # no stream of a notebook, which has no number
        sys.stderr = open(os.dup(stderr.fileno()), "w", 1, stderr.encoding, stderr.errors)  # noqa: SIM115
    if not sys.warnoptions:
        import warnings

        warnings.simplefilter("ignore")


def _report_failure(error: object, code: int) -> int:
    """Print an error as one line that names the file once, and return the exit code."""
    text = str(error)
    if isinstance(error, DatasetError):
        text = text.replace(f"\n{error.path}: ", "; ").replace(f"\n{error.path}:", "; line ")
    if isinstance(error, BasecalError):  # of a process of its own, too, which sends its text alone
        text = "; ".join(text.splitlines())
    line = " ".join(text.split())
    if len(line) > 2 * _END_CHARACTERS:  # quotations of input or of the command line may have any length
        line = f"{line[:_END_CHARACTERS]} ... {line[-_END_CHARACTERS:]}"
    if sys.stderr is not None:
        say(f"basecal: error: {line}", sys.stderr)
    return code
