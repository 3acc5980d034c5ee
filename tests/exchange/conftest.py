"""What tests of these rooms share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.shared.boxed_here import boxed_here
from tests.shared.stages import without_stages

from basecal.accuracy.stages.concluding import find_error_at_task

_OF_PROCESSES = {"test_reader_process.py", "test_lerobot_films.py"}

no_error_at_task = without_stages(find_error_at_task)


@pytest.fixture(scope="module", autouse=True)
def read_here(request: pytest.FixtureRequest) -> Iterator[None]:
    """Files are read in this process, where the other one is not what is tested."""
    if request.path.name in _OF_PROCESSES:
        yield
        return
    with boxed_here():
        yield
