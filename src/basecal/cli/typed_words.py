"""Conversion between the typed words of a command and the form for the parser of options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from shlex import quote

from cyclopts import CoercionError, CycloptsError, UnusedCliTokensError

from basecal.errors import list_names

_NUMBER_OPTIONS = ("--task-point", "--task-box")


def normalise_words(words: Sequence[str]) -> Iterator[str]:
    """Convert the words of a command to the form for the parser.

    `--task-point "0.8 -0.1 0.3"` becomes `--task-point 0.8 -0.1 0.3`. The optional value of `--scene` is the next word
    only if that is `also`.
    """
    previous = ""
    for word, following in pairwise([*words, ""]):
        option, equals, value = word.partition("=")
        if previous in _NUMBER_OPTIONS:
            yield from word.replace(",", " ").split() or [word]
        elif equals and option in _NUMBER_OPTIONS:
            yield option
            yield from value.replace(",", " ").split()
        else:
            yield "--scene=true" if word == "--scene" and following != "also" else word
        previous = word


def typed_command(start: str, options: Mapping[str, object]) -> str:
    """A command as a line to paste into a shell.

    Args:
        start: Beginning of the command.
        options: Values by option; options with None, False or zero are left out.
    """
    words = [start]
    for option, value in options.items():
        if value:
            numbers = [f"{each:.9g}" for each in value] if isinstance(value, tuple) else []
            words += [option, *(numbers or ([] if value is True else [quote(str(value))]))]
    return " ".join(words)


def describe_misuse(error: CycloptsError) -> str:
    """Message for an error of the parser; a flag that was given a value is named."""
    if isinstance(error, CoercionError) and error.target_type is bool and error.token and error.token.keyword:
        return f"{error.token.keyword} takes no value: leave {error.token.value!r} out"
    if not isinstance(error, UnusedCliTokensError) or error.app is None:
        return str(error)
    flag_names = {
        name for option in error.app.assemble_argument_collection() if option.hint is bool for name in option.names
    }
    words = pairwise(error.root_input_tokens or ())
    flags = [word for word, following in words if word in flag_names and following[:1] != "-"]
    unused = list_names([repr(word) for word in error.unused_tokens or ()])
    return "; ".join([f"more words than expected: {unused}", *(f"{flag} takes no value" for flag in flags)])
