"""`noise` of a calibration: what was written is read, and nothing else."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from basecal.cell.results.noise_written import WrittenNoise
from basecal.effects.registry import RANDOM_EFFECTS

NOISE = TypeAdapter(WrittenNoise)
SIGMAS = {"sigma_t_m": [1e-3, None, 1e-3], "sigma_r_rad": [1e-3] * 3}


def effect(name: str) -> dict[str, Any]:
    """What an effect's errors come to."""
    of = RANDOM_EFFECTS[name]
    by_joints = {} if of.is_by_coordinate else {"shift_m": 1e-4, "turn_rad": 1e-4}
    return {"sigma": [1e-4] * 6, **by_joints, **of.figures}


def test_what_was_written_is_read() -> None:
    """As it is, errors of every effect among it; nothing is added."""
    robot = {**SIGMAS, "freedoms": 3.0, "rms_factor": 1.2, **{name: effect(name) for name in RANDOM_EFFECTS}}
    noise = {
        "pixel_px": 0.2,
        "correlated_px": 0.1,
        "cameras": {"wrist": {"pixel_px": 0.2, "factor": None, "views_count": 3}},
        "robots": {"arm": robot, "other": SIGMAS},
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
        ({"robots": {"arm": {**SIGMAS, "freedoms": 0.5}}}, "greater than or equal to 1"),
        ({"robots": {"arm": {**SIGMAS, "joint_offsets": {"sigma": [1e-3] * 6}}}}, "shift_m"),
    ],
)
def test_what_is_no_noise_is_refused(noise: dict[str, Any], words: str) -> None:
    """With the field."""
    with pytest.raises(ValidationError, match=words):
        NOISE.validate_python(noise)
