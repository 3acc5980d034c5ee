"""Tests of failing links and controllers: the other arm is stopped at once, and no goal is sent afterwards."""

from __future__ import annotations

import pytest

from safety.installed_driver import installed_driver
from shared.second_process import TESTS
from tests.safety.link_trial import ARMS, FAULTS, PHASES, Trial, attempt, faults_found

pytestmark = pytest.mark.timed


@pytest.fixture(scope="module", autouse=True)
def _frail(tmp_path_factory):
    """Install the driver of the trials as pip does."""
    with installed_driver(tmp_path_factory.mktemp("packages"), "frail", TESTS / "safety" / "frail_driver.py"):
        yield


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_in_every_phase(fault, phase):
    """Each fault and phase has an arm and an order drawn by seed; `benchmarks.stops` tries all combinations."""
    seed = FAULTS.index(fault) + 10 * PHASES.index(phase)
    trial = Trial(fault, ARMS[seed % 2], ARMS if seed // 2 % 2 else ARMS[::-1], phase, seed)
    # A machine that does other work may miss a deadline once: what is broken, is broken twice.
    assert faults_found(trial, attempt(trial)) == [] or faults_found(trial, attempt(trial)) == []
