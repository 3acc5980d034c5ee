"""Rolling shutters in `cell.yaml`."""

import pytest
from pydantic import ValidationError

from basecal.cell import RollingShutter
from basecal.cell.schema.rolling_shutter import RollingShutterEntry, rolling_shutter_dict


@pytest.mark.parametrize(
    "data", [{"line_time_s": 1.5e-5}, {"status": "free"}, {"status": "prior", "line_time_s": -2e-5, "sigma_s": 1e-6}]
)
def test_what_is_stated_comes_back(data: dict[str, object]) -> None:
    shutter = RollingShutterEntry.model_validate(data).noun()
    assert RollingShutterEntry.model_validate(rolling_shutter_dict(shutter)["rolling_shutter"]).noun() == shutter
    assert shutter == RollingShutter(**data)


def test_nothing_stated_is_nothing_written() -> None:
    assert rolling_shutter_dict(None) == {}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({}, "status fixed takes line_time_s, the time from a row to the next"),
        ({"status": "prior", "line_time_s": 1e-5}, "status prior takes sigma_s"),
        ({"line_time_s": 1e-5, "sigma_s": 1e-6}, "status fixed takes no sigma_s"),
        ({"line_time_s": 0.015}, "less than or equal"),
        ({"line_time_ms": 0.015}, "line_time_ms"),
    ],
)
def test_what_is_wrong_is_said(data: dict[str, object], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        RollingShutterEntry.model_validate(data)
