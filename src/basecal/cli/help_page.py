"""Pages of `--help`: paragraphs are wrapped to the width of the terminal, and examples keep their lines."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from cyclopts.help import DefaultFormatter, HelpPanel, InlineText

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions

_LINE_END = re.compile(r"(?<=\S)\n(?=\S)")  # within a paragraph: the next line is neither blank nor indented


class HelpFormatter(DefaultFormatter):
    """Formatter of help from docstrings, whose lines end at the width of the source."""

    def __call__(self, console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
        """Print a panel of options, arguments or commands."""
        for entry in panel.entries:
            _join_lines(entry.description)
        super().__call__(console, options, panel)

    def render_description(self, console: Console, options: ConsoleOptions, description: object) -> None:
        """Print what a command does."""
        _join_lines(description)
        super().render_description(console, options, description)


def _join_lines(text: object) -> None:
    """Join the lines of each paragraph of a text."""
    from rich.text import Text

    if isinstance(text, InlineText) and isinstance(text.primary_renderable, Text):
        text.primary_renderable.plain = _LINE_END.sub(" ", text.primary_renderable.plain)
