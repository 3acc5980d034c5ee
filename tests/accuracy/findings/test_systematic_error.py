"""Errors that are no noise, in words with their sizes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings.systematic_error import systematic_error
from basecal.accuracy.systematic_errors.search import SystematicError


def told(code, size, sigma, **kind):
    """The finding about an error of `hand` of this size."""
    usual = {"about": "hand", "is_camera": False, "is_target": False, "since": None, "unit": "s"}
    size = np.atleast_1d(size)
    error = SystematicError(code, size=size, covariance=sigma**2 * np.eye(len(size)), log_chance=-50.0, **usual | kind)
    (finding,) = systematic_error(SimpleNamespace(systematic_error=error))
    assert (finding.code, finding.severity, finding.about) == (code, "warning", (error.about,))
    return finding.message


def test_without_one_nothing_is_said():
    """No finding."""
    assert systematic_error(SimpleNamespace(systematic_error=None)) == []


@pytest.mark.parametrize(
    ("size", "is_target", "words"),
    [
        (0.012, True, "hand is 1.20 +/- 0.10 % larger than stated"),
        (-0.012, True, "hand is 1.20 +/- 0.10 % smaller than stated"),
        (0.012, False, "poses of hand are 1.20 +/- 0.10 % too short"),
        (-0.012, False, "poses of hand are 1.20 +/- 0.10 % too long"),
    ],
)
def test_lengths(size, is_target, words):
    """Of a target or of an arm, in percent."""
    assert told("length-scale", size, 1e-3, is_target=is_target).startswith(words)


@pytest.mark.parametrize(
    ("size", "is_camera", "unit", "words"),
    [
        (0.034, False, "s", "poses of hand lag behind the other devices by 34.0 +/- 2.0 ms"),
        (-0.034, False, "s", "poses of hand run ahead of the other devices by 34.0 +/- 2.0 ms"),
        (0.034, True, "s", "images of hand run ahead of the other devices by 34.0 +/- 2.0 ms"),
        (-0.034, True, "samples", "images of hand lag behind the other devices by 0.0340 +/- 0.0020 samples"),
    ],
)
def test_clocks(size, is_camera, unit, words):
    """Of images or poses, in milliseconds or samples."""
    assert told("clock-offset", size, 2e-3, is_camera=is_camera, unit=unit).startswith(words)


def test_moves():
    """By a length and an angle with their sigmas: at a sample, or all along."""
    size = np.array([3e-3, 4e-3, 0, 0, 0, np.pi / 180])
    assert told("base-moved", size, 1e-4, since=12).startswith(
        "hand moved by 5.00 +/- 0.10 mm and 1.0000 +/- 0.0057 deg at about sample 12:"
    )
    assert told("drift", size, 1e-4).startswith("hand drifts, by 5.00 +/- 0.10 mm and 1.0000 +/- 0.0057 deg from the")


def test_bends():
    """By milliradians a metre."""
    assert told("deflection", np.array([3e-3, 4e-3]), 1e-4).startswith("hand bends by 5.00 +/- 0.10 mrad per metre")
