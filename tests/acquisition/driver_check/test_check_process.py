"""Drivers measured in a process of their own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from basecal.acquisition.driver_check import check_process
from basecal.acquisition.driver_check.check_process import DriverCheck, find_opener, measure_promises
from basecal.acquisition.driver_check.promises import Promise
from basecal.box import BoxError
from basecal.errors import DriverError, InputError, UsageError

FOLDER = DriverCheck("folder", options={"path": "."}, is_camera=True)


def test_promises_come_as_they_are_measured() -> None:
    """Out of the other process, equal to those of this one."""
    assert list(measure_promises(FOLDER)) == [
        Promise("images come on demand", "a person or a program provides each", None)
    ]


@pytest.mark.parametrize(
    ("options", "message"), [({"path": "none"}, "there is no folder none"), ({"pathh": "."}, "pathh: unknown field")]
)
def test_errors_of_a_driver_are_those_of_its_process(options: dict[str, Any], message: str) -> None:
    """In the driver's words."""
    with pytest.raises(InputError, match=message):
        list(measure_promises(DriverCheck("folder", options=options, is_camera=True)))


def test_a_driver_that_crashes_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a library of C++ does on a length that a stranger sent."""

    def crash(*words: object, **more: object) -> Iterator[object]:
        raise BoxError("ends the process that reads it (-6)")

    monkeypatch.setattr(check_process, "frames", crash)
    with pytest.raises(DriverError, match=r"^eye: its driver ends the process that reads it \(-6\)$"):
        list(measure_promises(DriverCheck("folder", "eye")))


def test_a_place_is_of_a_driver_or_of_a_cell(tmp_path: Path) -> None:
    """A name that neither has is an error with those that are there."""
    assert find_opener(FOLDER)[1].name == "camera"
    (tmp_path / "cell.yaml").write_text(
        "schema: basecal/cell/1\nreference: eye\nrobots:\n  eye: {driver: {kind: typed}}\n"
    )
    assert find_opener(DriverCheck(str(tmp_path), "eye"))[1].options == {}
    with pytest.raises(UsageError, match="there are: eye"):
        find_opener(DriverCheck(str(tmp_path), "hand"))
    with pytest.raises(InputError, match="no driver and no cell"):
        find_opener(DriverCheck("folderr"))
