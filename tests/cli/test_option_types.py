"""Tests of options that several verbs share."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import pytest

from basecal.cli import main
from basecal.cli.option_types import Domain, Port, Seed, task_points
from basecal.errors import InputError, UsageError

BOX = (0.6, -0.2, 0.1, 1.0, 0.2, 0.5)


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
def test_number_out_of_range_is_wrong_usage(
    tmp_path: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The message names the limit, and no file is written."""
    assert main([str(tmp_path / "c") if word == "CELL" else word for word in words]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_place_is_a_point_or_a_box():
    """A box is represented by its centre first, then by its corners."""
    assert task_points((1.0, 2.0, 3.0), None) == [(1.0, 2.0, 3.0)]
    points = task_points(None, BOX)
    assert points[0] == pytest.approx((0.8, 0.0, 0.3))
    assert {BOX[:3], BOX[3:]} < set(points[1:])


@pytest.mark.parametrize(("point", "box"), [(None, None), ((1.0, 2.0, 3.0), BOX)])
def test_neither_point_nor_box_and_both_are_refused(point, box):
    with pytest.raises(UsageError, match="either --task-point x y z or --task-box"):
        task_points(point, box)


def test_box_without_volume_is_refused():
    """It is refused before any file is read: no sample is inside."""
    with pytest.raises(InputError, match="differ in x, in y and in z"):
        task_points(None, (0.6, -0.2, 0.1, 1.0, 0.2, 0.1))


@pytest.mark.parametrize(("kind", "most"), [(Seed, 2**63 - 1), (Port, 65535), (Domain, 232)])
def test_numbers_up_to_their_limits_are_accepted(kind: Any, most: int) -> None:
    """The range begins at zero."""
    _, parameter = get_args(kind)
    (check,) = parameter.validator
    for number in (0, 1, most):
        check(int, number)
    for number in (-1, most + 1):
        with pytest.raises(ValueError, match="Must be"):
            check(int, number)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["plan", "CELL", "--samples", "4", "--hold-s", "1"], "no robot's program is written: leave --hold-s out"),
        (["plan", "CELL", "--samples", "4", "--speed-limit-deg-s", "9"], "leave --speed-limit-deg-s out"),
        (
            ["plan", "CELL", "--samples", "4", "--touches", "--pattern", "shifts"],
            "--pattern has no effect on --touches",
        ),
        (["simulate", "CELL", "--process", "--samples", "9", "--images"], "records nothing: leave --samples, --images"),
        (["simulate", "CELL", "--process", "--joint-offset-deg", "1"], "leave --joint-offset-deg out"),
        (["simulate", "CELL", "--speed", "0", "--fault", "backlash"], "no cell runs: leave --speed, --fault out"),
        (["simulate", "CELL", "--until-eof"], "leave --until-eof out"),
    ],
)
def test_options_without_effect_are_refused(
    tmp_path: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The message names them; no cell is read or made."""
    assert main([str(tmp_path / "cell") if word == "CELL" else word for word in words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()
