"""Exceptions of basecal with their exit codes, and checks of arguments."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from itertools import islice
from numbers import Integral
from pathlib import Path

_SHOWN_NAMES = 20  # most names in a message
_COMPARED_NAMES = 1000  # most names that are compared to find a similar one
_COMPARED_LENGTH = 60  # most characters of a name that are compared


def printable(text: str) -> str:
    """Escape control characters and invisible characters of a text, such as `\\x1b`; newlines stay."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


def list_names(names: Sequence[str]) -> str:
    """List names for a message; the first twenty of many."""
    more = f" and {len(names) - _SHOWN_NAMES} more" if len(names) > _SHOWN_NAMES else ""
    return ", ".join(map(str, names[:_SHOWN_NAMES])) + more or "none"


def count_text(count: int, noun: str, plural: str = "") -> str:
    """A number with its noun in the plural, by default with an s, unless the number is one."""
    return f"{count} {noun if count == 1 else plural or f'{noun}s'}"


def sentence(clause: str, names: Iterable[str] = ()) -> str:
    """Convert a clause to a sentence; a leading name from `names` is not capitalised."""
    is_name = clause.partition(" ")[0] in set(names)
    return f"{clause if is_name else clause[:1].upper() + clause[1:]}."


def spelling_hint(name: str, names: Iterable[str]) -> str:
    """Hint " (did you mean 'x'?)", or an empty string if no known name is similar."""
    close = get_close_matches(str(name)[:_COMPARED_LENGTH], list(islice(names, _COMPARED_NAMES)), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def error_words(error: BaseException) -> str:
    """Message of a library's error on one line; the name of its type if the message is empty."""
    return " ".join(str(error).split()) or type(error).__name__


def describe_fault(error: Exception) -> str:
    """Write the traceback of an internal error to a file, and return a message with the file's name."""
    import tempfile
    import traceback

    message = f"a fault of basecal itself ({type(error).__name__}: {error})"
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="basecal-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write("".join(traceback.format_exception(error)))
    except OSError as write_error:
        return f"{message}; its traceback could not be written ({write_error.strerror})"
    return f"{message}; please report it with {file.name}"


class BasecalError(Exception):
    """Base class of all errors of this package."""

    exit_code = 3


class InputError(BasecalError, ValueError):
    """The input is invalid; the message states what was expected."""


class UsageError(InputError):
    """Options are incompatible; the message names them and states what to use instead."""

    exit_code = 2


class DatasetError(InputError):
    """The content of a file is invalid.

    The message is one line: path, line, field, what was expected, what to do.
    """

    def __init__(self, path: str | Path, message: str, line: int | None = None, field: str | None = None) -> None:
        message, field = printable(message), None if field is None else printable(field)
        self.path, self.line, self.field, self.reason = str(path), line, field, message
        location = printable(self.path if line is None else f"{path}:{line}")
        super().__init__(f"{location}: {field}: {message}" if field else f"{location}: {message}")


class FrameNotFound(BasecalError, KeyError):
    """A requested frame or transform does not exist; the message lists the existing names."""

    def __init__(self, name: str, names: Sequence[str]) -> None:
        self.name, self.known = name, tuple(names)
        super().__init__(f"no {name!r}{spelling_hint(name, names)}; there are: {list_names(self.known)}")

    def __str__(self) -> str:
        return str(self.args[0])


class NotObservable(BasecalError):
    """A requested transform is unobservable; the message names the null directions in words."""

    exit_code = 4


class RefusedCalibration(BasecalError):
    """A refused calibration cannot be used; the message states the reason."""

    exit_code = 4

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(
            "the calibration is refused, and nothing of it is exported" + (f": {reason}" if reason else "")
        )


class NotConverged(BasecalError):
    """An iteration did not converge; `state` is its last state."""

    exit_code = 4

    def __init__(self, message: str, state: object = None) -> None:
        self.state = state
        super().__init__(message)


class MissingExtra(BasecalError, ImportError):
    """A package of an optional extra is not installed; the message contains the command to install it."""

    exit_code = 2

    def __init__(self, extra: str, feature: str) -> None:
        self.extra = extra
        super().__init__(f"{feature} needs the extra {extra!r}: pip install 'basecal[{extra}]'")


def check_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Check that a value is one of the choices.

    Raises:
        InputError: if it is not; the message lists the choices.
    """
    if value not in choices:
        hint = spelling_hint(value, choices) if isinstance(value, str) else ""
        raise InputError(f"{name} is {value!r}{hint}, expected one of: {', '.join(choices)}")


def check_type(name: str, value: object, kind: type) -> None:
    """Check the type of an argument.

    Raises:
        InputError: if the type is wrong; the message names both types.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name} is of type {type(value).__name__}, expected {kind.__name__}")


def check_integer(name: str, value: object, least: int) -> None:
    """Check that a value is a whole number of at least `least`.

    Raises:
        InputError: if it is not.
    """
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise InputError(f"{name} is {value!r}, expected a whole number >= {least}")


class DriverError(BasecalError):
    """A robot or camera does not respond, has no more data, or cannot execute a request."""
