"""Tests of a calibration as the data of `calibration.json`: units, nulls and round trips."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.calibration import (
    BudgetEntry,
    Calibration,
    Certificate,
    ClockOffset,
    ErrorMap,
    Finding,
    LineTime,
    LocalFit,
    Loop,
    Outlier,
    Residuals,
    RobotParameters,
    SampleResidual,
    Validation,
)
from basecal.cell.results.calibration_dict import (
    _plain,
    budget_entry,
    calibration_from_dict,
    calibration_to_dict,
    finding_to_dict,
)
from basecal.errors import InputError
from basecal.fields.file_forms import LARGEST_NUMBER
from basecal.geometry import SE3, Camera, PoseEstimate

EMPTY = calibration_to_dict(Calibration("refused"))
DEGREE = math.radians(1)
FIT = Residuals(
    0.5,
    0.4,
    2e-3,
    3 * DEGREE,
    (SampleResidual(7, "eye", "board", 0.6, 4e-3, 5 * DEGREE),),
    (Loop(("a", "b"), 9, 6e-3, 7 * DEGREE),),
)
TESTED = Validation("k-fold", 5, 0.5, 8e-3, 9 * DEGREE, 1.5)


def test_units_are_millimetres_and_degrees():
    """Errors are written in millimetres and degrees, each in its own field."""
    data = calibration_to_dict(Calibration("good", residuals=FIT, validation=TESTED))
    fit, tested = data["residuals"], data["validation"]
    assert (fit["rms_px"], fit["median_px"]) == (0.5, 0.4)
    assert (fit["loop_rms_mm"], fit["loop_rms_deg"]) == pytest.approx((2.0, 3.0))
    one, loop = fit["per_sample"][0], fit["loops"][0]
    assert (one["sample"], one["camera"], one["target"], one["rms_px"]) == (7, "eye", "board", 0.6)
    assert (one["loop_mm"], one["loop_deg"]) == pytest.approx((4.0, 5.0))
    assert (loop["path"], loop["views"]) == (["a", "b"], 9)
    assert (loop["rms_mm"], loop["rms_deg"]) == pytest.approx((6.0, 7.0))
    assert (tested["target_mm"], tested["target_deg"], tested["base_change"]) == pytest.approx((8.0, 9.0, 1.5))


def test_units_are_read_as_metres_and_radians():
    """Errors are read back in metres and radians."""
    back = calibration_from_dict(calibration_to_dict(Calibration("good", residuals=FIT, validation=TESTED)))
    assert back.residuals.loop_rms_m == pytest.approx(2e-3)
    assert back.residuals.loop_rms_rad == pytest.approx(3 * DEGREE)
    assert back.residuals.per_sample[0].loop_m == pytest.approx(4e-3)
    assert back.residuals.per_sample[0].loop_rad == pytest.approx(5 * DEGREE)
    assert back.residuals.loops[0].rms_m == pytest.approx(6e-3)
    assert back.residuals.loops[0].rms_rad == pytest.approx(7 * DEGREE)
    assert back.validation.target_m == pytest.approx(8e-3)
    assert back.validation.target_rad == pytest.approx(9 * DEGREE)


def test_unknown_values_are_null():
    """Values that were not computed or are not finite are null; the data are plain JSON."""
    assert EMPTY["verdict"] == "refused"
    for key in ("joint", "outliers", "validation", "certificate", "link_parameters", "clock_offset_s", "clock_sigma_s"):
        assert EMPTY[key] is None
    noise = {"a": np.float64(0.5), "b": float("inf"), "c": np.array([1, np.nan]), "d": (True, {"e": None})}
    data = calibration_to_dict(Calibration("good", noise=noise, condition=np.inf))
    assert data["noise"] == {"a": 0.5, "b": None, "c": [1.0, None], "d": [True, {"e": None}]}
    assert data["observability"]["condition"] is None
    assert json.loads(json.dumps(data, allow_nan=False)) == data


def test_task_error_round_trip():
    """The budget and error map are in millimetres, percent and degrees and are read back. Each point needs an error."""
    points, errors = np.array([[0.1, 0.2, 0.3], [1.0, 0, 0]]), np.array([1e-3, 2e-3])
    given = Calibration(
        "good", budget=(BudgetEntry("views of a", 3e-4, 0.25, 5e-4),), error_map=ErrorMap(points, errors, errors)
    )
    data = json.loads(json.dumps(calibration_to_dict(given)))
    (entry,) = data["budget"]
    assert entry == pytest.approx({"source": "views of a", "mm": 0.3, "percent": 25.0, "total_mm_if_halved": 0.5})
    assert data["error_map"]["mm_95"] == pytest.approx([1.0, 2.0])
    assert data["error_map"]["deg_95"] == pytest.approx(np.degrees(errors).tolist())
    back = calibration_from_dict(data)
    assert back.budget[0].rms_m == pytest.approx(3e-4)
    np.testing.assert_allclose(back.error_map.points_m, points)
    np.testing.assert_allclose(back.error_map.angle_95_rad, errors)
    with pytest.raises(InputError, match="error_map"):
        calibration_from_dict({**data, "error_map": {**data["error_map"], "mm_95": [1.0]}})


def test_local_fits_round_trip():
    """Local fits in millimetres with their poses are read back the same, also if the error is unknown."""
    poses = {"a_from_b": SE3.from_rpy((0.1, 0.2, 0.3), (1.0, 2.0, 3.0))}
    parts = (
        LocalFit(np.array([0.1, 0.2, 0.3]), (0, 4), 2e-3, 1e-3, 0.01, True, poses),
        LocalFit(np.zeros(3), (1,), None, None, 1.0, False, {}),
    )
    data = json.loads(json.dumps(calibration_to_dict(Calibration("good", local=parts))))
    assert [part["recommended"] for part in data["local"]] == ["local", "global"]
    assert (data["local"][0]["global_mm"], data["local"][1]["local_mm"]) == (2.0, None)
    first, second = calibration_from_dict(data).local
    assert (first.samples, first.local_m, first.chance, second.global_m) == ((0, 4), 1e-3, 0.01, None)
    np.testing.assert_allclose(first.transforms["a_from_b"].matrix, poses["a_from_b"].matrix, atol=1e-12)
    with pytest.raises(InputError, match="local"):
        calibration_from_dict({**data, "local": [{**data["local"][0], "recommended": "both"}]})


def test_line_times_round_trip():
    """Each camera has a line time and its sigma; a missing sigma is reported."""
    lines = {"wrist": LineTime(1.5e-5, 2e-7)}
    data = json.loads(json.dumps(calibration_to_dict(Calibration("good", line_times=lines))))
    assert (data["line_time_s"], data["line_time_sigma_s"]) == ({"wrist": 1.5e-5}, {"wrist": 2e-7})
    assert calibration_from_dict(data).line_times == lines
    with pytest.raises(InputError, match="line_time_sigma_s"):
        calibration_from_dict({**data, "line_time_sigma_s": None})


def test_clock_offsets_round_trip():
    """Each device has an offset and its sigma, also for clocks that count from another day."""
    clocks = {"wrist": ClockOffset(-0.017, 3e-4), "arm": ClockOffset(1.6e9, 0.0)}
    data = json.loads(json.dumps(calibration_to_dict(Calibration("good", clocks=clocks))))
    assert data["clock_offset_s"] == {"wrist": -0.017, "arm": 1.6e9}
    assert data["clock_sigma_s"] == {"wrist": 3e-4, "arm": 0.0}
    assert calibration_from_dict(data).clocks == clocks
    with pytest.raises(InputError, match="clock_sigma_s"):
        calibration_from_dict({**data, "clock_sigma_s": {"wrist": 3e-4}})


def test_transforms_and_lenses_round_trip():
    """The covariance of a point is that of its position; all values are read back the same."""
    covariance = np.diag(np.arange(1.0, 7.0))
    estimates = {
        name: PoseEstimate(SE3.from_rotvec([0, 0, 0.5], [1, 2, 3]), covariance) for name in ("a_from_b", "c_from_p")
    }
    lens = Camera("pinhole", np.array([500.0, 510, 320, 240, 0.1, 0, 0, 0]), (640, 480))
    given = Calibration(
        "doubtful",
        estimates,
        status={"a_from_b": "prior", "c_from_p": "free"},
        points=frozenset({"c_from_p"}),
        cameras={"eye": (lens, np.eye(8))},
        order=("a_from_b",),
        joint_covariance=covariance,
        outliers=(Outlier(3, "eye", "board", (1, 2), "far off", "images/eye/4.png"),),
        certificate=Certificate(1e-5, True),
        unobservable=("a direction",),
        findings=(Finding("poor-fit", "warning", ("eye",), "words"),),
    )
    data = calibration_to_dict(given)
    assert np.shape(data["transforms"]["c_from_p"]["covariance"]) == (3, 3)
    back = calibration_from_dict(data)
    np.testing.assert_array_equal(back["a_from_b"].covariance, covariance)
    np.testing.assert_array_equal(back["c_from_p"].covariance, np.diag([1.0, 2, 3, 0, 0, 0]))
    np.testing.assert_allclose(back["a_from_b"].mean.matrix, estimates["a_from_b"].mean.matrix, atol=1e-15)
    np.testing.assert_array_equal(back.joint_covariance, covariance)
    np.testing.assert_array_equal(back.cameras["eye"][0].parameters, lens.parameters)
    assert back.cameras["eye"][0].size_px == (640, 480)
    assert back.status == given.status
    for name in ("verdict", "points", "order", "outliers", "certificate", "unobservable", "findings"):
        assert getattr(back, name) == getattr(given, name)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "basecal/calibration/2"}, "expected the schema basecal/calibration/1.*got 'basecal/calibration/2'"),
        ({"verdict": "fine"}, "verdict: expected 'good', 'doubtful' or 'refused', got 'fine'"),
        ({"joint": {"order": [], "covariance": [[1.0, 2.0]]}}, "expected a square"),
        ({"residuals": None}, "residuals: expected a mapping"),
        ({"observability": {}}, "observability.condition: missing; add it; calibrate again"),
    ],
)
def test_invalid_calibration_data_is_refused(change, message):
    """The error states the problem and what to do."""
    with pytest.raises(InputError, match=message):
        calibration_from_dict(EMPTY | change)


@pytest.mark.parametrize(
    ("key", "of_arm"),
    [("joint_offsets_seen", [True] * 3), ("joint_names", ["a", 2])],
)
def test_robot_parameter_lists_must_match(key, of_arm):
    """A list of a wrong length, or an invalid joint name, is refused if everything else is valid."""
    two = np.array([0.1, 0.2])
    offsets = RobotParameters(("a", "b"), two, two, np.ones(2, dtype=bool), np.eye(2))
    data = calibration_to_dict(Calibration("good", robot_parameters={"joint_offsets": {"arm": offsets}}))
    assert calibration_from_dict(data).robot_parameters["joint_offsets"]["arm"].joints == ("a", "b")
    with pytest.raises(InputError, match="joint_offsets of 'arm': expected a value, a sigma"):
        calibration_from_dict(data | {key: {"arm": of_arm}})


def test_list_in_place_of_mapping_is_refused():
    """A list has no schema, so it is refused."""
    with pytest.raises(InputError, match="got 'list'"):
        calibration_from_dict([])


def test_finding_has_parts_and_joined_message():
    """A finding has a code, a severity, its subjects, the three parts of its text, and the joined message."""
    assert finding_to_dict(Finding("a", "info", ("b", "c"), "What.", ("Do.", "Or that."), "Why.")) == {
        "code": "a",
        "severity": "info",
        "about": ["b", "c"],
        "what": "What.",
        "why": "Why.",
        "do": ["Do.", "Or that."],
        "message": "What. Why. Do. Or that.",
    }


def test_budget_entry_is_in_millimetres_and_percent():
    """A budget entry is written as in the budget of a calibration."""
    entry = BudgetEntry("noise of eye", 2e-3, 0.25, 3e-3)
    written = budget_entry(entry)
    assert written == {"source": "noise of eye", "mm": 2.0, "percent": 25.0, "total_mm_if_halved": 3.0}
    assert calibration_to_dict(Calibration("good", budget=(entry,)))["budget"] == [written]


def test_non_finite_numbers_become_null():
    """Non-finite numbers become null in arrays and elsewhere; integers, text and booleans are kept."""
    assert _plain(np.array([[1.5, np.nan], [np.inf, -2.0]])) == [[1.5, None], [None, -2.0]]
    assert _plain({1: (np.float64(0.5), np.int64(3), True, None, "a"), "b": {4}}) == {
        "1": [0.5, 3, True, None, "a"], "b": [4],
    }  # fmt: skip
    assert _plain([np.array([1, 2]), np.array([True]), Path("a"), 2 * LARGEST_NUMBER, -2 * LARGEST_NUMBER]) == [
        [1, 2], [True], "a", None, None,
    ]  # fmt: skip
    assert _plain(np.array([LARGEST_NUMBER, -LARGEST_NUMBER])) == [LARGEST_NUMBER, -LARGEST_NUMBER]
