"""What a shell completes."""

from __future__ import annotations

import pytest

from basecal.cli import _VERBS, main


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_verb_is_completed(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    """With its options, from the source of the help."""
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(verb in script for verb in _VERBS)
    assert "station-choice" in script
