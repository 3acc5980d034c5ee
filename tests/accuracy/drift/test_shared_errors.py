"""What the views of a camera get wrong together."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.drift.innovations import innovations
from basecal.accuracy.drift.shared_errors import FEWEST_SAMPLES, _camera_covariance, with_shared_errors
from basecal.accuracy.drift.shifts import frame_shifts, joint_shifts
from basecal.accuracy.drift.verify import verify
from basecal.cell import Recording, RobotState
from basecal.geometry import SE3
from drift_cells import Later, later

SHAKES = 2e-3  # [m, rad] of the camera's stand at each sample, many sigmas of the robots
many = partial(later, new=24)


def shaken(made: Later, size: float) -> Later:
    """Samples whose camera stood elsewhere at each of them."""
    rng, samples = np.random.default_rng(5), []
    for sample in made.recording.samples:
        pose = sample.robots["eye"].base_from_flange @ SE3.exp(size * rng.standard_normal(6))
        samples.append(replace(sample, robots={**sample.robots, "eye": RobotState(pose)}))
    return replace(made, recording=Recording(tuple(samples)))


def of(made: Later):
    return innovations(made.cell, made.calibration, made.recording)


def likeliest(found):
    return min(frame_shifts(found), key=lambda shift: shift.log_chance)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_camera_that_shakes_has_not_moved(seed: int) -> None:
    """Taken for independent its views say that it did; as they scatter, they do not."""
    found = of(shaken(many(seed), SHAKES))
    assert likeliest(found).log_chance < np.log(1e-6)
    wider = with_shared_errors(found, likeliest(found))
    assert likeliest(wider).log_chance > np.log(1e-2)
    per_view = np.einsum("iaia->ia", (wider.predicted - found.predicted).reshape(24, 6, 24, 6))
    assert per_view.min() >= 0


@pytest.mark.parametrize("seed", [0, 1])
def test_views_that_err_by_themselves_stay_as_they_are(seed: int) -> None:
    """Their scatter is within what chance makes of it."""
    found = of(many(seed))
    assert with_shared_errors(found, likeliest(found)) is found


def test_what_moved_is_none_of_them() -> None:
    """A base that moved by a centimetre is found by as much as before, in many samples as in few."""
    made = many()
    tangent = np.array([0.01, 0, 0, 0, 0, 0])
    moved = replace(made, recording=made.with_base_moved(tangent))
    found = of(moved)
    assert with_shared_errors(found, likeliest(found)) is found
    told = verify(made.cell, made.calibration, moved.recording)
    assert told.moved is True
    assert told.shift.frame == "hand_base"
    np.testing.assert_allclose(told.shift.size[:3], tangent[:3], atol=1e-3)


def test_few_samples_are_not_asked() -> None:
    """A check of a few goes by what the calibration knows of its views."""
    few = shaken(many(), SHAKES).first(FEWEST_SAMPLES - 1)
    found = verify(few.cell, few.calibration, few.recording)
    assert found.chance == pytest.approx(min(1.0, 3 * np.exp(likeliest(of(few)).log_chance)))


def test_a_joint_that_moved_is_none_of_them() -> None:
    """What its zero explains is left out, too."""
    found = of(many(0, joints=True, robot_noise=(1e-4, 2e-4)))
    moves = found.whiten(found.joint_jacobian("hand")[..., 2:3])
    off = replace(found, off=found.off + 0.01 * moves[:, 0])
    joint = next(shift for shift in joint_shifts(off) if shift.frame == "hand_flange" and shift.joint == 2)
    assert with_shared_errors(off, joint) is off
    assert with_shared_errors(off, replace(joint, size=np.zeros(1))) is not off


COUNT = 24  # samples, of which chance makes scatters of up to (1 + sqrt(6 / 24))^2 = 2.25


@pytest.mark.parametrize(("scatter", "told"), [(2.2, 0.0), (2.3, 1.3)])
@pytest.mark.parametrize("views", [1, 2])
def test_what_scatters_beyond_chance_is_open(scatter: float, told: float, views: int) -> None:
    """Of views that tell of a camera's place alike, by what is more than one; in each sample, as in those calibrated.

    Two views of a sample are one by their sum, whose share of the information is twice as large.
    """
    rng = np.random.default_rng(2)
    directions, _ = np.linalg.qr(rng.standard_normal((COUNT, 6)))
    said = np.sqrt(COUNT) * directions * np.sqrt([scatter, 1.0, 0.5, 1.0, 1.5, 0.1])  # mean squares, not together
    sample = np.tile(np.arange(COUNT), views)
    left = np.tile(said / np.sqrt(views), (views, 1)).ravel()
    of = SimpleNamespace(covariance_inverse=np.eye(6 * len(sample)), sample=sample)
    found = _camera_covariance(of, np.tile(np.eye(6), (len(sample), 1)), left)
    first = np.diag([told, 0, 0, 0, 0, 0]) / (COUNT * views)
    alike = np.where(sample[:, None] == sample, 1 + COUNT, 1)
    np.testing.assert_allclose(found, np.kron(alike, first), atol=1e-9)


def test_a_place_that_is_not_seen_is_not_open() -> None:
    """Along directions in which views say nothing of it; where information is more, places are open by less."""
    rng = np.random.default_rng(2)
    directions, _ = np.linalg.qr(rng.standard_normal((COUNT, 6)))
    by_place = np.diag([10.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    inverse = 4.0 * np.eye(6)
    said = np.sqrt(COUNT) * directions * np.sqrt([5.0, 5.0, 1.0, 9.0, 9.0, 9.0])
    of = SimpleNamespace(covariance_inverse=np.kron(np.eye(COUNT), inverse), sample=np.arange(COUNT))
    found = _camera_covariance(of, np.tile(by_place, (COUNT, 1)), (2.0 * said).ravel())
    open_by = np.diag([4.0, 4.0, 0, 0, 0, 0]) / (4 * COUNT)
    np.testing.assert_allclose(found[:6, 6:12], open_by, atol=1e-9)
    np.testing.assert_allclose(found[:6, :6], (1 + COUNT) * open_by, atol=1e-9)
