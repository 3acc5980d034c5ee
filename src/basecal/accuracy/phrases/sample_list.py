"""Text for lists of sample numbers."""

from __future__ import annotations

from collections.abc import Sequence

_SHOWN_RANGES = 10  # ranges shown before an ellipsis; assumed


def list_samples(numbers: Sequence[int]) -> str:
    """List samples in order, three or more consecutive ones as a range: "samples 1, 4 to 7"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    ranges = [text for run in runs for text in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else map(str, run))]
    shown = ", ".join(ranges[:_SHOWN_RANGES]) + (", ..." if len(ranges) > _SHOWN_RANGES else "")
    return f"sample {shown}" if len(numbers) == 1 else f"samples {shown}"
