"""The command line: a table of verbs, each in a small file that imports what is heavy only when it runs."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module

from cyclopts import App, CycloptsError, Parameter

from basecal.errors import BasecalError

_VERBS = ("new", "target", "simulate", "demo", "detect", "calibrate", "report", "export")
_IMPORTS = ("poses", "pixels")
_STUDIES = ("paper",)
_HELP = """Where robot bases stand relative to each other, from what a camera sees, and
how sure that is.

Start with `basecal demo`, or with `basecal new mycell`. Each verb has a page of its own:
`basecal VERB --help`.

Exit codes: 0 good, 1 doubtful or refused, 2 wrong usage, 3 unreadable input."""


def build_app() -> App:
    """The command line: every verb with its help."""
    app = App(
        name="basecal",
        help=_HELP,
        help_format="plaintext",
        result_action="return_value",
        version=_version,
        default_parameter=Parameter(negative=()),
    )
    for place, verb in enumerate(_VERBS):
        app.command(_function(verb), name=verb, sort_key=place)
    imports = App(name="import", help="Make a recording from other programs' files.", sort_key=len(_VERBS))
    for verb in _IMPORTS:
        imports.command(_function(f"import_{verb}"), name=verb)
    app.command(imports)
    studies = App(name="study", help="Reproduce published figures.", sort_key=len(_VERBS) + 1)
    for verb in _STUDIES:
        studies.command(_function(f"study_{verb}"), name=verb)
    app.command(studies)
    return app


def _function(verb: str) -> Callable[..., int]:
    function: Callable[..., int] = getattr(import_module(f"basecal.cli.{verb}"), verb)
    return function


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
    try:
        result = build_app()(arguments, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        return _failed(error, 2)
    except BasecalError as error:
        return _failed(error, error.exit_code)
    except BrokenPipeError:
        # Whoever read the answer has had enough; what Python would still flush goes nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        return _failed(f"{error.filename}: {error.strerror}" if error.filename else error, 3)
    except KeyboardInterrupt:
        return _failed("interrupted", 130)
    return result if isinstance(result, int) else 0


def _failed(error: object, code: int) -> int:
    print(f"basecal: error: {' '.join(str(error).split())}", file=sys.stderr)
    return code
