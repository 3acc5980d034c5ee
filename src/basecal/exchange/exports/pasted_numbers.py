"""Exporters of poses that are pasted as a controller's own numbers, each below a comment."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from basecal.exchange.controllers.convention import Convention
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def pasted_numbers(
    words: str, convention: Convention, mark: str, units: str, lines_of: Callable[[Sequence[str]], list[str]]
) -> Exporter:
    """An exporter of transforms in a controller's numbers.

    Args:
        words: What it gives, for help.
        convention: The controller's.
        mark: What begins a comment.
        units: Of the numbers, in words.
        lines_of: Lines of the program, given the numbers of a pose.
    """

    def text(request: Wanted) -> str:
        """Remarks, then each transform below its comment."""
        lines = comments(request.remarks, mark)
        for one in request.transforms:
            lines += comments([describe_transform(one, units)], mark) + lines_of(
                written_numbers(convention, one.estimate)
            )
        return "\n".join(lines) + "\n"

    return Exporter(words, text, is_pasted=True)
