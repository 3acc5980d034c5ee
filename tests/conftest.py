"""Fixtures of all tests; they stand here so that tests of every folder may `from derivatives import ...`."""

import gc
import os
import tempfile
from pathlib import Path

import numpy as np
import pytest

from basecal.simulation.arms import six_axis

os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(
    prefix="basecal-tests-"
)  # permissions that tests store stay out of the home of the user

gc.disable()  # until all tests are collected: nearly all objects made meanwhile stay


def pytest_collection_finish():
    """Leave imported modules and collected tests out of garbage collection, which takes a tenth of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)  # hypothesis counts each collection, and tests make little garbage
    gc.enable()


_TESTS = Path(__file__).parent
_JOURNEYS = {"journeys", "recipes", "torment"}  # folders of tests of whole workflows, or of damaged files


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the tests in the folders of `_JOURNEYS` as journeys."""
    for item in items:
        if item.path.relative_to(_TESTS).parts[0] in _JOURNEYS:
            item.add_marker("journey")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One worker more than cores, because tests of drivers and captures mostly wait."""
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
    """Thirty postures of the arm, (30, 6) [rad]."""
    return np.random.default_rng(0).uniform(-2, 2, (30, 6))
