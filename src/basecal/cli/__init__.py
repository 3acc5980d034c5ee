"""The command line: a table of verbs, each in a small file that imports what is heavy only when it runs."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module

from cyclopts import App, CycloptsError, Parameter

from basecal.cli.study import study
from basecal.cli.task_point import numbers_apart
from basecal.cli.terminal import say
from basecal.errors import BasecalError, DatasetError
from basecal.registry import IMPORTS

_VERBS = (
    "new",
    "target",
    "simulate",
    "demo",
    "capture",
    "detect",
    "plan",
    "calibrate",
    "verify",
    "compare",
    "report",
    "view",
    "export",
    "merge",
)
_STUDIES = ("paper",)
_HELP = """Where robot bases stand relative to each other, from what a camera sees, and
how sure that is.

Start with `basecal demo`, or with `basecal new mycell`. Each verb has a page of its own:
`basecal VERB --help`.

Exit codes: 0 good or tolerance met, 1 doubtful, 2 wrong usage, 3 unreadable input,
4 refused, 5 tolerance missed, 70 a fault of this program, 130 interrupted."""


_IMPORT_HELP = """Make a cell and its recording from other programs' files, or complete what is
there: nothing that is recorded is overwritten.

For example:

    basecal import images mycell photos --camera wrist --on left
    basecal import poses mycell --robot left ur.csv --format ur"""


def build_app(words: Sequence[str] = ()) -> App:
    """The command line: every verb with its help.

    Args:
        words: What it will be asked; where they name a verb, none is imported but that.
    """
    app = App(
        name="basecal",
        help=_HELP,
        help_format="plaintext",
        result_action="return_value",
        version=_version,
        default_parameter=Parameter(negative=()),
        suppress_keyboard_interrupt=False,
    )
    first, second = (*words[:2], "", "")[:2]
    _add(app, {verb: verb for verb in _VERBS}, first not in {*_VERBS, "import", "driver", "study"})
    imports = App(name="import", help=_IMPORT_HELP, help_format="plaintext", sort_key=len(_VERBS))
    kinds = {kind: f"import_{kind.replace('-', '_')}" for kind in IMPORTS}
    _add(imports, kinds, first == "import" and second not in kinds)
    app.command(imports)
    drivers = App(
        name="driver",
        help="Measure what drivers of robots and cameras promise.",
        help_format="plaintext",
        sort_key=len(_VERBS),
    )
    _add(drivers, {"check": "driver_check"}, first == "driver" and second != "check")
    app.command(drivers)
    studies = App(name="study", help_format="plaintext", sort_key=len(_VERBS) + 1)
    studies.default(study)
    _add(studies, {verb: f"study_{verb}" for verb in _STUDIES}, first == "study" and second not in _STUDIES)
    app.command(studies)
    return app


def _add(app: App, verbs: Mapping[str, str], listed: bool) -> None:
    """Add verbs, each the function of a module of that name; only where they are `listed` are they imported at once."""
    for place, (name, verb) in enumerate(verbs.items()):
        module = f"basecal.cli.{verb}"
        app.command(getattr(import_module(module), verb) if listed else f"{module}:{verb}", name=name, sort_key=place)


def _version() -> str:
    from importlib.metadata import version

    return version("basecal")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and give its exit code; what went wrong is one line on stderr.

    Args:
        arguments: The words after `basecal`; those of this process where None.
    """
    # The matrices are small: more threads only wait for one another. NumPy reads this when it is first imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if arguments is None:
        _own_process()
    try:
        words = list(numbers_apart(sys.argv[1:] if arguments is None else arguments))
        result = build_app(words)(words, exit_on_error=False, print_error=False)
        if sys.stdout is not None:
            sys.stdout.flush()
    except CycloptsError as error:
        return _failed(error, 2)
    except BasecalError as error:
        return _failed(error, error.exit_code)
    except BrokenPipeError:  # whoever read the answer has had enough
        _drop_unwritten()
        return 141
    except OSError as error:
        _drop_unwritten()
        return _failed(f"{error.filename}: {error.strerror}" if error.filename else error, 3)
    except KeyboardInterrupt:
        return _failed("interrupted", 130)
    except Exception as error:
        return _failed(_bug(error), 70)
    return result if isinstance(result, int) else 0


def _drop_unwritten() -> None:
    """Let what the output cannot take go nowhere: Python would try again as it ends, and say so in its own words."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _own_process() -> None:
    """Let nothing but this program's words reach the streams of a process of its own.

    A stream that is closed leaves its number to the next file that is opened, into which libraries then would write.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(number)
    if not sys.warnoptions:
        import warnings

        warnings.simplefilter("ignore")


def _bug(error: Exception) -> str:
    """What is said of an error that is none of ours: where its traceback was written."""
    import tempfile
    import traceback

    what = f"a fault of basecal itself ({type(error).__name__}: {error})"
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="basecal-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write("".join(traceback.format_exception(error)))
    except OSError as unwritten:
        return f"{what}; its traceback could not be written ({unwritten.strerror})"
    return f"{what}; please report it with {file.name}"


def _failed(error: object, code: int) -> int:
    """The code; what went wrong is said on one line, which names the file once."""
    text = str(error)
    if isinstance(error, DatasetError):
        text = text.replace(f"\n{error.path}:", "; line ")
    if sys.stderr is not None:
        say(f"basecal: error: {' '.join(text.split())}", sys.stderr)
    return code
