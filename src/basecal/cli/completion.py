"""`basecal completion`."""

from __future__ import annotations

from typing import Literal

from basecal.cli.terminal import say


def completion(kind: Literal["bash", "zsh", "fish", "man"], /) -> int:
    """Print what makes a shell complete verbs and options, or the manual page.

    Both are made from the same source as `--help`, and know every verb and
    option of this version. A wheel of `make dist` installs them.

    For example:

        basecal completion bash > ~/.local/share/bash-completion/completions/basecal
        basecal completion fish > ~/.config/fish/completions/basecal.fish
        basecal completion zsh > ~/.zfunc/_basecal
        basecal completion man > ~/.local/share/man/man1/basecal.1

    Args:
        kind: For which shell, or man.
    """
    say(script(kind))
    return 0


def script(kind: Literal["bash", "zsh", "fish", "man"]) -> str:
    """The completion of a shell, or the manual page."""
    from basecal.cli import build_app
    from basecal.cli.manual import manual

    if kind == "man":
        return manual().rstrip("\n")
    return build_app().generate_completion(prog_name="basecal", shell=kind).rstrip("\n")
