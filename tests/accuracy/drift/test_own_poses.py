"""Views that a calibration predicts far off, about the poses that they show."""

import numpy as np
import pytest

from basecal.accuracy.drift.innovations import innovations
from basecal.accuracy.drift.own_poses import first_order, view_tangents
from basecal.accuracy.drift.verify import verify
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array
from drift_cells import BASE, Later, later


def _direction(seed: int) -> Array:
    way = np.random.default_rng(seed).normal(size=6)
    return np.concatenate([half / np.linalg.norm(half) for half in (way[:3], way[3:])])


def _views(made: Later) -> tuple[PixelMeasurement, SE3, object]:
    situation = innovations(made.cell, made.calibration, made.recording).situation
    group = situation.problem.groups[0]
    assert isinstance(group.measurement, PixelMeasurement)
    predicted = situation.state.camera_from_target(group, situation.problem.stops)
    return group.measurement, predicted, situation.state.cameras[group.camera]


def test_views_near_their_prediction_are_of_first_order() -> None:
    """Nothing changes for a cell that stands as it was."""
    measurement, predicted, camera = _views(later())
    found = view_tangents(measurement, predicted, camera)  # type: ignore[arg-type]
    expected = first_order(measurement.linearise(predicted, camera, False))  # type: ignore[arg-type]
    np.testing.assert_array_equal(found.tangent, expected.tangent)
    np.testing.assert_array_equal(found.information, expected.information)


@pytest.mark.parametrize("seed", range(4))
def test_the_tangent_reaches_the_pose_that_is_seen(seed: int) -> None:
    """Predictions are moved by 0.4 m and 1.2 rad; noise of 0.2 px turns a board by milliradians."""
    measurement, predicted, camera = _views(later())
    before = predicted @ SE3.exp(view_tangents(measurement, predicted, camera).tangent)  # type: ignore[arg-type]
    moved = predicted @ SE3.exp(_direction(seed) * np.repeat([0.4, 1.2], 3))
    after = moved @ SE3.exp(view_tangents(measurement, moved, camera).tangent)  # type: ignore[arg-type]
    assert np.abs((before.inverse() @ after).log()).max() < 1e-3


@pytest.mark.parametrize("samples", [1, 3, 12])
@pytest.mark.parametrize(("length_m", "angle_rad"), [(1.0, 0.0), (0.0, 1.5), (0.6, 2.0)])
def test_a_base_moved_far_has_moved(samples: int, length_m: float, angle_rad: float) -> None:
    """Boards are predicted behind the camera then; three samples give the shift itself."""
    made = later(new=12).first(samples)
    for seed in range(3):
        tangent = _direction(seed) * np.repeat([length_m, angle_rad], 3)
        found = verify(made.cell, made.calibration, made.with_base_moved(tangent))
        assert found.moved is True
        assert found.shift is not None
        if samples > 1:
            assert found.shift.transform == BASE
            assert found.shift.shift_m == pytest.approx(np.linalg.norm(tangent[:3]), abs=0.01)
            assert found.shift.shift_rad == pytest.approx(angle_rad, abs=0.01)


@pytest.mark.parametrize("target", ["led", "points3d", "pose"])
def test_any_measurement_shows_that_a_base_moved_far(target: str) -> None:
    """A single point holds no pose: its direction counts, also if it is predicted behind the camera."""
    made = later(target=target)
    for seed in range(4):
        tangent = _direction(seed) * np.repeat([1.0, 0.0], 3)
        assert verify(made.cell, made.calibration, made.with_base_moved(tangent)).moved is True
