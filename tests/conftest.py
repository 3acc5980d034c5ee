"""Fixtures of all tests; here, so that tests of every folder may `from derivatives import ...`."""

import numpy as np
import pytest


@pytest.fixture
def rng():
    """Random numbers, the same in every test."""
    return np.random.default_rng(20261121)
