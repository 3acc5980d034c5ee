"""`basecal completion`: completion scripts of shells, and the manual page, from the same source as `--help`."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from typing import Literal

from basecal.cli.terminal import say

_LINE_LENGTH = 10_000  # characters of a line, which `man` wraps
_HEADING = re.compile(r"(Usage|Arguments|Parameters|Commands):( .*)?$")
_ENTRY = re.compile(r"  (\S.*?): (.*)")
_BUILT_IN = ("--help", "-h", "--version")


def manual() -> str:
    """The manual page in roff, with a section for each verb."""
    from basecal.cli import build_app

    lines = [
        ".TH BASECAL 1",
        ".SH NAME",
        r"basecal \- poses of robot bases relative to each other, with covariance",
    ]
    lines += [".SH SYNOPSIS", ".B basecal", ".I VERB", "[OPTIONS]", ".SH DESCRIPTION", *_roff_lines(_help_text([]))]
    for verb, app in build_app().resolved_commands().items():
        kinds = [name for name in app.resolved_commands() if name not in _BUILT_IN]
        if verb not in _BUILT_IN:
            for words in ([verb], *([verb, kind] for kind in kinds)):
                lines += [f".SH basecal {' '.join(words)}".replace("-", r"\-"), *_roff_lines(_help_text(words))]
    return "\n".join(lines) + "\n"


def _help_text(words: Sequence[str]) -> str:
    """The text of `--help`, with each paragraph and each option on one line."""
    from rich.console import Console

    from basecal.cli import build_app

    app, text = build_app(words), io.StringIO()
    app.help_formatter = "plain"
    app.help_print(list(words), console=Console(file=text, width=_LINE_LENGTH, no_color=True, highlight=False))
    return text.getvalue()


def _roff_lines(text: str) -> Iterator[str]:
    """Lines of help as roff requests: headings, options with their help, and examples without wrapping."""
    is_list = False
    for line in text.splitlines():
        heading, entry = _HEADING.match(line), _ENTRY.match(line)
        if heading is not None:
            is_list = heading[1] != "Usage"
            yield from (".PP", f".B {heading[1]}:")
            yield from ([_escape(heading[2].strip())] if heading[2] else [])
        elif is_list and entry is not None:
            yield from (".TP", f".B {_escape(entry[1])}", _escape(entry[2]))
        elif not line.strip():
            yield ".PP"
        elif line.startswith("    ") and not is_list:
            yield from (".br", _escape(line.strip()))
        else:
            yield _escape(line.strip())


def _escape(text: str) -> str:
    escaped = text.strip().replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{escaped}" if escaped[:1] in (".", "'") else escaped


def completion(kind: Literal["bash", "zsh", "fish", "man"], /) -> int:
    """Print the completion script of a shell, or the manual page.

    Both are generated from the same source as `--help`, with every verb and
    option of this version. A wheel of `make dist` installs them.

    For example:

        basecal completion bash > ~/.local/share/bash-completion/completions/basecal
        basecal completion fish > ~/.config/fish/completions/basecal.fish
        basecal completion zsh > ~/.zfunc/_basecal
        basecal completion man > ~/.local/share/man/man1/basecal.1

    Args:
        kind: The shell, or man for the manual page.
    """
    say(completion_text(kind))
    return 0


def completion_text(kind: Literal["bash", "zsh", "fish", "man"]) -> str:
    """The completion script of a shell, or the manual page."""
    from basecal.cli import build_app

    if kind == "man":
        return manual().rstrip("\n")
    return build_app().generate_completion(prog_name="basecal", shell=kind).rstrip("\n")
