"""The words of a command as they are typed, and as the parser of options takes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from shlex import quote

_OF_NUMBERS = ("--task-point", "--task-box")


def normalise_words(words: Sequence[str]) -> Iterator[str]:
    """The words of a command with each option in the form that the parser takes.

    `--task-point "0.8 -0.1 0.3"` becomes `--task-point 0.8 -0.1 0.3`, and `--scene`, whose value may be left out, takes
    the next word only if that is `also`.
    """
    previous = ""
    for word, following in zip(words, [*words[1:], ""], strict=True):
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
