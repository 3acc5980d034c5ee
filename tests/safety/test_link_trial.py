"""Tests of the rule by which a trial of a link counts a stop as in time."""

from __future__ import annotations

import pytest

from tests.safety.link_trial import ARMS, Trial, _outcome, faults_found

ERROR = "right: its connection was closed (Broken pipe). left confirmed the stop."
FIRST_CUT_S, FAULT_S = 9.5, 10.0


@pytest.mark.parametrize(("stop_s", "is_told"), [(FIRST_CUT_S - 0.1, False), (9.6, True), (10.5, True), (14.0, False)])
def test_stop_counts_from_the_first_cut(stop_s, is_told):
    """If a link is cut twice, the other arm may stop before the second cut; a stop before the first does not count."""
    trial = Trial("cut", "right", ARMS, "reconnecting", 0)
    cuts = [(FIRST_CUT_S, "fault cut"), (FAULT_S, "fault cut")]
    outcome = _outcome(trial, {"left": [(stop_s, "stop")], "right": cuts}, FAULT_S, 0.8, ERROR)
    assert (faults_found(trial, outcome) == []) is is_told


def test_move_after_the_first_cut_is_a_failure():
    """No goal may be sent while a lost link is re-established."""
    trial = Trial("cut", "right", ARMS, "reconnecting", 0)
    log = {"left": [(9.7, "move"), (10.5, "stop")], "right": [(FIRST_CUT_S, "fault cut"), (FAULT_S, "fault cut")]}
    assert faults_found(trial, _outcome(trial, log, FAULT_S, 0.8, ERROR)) == ["1 moves were sent afterwards"]
