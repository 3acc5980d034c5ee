"""Calibrations without stages on which nothing depends that a test file asserts: they take most of the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from basecal.accuracy import calibrate as calibrating
from basecal.accuracy.stages.case import Case

_LISTS = "SOLVING_STAGES", "JUDGING_STAGES"


@contextmanager
def skipping(*functions: Callable[[Case], Case]) -> Iterator[None]:
    """Calibrations within have no such stages."""
    stages = {name: getattr(calibrating, name) for name in _LISTS}
    missing = set(functions) - {stage.run for each in stages.values() for stage in each}
    assert not missing, f"no stage of a calibration: {missing}"
    with pytest.MonkeyPatch.context() as patch:
        for name, each in stages.items():
            patch.setattr(calibrating, name, tuple(stage for stage in each if stage.run not in functions))
        yield


def without_stages(*functions: Callable[[Case], Case]) -> Any:
    """A fixture of a test file, or of all files of a folder, whose calibrations have no such stages."""

    @pytest.fixture(scope="module", autouse=True)
    def shortened() -> Iterator[None]:
        with skipping(*functions):
            yield

    return shortened
