"""Clocks in `cell.yaml`."""

import pytest
from pydantic import ValidationError

from basecal.cell import Clock
from basecal.cell.schema.cell_schema import RobotEntry
from basecal.cell.schema.clock import ClockEntry, clock_dict


@pytest.mark.parametrize(
    "data", [{}, {"offset_s": 0.5}, {"status": "free"}, {"status": "prior", "offset_s": 0.01, "sigma_s": 0.002}]
)
def test_what_is_stated_comes_back(data: dict[str, object]) -> None:
    clock = ClockEntry.model_validate(data).noun()
    assert ClockEntry.model_validate(clock_dict(clock)["clock"]).noun() == clock
    assert clock == Clock(**data)


def test_nothing_stated_is_nothing_written() -> None:
    assert clock_dict(None) == {}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"status": "prior"}, "status prior takes sigma_s"),
        ({"status": "free", "sigma_s": 0.1}, "status free takes no sigma_s"),
        ({"offset_s": 1e13}, "less than or equal"),
        ({"status": "prior", "sigma_s": 0.0}, "sigma_s"),
        ({"lag_s": 1.0}, "lag_s"),
    ],
)
def test_what_is_wrong_is_said(data: dict[str, object], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        ClockEntry.model_validate(data)


def test_jitter_comes_back_and_is_of_cameras_alone() -> None:
    clock = ClockEntry.model_validate({"offset_s": 0.01, "jitter_s": 0.002}).noun()
    assert clock.jitter_s == 0.002
    assert ClockEntry.model_validate(clock_dict(clock)["clock"]).noun() == clock
    with pytest.raises(ValidationError, match="jitter_s stands at the clock of a camera"):
        RobotEntry.model_validate({"clock": {"jitter_s": 0.002}})
    with pytest.raises(ValidationError, match="jitter_s"):
        ClockEntry.model_validate({"jitter_s": 2.0})
