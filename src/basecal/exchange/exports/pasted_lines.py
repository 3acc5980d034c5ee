"""Exporters of transforms as lines to paste, those of each below a comment."""

from __future__ import annotations

from collections.abc import Callable

from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import NamedTransform, Wanted


def pasted_lines(
    words: str, mark: str, units: str, lines_of: Callable[[NamedTransform, Wanted], list[str]]
) -> Exporter:
    """An exporter of transforms as lines to paste.

    Args:
        words: What it gives, for help.
        mark: What begins a comment.
        units: Of the numbers, in words.
        lines_of: Lines of a transform, given the whole request too.
    """

    def text(request: Wanted) -> str:
        """Remarks, then each transform below its comment."""
        lines = comments(request.remarks, mark)
        for one in request.transforms:
            lines += comments([describe_transform(one, units)], mark) + lines_of(one, request)
        return "\n".join(lines) + "\n"

    return Exporter(words, text, is_pasted=True)
