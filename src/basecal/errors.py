"""Every exception that basecal raises on purpose, and the exit code it represents."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from itertools import islice
from numbers import Integral
from pathlib import Path

_SHOWN_NAMES = 20  # names in a message, and those of many that are looked at for a near one
_LOOKED_AT = 1000
_LONGEST = 60  # characters of a name that are compared


def printable(text: str) -> str:
    """Text with what a terminal would obey, or hide, written out: `\\x1b`; newlines stay."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


def list_names(names: Sequence[str]) -> str:
    """Names for a message: the first of many."""
    more = f" and {len(names) - _SHOWN_NAMES} more" if len(names) > _SHOWN_NAMES else ""
    return ", ".join(map(str, names[:_SHOWN_NAMES])) + more or "none"


def sentence(clause: str, names: Iterable[str] = ()) -> str:
    """A clause as a sentence; names stay as they are written."""
    is_name = clause.partition(" ")[0] in set(names)
    return f"{clause if is_name else clause[:1].upper() + clause[1:]}."


def nearest(name: str, names: Iterable[str]) -> str:
    """A hint " (did you mean 'x'?)", or nothing if no known name is near."""
    close = get_close_matches(str(name)[:_LONGEST], list(islice(names, _LOOKED_AT)), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def error_words(error: BaseException) -> str:
    """Words of a library's error on one line; its kind if it has none."""
    return " ".join(str(error).split()) or type(error).__name__


def describe_fault(error: Exception) -> str:
    """Message of an error that is none of ours, with the file of its traceback."""
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


class BasecalError(Exception):
    """Base of all errors of this package."""

    exit_code = 3


class InputError(BasecalError, ValueError):
    """The input cannot be used as it is; the message says what was expected."""


class UsageError(InputError):
    """Options that do not go together; the message says which and what to give instead."""

    exit_code = 2


class DatasetError(InputError):
    """A file cannot be read as written.

    The message is one line: path, line, field, what was expected, what to do.
    """

    def __init__(self, path: str | Path, message: str, line: int | None = None, field: str | None = None) -> None:
        message, field = printable(message), None if field is None else printable(field)
        self.path, self.line, self.field, self.reason = str(path), line, field, message
        where = printable(self.path if line is None else f"{path}:{line}")
        super().__init__(f"{where}: {field}: {message}" if field else f"{where}: {message}")


class FrameNotFound(BasecalError, KeyError):
    """A frame or transform that does not exist was requested; the message lists those that do."""

    def __init__(self, name: str, names: Sequence[str]) -> None:
        self.name, self.known = name, tuple(names)
        super().__init__(f"no {name!r}{nearest(name, names)}; there are: {list_names(self.known)}")

    def __str__(self) -> str:
        return str(self.args[0])


class NotObservable(BasecalError):
    """A requested transform is unobservable; the message names the null directions in words."""

    exit_code = 4


class RefusedCalibration(BasecalError):
    """A calibration that is refused was to be used; the message says why it is."""

    exit_code = 4

    def __init__(self, reason: str = "") -> None:
        self.reason = reason
        super().__init__(
            "the calibration is refused, and nothing of it is exported" + (f": {reason}" if reason else "")
        )


class NotConverged(BasecalError):
    """An iteration ended away from an optimum; `state` is where it stopped."""

    exit_code = 4

    def __init__(self, message: str, state: object = None) -> None:
        self.state = state
        super().__init__(message)


class MissingExtra(BasecalError, ImportError):
    """A package that an extra brings is not installed; the message is the line that installs it."""

    exit_code = 2

    def __init__(self, extra: str, feature: str) -> None:
        self.extra = extra
        super().__init__(f"{feature} needs the extra {extra!r}: pip install 'basecal[{extra}]'")


def check_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Refuse a value that is none of the choices.

    Raises:
        InputError: if so; it lists the choices.
    """
    if value not in choices:
        hint = nearest(value, choices) if isinstance(value, str) else ""
        raise InputError(f"{name} is {value!r}{hint}, expected one of: {', '.join(choices)}")


def check_type(name: str, value: object, kind: type) -> None:
    """Refuse an argument that is of another type.

    Raises:
        InputError: if so; it names both types.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name} is of type {type(value).__name__}, expected {kind.__name__}")


def check_integer(name: str, value: object, least: int) -> None:
    """Refuse what is no whole number, or a smaller one.

    Raises:
        InputError: if so.
    """
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise InputError(f"{name} is {value!r}, expected a whole number >= {least}")


class DriverError(BasecalError):
    """A robot or camera does not answer, has nothing more to give, or cannot do what it was asked."""
