"""`basecal demo`, but for its running, which the tests of captures and the recipes have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cli import main
from basecal.cli.demo import _comparison, true_error
from basecal.geometry import SE3, PoseEstimate


def test_the_true_error_is_in_the_answers_own_sigmas() -> None:
    """A step of one sigma along one axis and of two about another is five squared sigmas."""
    covariance = np.diag(np.array([1e-3, 2e-3, 1e-3, 1e-2, 1e-2, 2e-2]) ** 2)
    mean = SE3.from_rpy([0.3, -0.2, 1.0], [1.0, 2.0, 0.5])
    truth = mean @ SE3.exp(np.array([0, 2e-3, 0, 2e-2, 0, 0]))
    error = true_error(PoseEstimate(mean, covariance), truth)
    assert error["squared_sigmas"] == pytest.approx(5.0)
    assert error["error_mm"] == pytest.approx(2.0)
    assert error["error_deg"] == pytest.approx(np.degrees(0.02))


def test_a_cell_of_somebody_else_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only what a demo made is made anew."""
    assert main(["new", str(tmp_path / "c")]) == 0
    text = (tmp_path / "c" / "cell.yaml").read_text()
    assert main(["demo", str(tmp_path / "c")]) == 3
    assert "is not overwritten" in capsys.readouterr().err
    assert (tmp_path / "c" / "cell.yaml").read_text() == text


def test_the_truth_is_compared_with_the_digits_of_sigma() -> None:
    """And with the limit of chi-square in words."""
    estimate = PoseEstimate(SE3.identity(), np.diag(np.array([1e-3, 2e-3, 1e-3, 1e-2, 1e-2, 2e-2]) ** 2))
    lines = _comparison(estimate, true_error(estimate, SE3.exp(np.array([0, 2e-3, 0, 0, 0, 0]))), "b").splitlines()
    assert lines[2].split() == ["true", "error", "0.0", "2.0", "0.0", "mm"]
    assert lines[4].split() == ["in", "sigmas", "0.00", "1.00", "0.00"]
    assert lines[-1] == "  chi-square 1.0 with 6 degrees of freedom (99 % limit 16.8): consistent"
    far = _comparison(estimate, true_error(estimate, SE3.exp(np.array([0.1, 0, 0, 0, 0, 0]))), "b")
    assert far.endswith("inconsistent")
