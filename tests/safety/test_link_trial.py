"""What a trial of a link counts as told in time."""

from __future__ import annotations

import pytest

from tests.safety.link_trial import ARMS, Trial, _outcome, faults_found

ERROR = "right: its connection was closed (Broken pipe). left confirmed the stop."
FIRST_CUT_S, FAULT_S = 9.5, 10.0


@pytest.mark.parametrize(("stop_s", "is_told"), [(FIRST_CUT_S - 0.1, False), (9.6, True), (10.5, True), (14.0, False)])
def test_a_stop_counts_from_the_first_cut_on(stop_s, is_told):
    """A link that is cut twice may stop the other arm before the second cut; a stop before the first is not for it."""
    trial = Trial("cut", "right", ARMS, "reconnecting", 0)
    cuts = [(FIRST_CUT_S, "fault cut"), (FAULT_S, "fault cut")]
    outcome = _outcome(trial, {"left": [(stop_s, "stop")], "right": cuts}, FAULT_S, 0.8, ERROR)
    assert (faults_found(trial, outcome) == []) is is_told


def test_a_move_after_the_first_cut_breaks_a_promise():
    """Nothing is sent while a lost link is tried again."""
    trial = Trial("cut", "right", ARMS, "reconnecting", 0)
    log = {"left": [(9.7, "move"), (10.5, "stop")], "right": [(FIRST_CUT_S, "fault cut"), (FAULT_S, "fault cut")]}
    assert faults_found(trial, _outcome(trial, log, FAULT_S, 0.8, ERROR)) == ["1 moves were sent afterwards"]
