"""Fixtures shared by the tests of the exchange with other programs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.shared.boxed_here import boxed_here
from tests.shared.stages import without_stages

from basecal.accuracy.stages.concluding import find_error_at_task

_OF_PROCESSES = {"test_reader_process.py", "test_lerobot_films.py", "test_workbook.py"}

no_error_at_task = without_stages(find_error_at_task)


@pytest.fixture(scope="module", autouse=True)
def read_here(request: pytest.FixtureRequest) -> Iterator[None]:
    """Read files in this process, except in tests of the reader process itself."""
    if request.path.name in _OF_PROCESSES:
        yield
        return
    with boxed_here():
        yield
