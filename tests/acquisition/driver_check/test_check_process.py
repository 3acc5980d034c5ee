"""Tests of drivers measured in a separate process."""

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


def test_promises_are_sent_by_the_process() -> None:
    """Those of the other process equal those of this one."""
    assert list(measure_promises(FOLDER)) == [
        Promise("images come on demand", "a person or a program provides each", None)
    ]


@pytest.mark.parametrize(
    ("options", "message"), [({"path": "none"}, "there is no folder none"), ({"pathh": "."}, "pathh: unknown field")]
)
def test_driver_error_is_passed_unchanged(options: dict[str, Any], message: str) -> None:
    """The message is the driver's."""
    with pytest.raises(InputError, match=message):
        list(measure_promises(DriverCheck("folder", options=options, is_camera=True)))


def test_crashed_driver_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """A C++ library may crash on a length sent by a foreign device."""

    def crash(*words: object, **more: object) -> Iterator[object]:
        raise BoxError("ends the process that reads it (-6)")

    monkeypatch.setattr(check_process, "frames", crash)
    with pytest.raises(DriverError, match=r"^eye: its driver ends the process that reads it \(-6\)$"):
        list(measure_promises(DriverCheck("folder", "eye")))


def test_unknown_name_is_refused(tmp_path: Path) -> None:
    """An unknown name is an error with the existing ones of driver or cell."""
    assert find_opener(FOLDER)[1].name == "camera"
    (tmp_path / "cell.yaml").write_text(
        "schema: basecal/cell/1\nreference: eye\nrobots:\n  eye: {driver: {kind: typed}}\n"
    )
    assert find_opener(DriverCheck(str(tmp_path), "eye"))[1].options == {}
    with pytest.raises(UsageError, match="there are: eye"):
        find_opener(DriverCheck(str(tmp_path), "hand"))
    with pytest.raises(InputError, match="no driver and no cell"):
        find_opener(DriverCheck("folderr"))
