"""The words of a command as they are typed, and as the parser of options takes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from shlex import quote

from cyclopts import CoercionError, CycloptsError, UnusedCliTokensError

from basecal.errors import list_names

_OF_NUMBERS = ("--task-point", "--task-box")


def normalise_words(words: Sequence[str]) -> Iterator[str]:
    """The words of a command with each option in the form that the parser takes.

    `--task-point "0.8 -0.1 0.3"` becomes `--task-point 0.8 -0.1 0.3`, and `--scene`, whose value may be left out, takes
    the next word only if that is `also`.
    """
    previous = ""
    for word, following in pairwise([*words, ""]):
        option, equals, value = word.partition("=")
        if previous in _OF_NUMBERS:
            yield from word.replace(",", " ").split() or [word]
        elif equals and option in _OF_NUMBERS:
            yield option
            yield from value.replace(",", " ").split()
        else:
            yield "--scene=true" if word == "--scene" and following != "also" else word
        previous = word


def typed_command(start: str, options: Mapping[str, object]) -> str:
    """A command as a line to paste into a shell.

    Args:
        start: What it begins with.
        options: Values by option; those that are None, False or zero are left out.
    """
    words = [start]
    for option, value in options.items():
        if value:
            numbers = [f"{each:.9g}" for each in value] if isinstance(value, tuple) else []
            words += [option, *(numbers or ([] if value is True else [quote(str(value))]))]
    return " ".join(words)


def describe_misuse(error: CycloptsError) -> str:
    """The message of what the parser refused; a flag that a value was given to is named."""
    if isinstance(error, CoercionError) and error.target_type is bool and error.token and error.token.keyword:
        return f"{error.token.keyword} takes no value: leave {error.token.value!r} away"
    if not isinstance(error, UnusedCliTokensError) or error.app is None:
        return str(error)
    known = {
        name for option in error.app.assemble_argument_collection() if option.hint is bool for name in option.names
    }
    flags = [
        word for word, following in pairwise(error.root_input_tokens or ()) if word in known and following[:1] != "-"
    ]
    left = list_names([repr(word) for word in error.unused_tokens or ()])
    return "; ".join([f"more words than expected: {left}", *(f"{flag} takes no value" for flag in flags)])
