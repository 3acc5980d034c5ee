"""Places as they are typed."""

from __future__ import annotations

import pytest

from basecal.cli.task_point import split_numbers


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["--task-point", "0.8 -0.1 0.3", "--json"], ["--task-point", "0.8", "-0.1", "0.3", "--json"]),
        (["--task-point", "-1, 2, 3"], ["--task-point", "-1", "2", "3"]),
        (["--task-box=0 0 0 1 1 1"], ["--task-box", "0", "0", "0", "1", "1", "1"]),
        (["--task-point", "1", "2", "3"], ["--task-point", "1", "2", "3"]),
        (["plan", "a cell", "--output=b c"], ["plan", "a cell", "--output=b c"]),
        (["--task-point", ""], ["--task-point", ""]),
    ],
)
def test_quoted_numbers_come_apart(typed, words):
    """After the options that take several numbers, and nowhere else."""
    assert list(split_numbers(typed)) == words
