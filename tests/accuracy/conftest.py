"""Fixtures shared by the tests of calibration accuracy."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.shared.stages import skipping

from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.accuracy.stages.solving import screen_conventions

_HERE = Path(__file__).parent
_WHOLE = {"scene", "stages", "test_held_gauges.py", "test_touches.py"}
_OF_TASKS = {"task"}
_OF_CONVENTIONS = {
    *("arrays", "findings", "fixing", "input_check", "input_screening", "readings"),
    *("test_calibrate.py", "test_size_findings.py"),
}


@pytest.fixture(scope="module", autouse=True)
def needed_stages(request: pytest.FixtureRequest) -> Iterator[None]:
    """Skips the error at the task, and the search for mix-ups, in modules whose tests do not read them.

    Each takes a quarter of a calibration. Nothing depends on the former, and only refusals depend on the latter.
    """
    place = {request.path.name, request.path.relative_to(_HERE).parts[0]}
    rooms = {find_error_at_task: _OF_TASKS, screen_conventions: _OF_CONVENTIONS}
    with skipping(*(stage for stage, readers in rooms.items() if not place & (_WHOLE | readers))):
        yield
