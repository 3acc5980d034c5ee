"""Calibrations without stages that a test file does not need: these take most of the time."""

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
    """Run calibrations without these stages within the context."""
    stages = {name: getattr(calibrating, name) for name in _LISTS}
    missing = set(functions) - {stage.run for each in stages.values() for stage in each}
    assert not missing, f"no stage of a calibration: {missing}"
    with pytest.MonkeyPatch.context() as patch:
        for name, each in stages.items():
            patch.setattr(calibrating, name, tuple(stage for stage in each if stage.run not in functions))
        yield


def without_stages(*functions: Callable[[Case], Case]) -> Any:
    """A fixture of a test file, or of a folder, that runs calibrations without these stages."""

    @pytest.fixture(scope="module", autouse=True)
    def skip_stages() -> Iterator[None]:
        with skipping(*functions):
            yield

    return skip_stages
