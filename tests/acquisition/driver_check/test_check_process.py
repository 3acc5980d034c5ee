"""Tests of drivers measured in a separate process."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from basecal.acquisition.driver import DriverKind, Place, Reading
from basecal.acquisition.driver_check import check_process
from basecal.acquisition.driver_check.check_process import DriverCheck, find_opener, measure_promises
from basecal.acquisition.driver_check.promises import Promise
from basecal.box import BoxError
from basecal.cell import Cell, Robot, RobotState
from basecal.errors import DriverError, InputError, UsageError
from basecal.simulation.arms import six_axis

FOLDER = DriverCheck("folder", options={"path": "."}, is_camera=True)


@pytest.mark.journey
def test_promises_are_sent_by_the_process() -> None:
    """Those of the other process equal those of this one."""
    assert list(measure_promises(FOLDER)) == [
        Promise("images come on demand", "a person or a program provides each", None)
    ]


@pytest.mark.journey
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


def test_joints_are_those_of_the_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver that keeps all promises, and reports three joints of six, is refused as a capture refuses it."""

    class Arm:
        is_live = True

        def state(self) -> Reading:
            return Reading(time.monotonic(), RobotState(joints_rad=np.zeros(3)))

        def close(self) -> None:
            pass

    place = Place("eye", Cell("eye", {"eye": Robot("eye", chain=six_axis())}), Path("."))
    kind = DriverKind(open_robot=lambda _: Arm())
    monkeypatch.setattr(check_process, "find_opener", lambda _: (kind, place))
    with pytest.raises(DriverError, match=r"^eye: its driver reports 3 joints, its chain in cell\.yaml has 6"):
        list(check_process._measure(DriverCheck("mycell", "eye")))


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
