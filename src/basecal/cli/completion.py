"""`basecal completion`."""

from __future__ import annotations

from typing import Literal

from basecal.cli.terminal import say


def completion(shell: Literal["bash", "zsh", "fish"], /) -> int:
    """Print what makes a shell complete verbs and options.

    It is made from the same source as `--help`, and knows every verb and
    option of this version.

    For example:

        basecal completion bash > ~/.local/share/bash-completion/completions/basecal
        basecal completion fish > ~/.config/fish/completions/basecal.fish
        basecal completion zsh > ~/.zfunc/_basecal

    Args:
        shell: For which shell.
    """
    from basecal.cli import build_app

    say(build_app().generate_completion(prog_name="basecal", shell=shell).rstrip("\n"))
    return 0
