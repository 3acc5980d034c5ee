"""Tests of the manual page and of shell completion."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from basecal.cli import _VERBS, main
from basecal.cli.completion import _roff_lines, manual


@pytest.fixture(scope="module")
def page() -> str:
    """Text of the manual page."""
    return manual()


@pytest.mark.journey
def test_manual_page_is_printed(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The verb that prints completions prints it."""
    assert main(["completion", "man"]) == 0
    assert capsys.readouterr().out == page


def test_manual_has_a_section_for_each_verb(page: str) -> None:
    """A section has the options and examples; dashes can be copied, and no line is a request by accident."""
    assert all(f".SH basecal {verb}\n" in page for verb in _VERBS)
    assert r".SH basecal import easy\-handeye" in page
    assert ".SH basecal study paper" in page
    assert "\n.B \\-\\-station\\-choice" in page
    assert "\n.br\nbasecal capture mycell \\-\\-freedrive \\-\\-web\n" in page
    requests = {line.split()[0] for line in page.splitlines() if line.startswith((".", "'"))}
    assert requests == {".TH", ".SH", ".B", ".I", ".PP", ".TP", ".br"}


@pytest.mark.skipif(shutil.which("groff") is None, reason="groff is not installed")
def test_man_formats_the_page(page: str) -> None:
    """`man` has no complaint, and each option is on a line of its own."""
    words = ["groff", "-man", "-Tascii", "-ww", "-P-cbou"]
    read = subprocess.run(words, input=page, capture_output=True, text=True, check=True)
    assert read.stderr == ""
    assert "\n       --tool-speed-limit STR\n" in read.stdout


@pytest.mark.journey
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_verb_is_completed(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each verb is completed with its options, from the source of the help."""
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(verb in script for verb in _VERBS)
    assert "station-choice" in script


def test_help_is_converted_to_requests() -> None:
    """Headings, options with help, unwrapped examples, and paragraphs are converted."""
    text = (
        "Usage: basecal new CELL\n\nMake a cell.\n\n    basecal new c\n\n"
        "Parameters:\n  CELL -x: The cell.\n    more\n.dot\n"
    )
    assert list(_roff_lines(text)) == [
        ".PP", ".B Usage:", "basecal new CELL", ".PP", "Make a cell.", ".PP", ".br", "basecal new c", ".PP",
        ".PP", ".B Parameters:", ".TP", ".B CELL \\-x", "The cell.", "more", "\\&.dot",
    ]  # fmt: skip
