"""Tests of timing stages."""

from __future__ import annotations

import time

import pytest

from basecal.estimation.settings import Settings
from basecal.estimation.stages import Stages


def test_nested_stage_counts_for_the_outer_one() -> None:
    """Times of stages add up to the total: inner stages count once, as part of the outer one."""
    reported: list[str] = []
    settings = Settings(stages=Stages(reported.append))
    began = time.perf_counter()
    for _ in range(2):
        with settings.stage("outer"), settings.stage("inner"):
            time.sleep(0.01)
    with settings.stage("last"):
        time.sleep(0.01)
    took = time.perf_counter() - began
    assert settings.stages is not None
    seconds = settings.stages.seconds
    assert list(seconds) == ["outer", "last"]
    assert reported == ["outer", "outer", "last"]
    assert seconds["outer"] >= 0.02
    assert sum(seconds.values()) <= took


def test_failing_stage_is_closed() -> None:
    """After an error inside a stage the next one is counted under its own name."""
    stages = Stages()
    with pytest.raises(ValueError, match="no"), stages.stage("first"):
        raise ValueError("no")
    with stages.stage("second"):
        pass
    assert list(stages.seconds) == ["first", "second"]


def test_progress_within_a_stage_is_reported():
    """Each part is reported with the number of all, but not outside a stage or without a timer."""
    reported: list[str] = []
    settings = Settings(stages=Stages(reported.append))
    settings.report_progress(1, 2)
    with settings.stage("conventions"):
        settings.report_progress(1, 2)
    Settings().report_progress(1, 2)
    assert reported == ["conventions", "conventions, 1 of 2"]


def test_timer_is_no_part_of_the_settings() -> None:
    """Settings with a timer equal those without, and the file does not contain it."""
    assert Settings(stages=Stages()) == Settings()
    assert Settings(stages=Stages()).as_dict() == Settings().as_dict()
    assert "stages" not in Settings().as_dict()
