"""What some views say of held-out samples is what all of them do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.cross_validation import some_views
from basecal.accuracy.cross_validation.some_views import thin_solution
from basecal.accuracy.cross_validation.validation import cross_validate
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve
from basecal.simulation import Scenario, simulate

STATED = Settings(robot_noise="stated")


@pytest.mark.parametrize("pixel_noise", [True, False])
def test_held_out_errors_are_alike(pixel_noise: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of the views has a covariance three times as large, and the same held-out error to a tenth."""
    made = simulate(replace(Scenario(samples=120, robot_noise=(1e-4, 2e-4)), state_pixel_noise=pixel_noise), 3)
    whole = solve(made.cell, made.recording, STATED)
    assert thin_solution(whole, STATED) is whole
    monkeypatch.setattr(some_views, "MANY_VIEWS", 40)
    few = thin_solution(whole, STATED)
    assert [len(group) for group in few.problem.groups] == [40]
    name = "eye_base_from_hand_base"
    sizes = [np.sqrt(np.diag(each.joint_transform_covariance([name]))) for each in (whole, few)]
    assert 1.5 < np.median(sizes[1] / sizes[0]) < 2.0
    off = (whole.state.transforms[name].inverse() @ few.state.transforms[name]).log()
    assert np.all(np.abs(off) < 4 * sizes[1])
    errors = [_held_out_px(each, name) for each in (whole, few)]
    assert errors[1] == pytest.approx(errors[0], rel=0.1)


def _held_out_px(solution: Solution, name: str) -> float:
    found = cross_validate(solution, [name], STATED)
    assert found is not None
    assert found.summary is not None
    assert found.summary.rms_px is not None
    return found.summary.rms_px


def test_what_has_no_optimum_by_some_is_by_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where some of the views do not settle, all of them are used."""
    made = simulate(Scenario(samples=30), 0)
    whole = solve(made.cell, made.recording, STATED)
    monkeypatch.setattr(some_views, "MANY_VIEWS", 10)
    monkeypatch.setattr(some_views, "solve_at_mode", lambda *of: replace(whole, converged=False))
    assert thin_solution(whole, STATED) is whole
