"""Options that several verbs take alike."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cli import main


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["view", "CELL", "--port", "65536"], "65535"),
        (["capture", "CELL", "--port", "-1"], "0"),
        (["plan", "CELL", "--samples", "4", "--seed", "-1"], "0"),
        (["simulate", "CELL", "--seed", str(2**63)], str(2**63 - 1)),
        (["export", "CELL", "--to", "ros2", "--publish", "--domain", "233"], "232"),
        (["new", "CELL", "--from", "ros2", "--domain", "233"], "232"),
        (["plan", "CELL", "--samples", "1001"], "1000"),
    ],
)
def test_a_number_out_of_range_is_wrong_usage(
    tmp_path: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The limit is named, and nothing is written."""
    assert main([str(tmp_path / "c") if word == "CELL" else word for word in words]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
