"""Fixtures of all tests; here, so that tests of every folder may `from derivatives import ...`."""

import gc
import os
import tempfile
from pathlib import Path

import numpy as np
import pytest

from basecal.simulation.arms import six_axis

os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="basecal-tests-")  # what these tests allow, no user did

gc.disable()  # until all is collected: nearly all that is made meanwhile stays


def pytest_collection_finish():
    """Leave what was imported and collected out of garbage collection: going through it again takes a tenth."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)  # hypothesis counts each collection, and little of what tests make is garbage
    gc.enable()


_TESTS = Path(__file__).parent
_JOURNEYS = {"journeys", "recipes", "torment"}  # folders whose tests are whole ways of users, or of their damaged files


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """What stands in these folders is a journey."""
    for item in items:
        if item.path.relative_to(_TESTS).parts[0] in _JOURNEYS:
            item.add_marker("journey")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One worker more than cores: tests of drivers and captures mostly wait."""
    return (os.cpu_count() or 1) + 1


@pytest.fixture
def rng():
    """Random numbers, the same in every test."""
    return np.random.default_rng(20261121)


@pytest.fixture
def arm():
    """A serial arm of six joints."""
    return six_axis()


@pytest.fixture
def joints():
    """Thirty postures of it, (30, 6) [rad]."""
    return np.random.default_rng(0).uniform(-2, 2, (30, 6))
