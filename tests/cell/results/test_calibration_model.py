"""Tests that invalid fields of `calibration.json` are refused with their place, and valid calibrations are read."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from basecal.cell.calibration import (
    Calibration,
    Certificate,
    Finding,
    Loop,
    Outlier,
    Residuals,
    RobotParameters,
    SampleResidual,
    Validation,
)
from basecal.cell.files import calibration_from_dict, calibration_to_dict, read_calibration, write_calibration
from basecal.cell.results.calibration_dict import calibration_from_dict as check_calibration
from basecal.cell.results.calibration_dict import finding_to_dict
from basecal.cell.results.calibration_model import WrittenNoise
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.errors import InputError
from basecal.geometry import SE3, Camera, PoseEstimate

EMPTY = calibration_to_dict(Calibration("refused"))
NOISE = TypeAdapter(WrittenNoise)
ROBOT_SIGMAS = {"sigma_t_m": [1e-3, None, 1e-3], "sigma_r_rad": [1e-3] * 3}


def nan_if_none(value: float | None) -> float:
    return math.nan if value is None else value


FINITE = st.floats(-1e9, 1e9)
NUMBER = st.floats()  # NaN and infinities too, which are null on disk
ERROR = st.none() | st.floats(0) | st.just(math.nan)
SIGMA = st.floats(0, 1e6) | st.just(math.nan)
TEXT = st.text(st.characters(codec="utf-8"), max_size=8)
COUNT = st.integers(0, 2**31)


def arrays(*shape: int) -> st.SearchStrategy[np.ndarray]:
    count = math.prod(shape)
    return st.lists(FINITE, min_size=count, max_size=count).map(lambda values: np.reshape(values, shape))


def covariances(size: int) -> st.SearchStrategy[np.ndarray]:
    return arrays(size, size).map(lambda root: root @ root.T * 1e-9)


POSES = arrays(6).map(lambda xi: SE3.exp(np.clip(xi, -3, 3)))
ESTIMATES = st.builds(PoseEstimate, POSES, covariances(6))
LENSES = st.tuples(
    st.builds(
        Camera,
        st.just("pinhole"),
        st.lists(st.floats(1, 1e5), min_size=9, max_size=9).map(np.array),
        st.none() | st.tuples(st.integers(1, 9000), st.integers(1, 9000)),
    ),
    covariances(9),
)
OFFSETS = covariances(2).map(
    lambda c: RobotParameters(("a", "b"), np.array([math.nan, 1.0]), np.sqrt(np.diag(c)), np.array([False, True]), c)
)
RESIDUALS = st.builds(
    Residuals,
    ERROR,
    ERROR,
    ERROR,
    ERROR,
    st.lists(st.builds(SampleResidual, COUNT, TEXT, TEXT, ERROR, ERROR, ERROR), max_size=2).map(tuple),
    st.lists(
        st.builds(Loop, st.lists(TEXT, max_size=3).map(tuple), COUNT, ERROR.map(nan_if_none), ERROR.map(nan_if_none)),
        max_size=2,
    ).map(tuple),
)
TRANSFORMS = st.sampled_from(["eye_base_from_hand_base", "eye_flange_from_wrist", "hand_flange_from_board"])
NAMES = st.lists(TEXT, max_size=2, unique=True)


@st.composite
def calibrations(draw: st.DrawFn) -> Calibration:
    """Return any calibration, its parts drawn one by one."""
    order = tuple(draw(st.lists(TRANSFORMS, max_size=2, unique=True)))
    transforms = draw(st.dictionaries(TRANSFORMS, ESTIMATES, max_size=2))
    return Calibration(
        draw(st.sampled_from(["good", "doubtful", "refused"])),
        transforms,
        status=dict.fromkeys(transforms, "free"),
        points=frozenset(list(transforms)[:1]),
        cameras=draw(st.dictionaries(TEXT, LENSES, max_size=1)),
        robot_parameters={"joint_offsets": draw(st.dictionaries(TEXT, OFFSETS, min_size=1, max_size=2))},
        noise={
            "pixel_px": draw(SIGMA),
            "robots": {"eye": dict.fromkeys(("sigma_t_m", "sigma_r_rad"), [draw(SIGMA)] * 3)},
        },
        order=order,
        joint_covariance=draw(st.none() | covariances(6 * len(order))),
        residuals=draw(RESIDUALS),
        outliers=draw(
            st.none() | st.lists(st.builds(Outlier, COUNT, TEXT, TEXT, st.just((1, 2)), TEXT), max_size=1).map(tuple)
        ),
        validation=draw(st.none() | st.builds(Validation, TEXT, COUNT, ERROR, ERROR, ERROR, ERROR)),
        certificate=draw(st.none() | st.builds(Certificate, st.none() | NUMBER, st.none() | st.booleans(), TEXT)),
        condition=draw(st.none() | NUMBER),
        unobservable=tuple(draw(NAMES)),
        findings=(Finding(draw(TEXT), "info", tuple(draw(NAMES)), draw(TEXT)),),
        inputs=draw(st.dictionaries(TEXT, TEXT, max_size=1)),
    )


@pytest.mark.journey
@settings(max_examples=15, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(calibrations())
def test_any_written_calibration_is_read_back(calibration: Calibration) -> None:
    """A calibration read back is written as the same text, except for the last digit of converted units."""
    data = calibration_to_dict(calibration)
    again = calibration_to_dict(calibration_from_dict(json.loads(json.dumps(data, allow_nan=False))))
    assert again.keys() == data.keys()
    for key in data:
        assert is_close(again[key], data[key]), key


def is_close(a: Any, b: Any) -> bool:
    """Return whether plain data are equal, numbers to 12 digits."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(is_close(a[key], b[key]) for key in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(is_close, a, b))
    return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-15) if isinstance(a, float) else bool(a == b)


def test_refused_run_without_transforms_is_read(tmp_path: Path) -> None:
    """A joint covariance of no transforms is read as an empty one."""
    path = write_calibration(Calibration("refused", joint_covariance=np.zeros((0, 0))), tmp_path)
    assert read_calibration(path).joint_covariance.shape == (0, 0)


EMPTY_FINDING = finding_to_dict(Finding("a", "info", (), "What."))
GEAR = {"ratio_error": [0.0], "sigma_ratio_error": [0.0], "seen": [True], "joint_names": ["pan"]}
SIGMAS = {"sigma_t_m": [1e-3] * 3, "sigma_r_rad": [1e-3] * 3}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"inputs": {"cell.yaml": 3}}, r"inputs\.cell\.yaml: expected text, got 3"),
        ({"unknown": 1, "findings": [{"code": "a"}]}, r"findings\[0\]\.severity: missing"),
        ({"joint": {"order": ["a_from_b"], "covariance": []}}, "has 0 rows, expected 6 for each of 1"),
        ({"joint": {"order": ["a; b_from_c"], "covariance": []}}, "expected the name of a transform"),
        ({"joint": {"order": [], "covariance": [[-1.0]]}}, "a variance below 0"),
        ({"validation": {"kind": "k-fold", "folds": 5.5}}, r"validation\.folds: .*whole number|valid integer"),
        ({"noise": {"robots": {"arm": SIGMAS | {"smooth": {"sigma": [1.0] * 6}}}}}, r"robots\.arm.*length_m"),
        ({"noise": {"robots": {"arm": SIGMAS | {"smooth": {"sigma": [1.0], "length_m": 1}}}}}, r"robots\.arm.*sigma"),
        ({"noise": {"pixel_px": []}}, r"noise\.pixel_px.*a list of 0"),
        ({"certificate": {"gap": math.inf, "global": True, "reason": ""}}, "finite number"),
    ],
)
def test_first_invalid_field_is_named(change: dict[str, Any], words: str) -> None:
    """The error names the place of the first invalid field and the expected value."""
    with pytest.raises(InputError, match=words):
        check_calibration(EMPTY | change)


ROBOT = {"noise": {"robots": {"arm": SIGMAS}}}
POSE = {
    "t_m": [0.0] * 3,
    "q_xyzw": [0.0, 0, 0, 1],
    "covariance": np.eye(6).tolist(),
    "status": "free",
    "verdict": "good",
}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"later": [1]}, "later: unknown field; known: schema, version"),
        ({"verdicts": {}}, r"verdicts: unknown field \(did you mean 'verdict'\?\)"),
        ({"transforms": {"a_from_b": POSE | {"sigma": 1}}}, r"transforms\.a_from_b\.sigma: unknown field"),
        ({"noise": {"robots": {"arm": SIGMAS | {"later": 1}}}}, r"noise\.robots\.arm\.later: unknown field"),
        ({"noise": {"later": 1}}, r"noise\.later: unknown field"),
        ({"joint": {"order": [], "covariance": [], "more": 1}}, r"joint\.more: unknown field"),
        ({"findings": [EMPTY_FINDING | {"sev": 1}]}, r"findings\[0\]\.sev: unknown field"),
        ({"gear_ratio": {"arm": GEAR | {"later": []}}}, r"gear_ratio\.arm\.later: unknown field"),
        ({"certificate": {"gap": None, "global": None}}, r"certificate\.reason: missing; add it"),
    ],
)
def test_unknown_and_missing_fields_are_refused(change: dict[str, Any], words: str) -> None:
    """On every level, the error names the place and the fields that are known there."""
    assert check_calibration(EMPTY | ROBOT).noise == ROBOT["noise"]
    with pytest.raises(InputError, match=words):
        check_calibration(EMPTY | change)


def effect(name: str) -> dict[str, Any]:
    """Return the written figures of an effect's errors."""
    of = RANDOM_EFFECTS[name]
    by_joints = {} if of.is_by_coordinate else {"shift_m": 1e-4, "turn_rad": 1e-4}
    return {"sigma": [1e-4] * 6, **by_joints, **of.figures}


def test_noise_of_every_effect_is_read_unchanged() -> None:
    """Noise is read as written, including errors of every effect, and gets no additional fields."""
    robot = {**ROBOT_SIGMAS, "freedoms": 3.0, "rms_factor": 1.2, **{name: effect(name) for name in RANDOM_EFFECTS}}
    noise = {
        "pixel_px": 0.2,
        "correlated_px": 0.1,
        "cameras": {"wrist": {"pixel_px": 0.2, "factor": None, "views_count": 3}},
        "robots": {"arm": robot, "other": ROBOT_SIGMAS},
        "clocks": {"wrist": {"jitter_s": 1e-3}},
        "targets": {"board": {"shape": [0.5, -1.0]}},
    }
    assert NOISE.validate_python(noise) == noise
    assert NOISE.validate_python(None) == {}


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        ({"pixel_px": -1.0}, "greater than or equal to 0"),
        ({"cameras": {"wrist": {"factor": 1.0}}}, "views_count"),
        ({"robots": {"arm": {"sigma_t_m": [1e-3] * 3}}}, "sigma_r_rad"),
        ({"robots": {"arm": {**ROBOT_SIGMAS, "freedoms": 0.5}}}, "greater than or equal to 1"),
        ({"robots": {"arm": {**ROBOT_SIGMAS, "joint_offsets": {"sigma": [1e-3] * 6}}}}, "shift_m"),
    ],
)
def test_invalid_noise_is_refused(noise: dict[str, Any], words: str) -> None:
    """The error names the field."""
    with pytest.raises(ValidationError, match=words):
        NOISE.validate_python(noise)
