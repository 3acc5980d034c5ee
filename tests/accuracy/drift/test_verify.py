"""Tests of `verify`: whether a cell is unchanged since its calibration."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.drift import verify as verify_module
from basecal.accuracy.drift.innovations import Innovations, innovations
from basecal.accuracy.drift.shifts import Shift, detectable_m, frame_shifts, joint_shifts
from basecal.accuracy.drift.verify import FEWEST_FOR_SCATTER, POWER, _camera_covariance, verify, with_shared_errors
from basecal.accuracy.model_comparison.nested_models import MOVED_LEVEL
from basecal.cell import Recording, RobotState, Unknown
from basecal.cell.targets.points import points_target
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from drift_cells import BASE, Later, later
from quick import quick


def verify_cell(made: Later, recording: Recording | None = None):
    return verify(made.cell, made.calibration, made.recording if recording is None else recording)


@pytest.mark.parametrize("seed", quick(range(6), range(3)))
def test_unchanged_cell_has_not_moved(seed: int) -> None:
    """An unchanged cell has not moved; the detectable shift and the repr are stated."""
    found = verify_cell(later(seed))
    assert found.moved is False
    assert found.chance > MOVED_LEVEL
    assert found.detectable_m is not None
    assert len(found.samples) == 6
    assert repr(found) == f"<not moved, 6 samples, p = {found.chance:.2g}>"
    assert repr(replace(found, moved=None)).startswith("<undecided, 6 samples")


@pytest.mark.parametrize("seed", quick(range(6), range(3)))
def test_moved_base_is_named(seed: int) -> None:
    """A base moved by three times the detectable shift is named."""
    made = later(seed)
    length = 3 * verify_cell(made).detectable_m
    direction = np.random.default_rng(seed).standard_normal(3)
    tangent = np.array([*(length * direction / np.linalg.norm(direction)), 0, 0, 0])
    found = verify_cell(made, made.with_base_moved(tangent))
    assert found.moved is True
    assert found.shift.frame == "hand_base"
    assert found.shift.transform == BASE
    assert repr(found).startswith("<moved: hand_base, 6 samples, p = ")


def test_single_sample_detects_movement_without_cause() -> None:
    """A single sample detects that something moved, with several possible causes."""
    made = later().first(1)
    tangent = np.array([0.01, 0, 0, 0, 0, 0])
    found = verify_cell(made, made.with_base_moved(tangent))
    assert found.moved is True
    assert "hand_base" in {found.shift.frame, *(other.frame for other in found.alternatives)}
    assert found.alternatives


def test_single_bad_sample_is_left_out() -> None:
    """A sample that alone is off is left out as an outlier."""
    made = later()
    first, *others = made.recording.samples
    hand = first.robots["hand"].base_from_flange
    bumped = replace(first, robots={**first.robots, "hand": RobotState(SE3.exp(np.full(6, 0.02)) @ hand)})
    found = verify_cell(made, Recording((bumped, *others)))
    assert found.moved is False
    assert found.outliers == (first.sample,)


def test_vague_calibration_is_undecided() -> None:
    """A calibration with a detectable shift above a tenth of a metre, beyond first order, is undecided."""
    made = later()
    vague = replace(made.calibration, joint_covariance=1e6 * made.calibration.joint_covariance)
    tangent = np.array([0.5, 0, 0, 0, 0, 0])
    found = verify(made.cell, vague, made.with_base_moved(tangent))
    assert found.detectable_m > 0.1
    assert found.moved is None
    assert found.alternatives == ()


def everything_fixed() -> Later:
    """A cell in which all transforms are fixed."""
    made = later(seed=1)
    known = {name: Unknown("fixed", estimate.mean) for name, estimate in made.calibration.transforms.items()}
    cell = replace(
        made.cell,
        bases={"hand": known[BASE]},
        cameras={n: replace(c, mount=known[made.cell.mount_name(n)]) for n, c in made.cell.cameras.items()},
        targets={n: replace(t, mount=known[made.cell.mount_name(n)]) for n, t in made.cell.targets.items()},
    )
    fixed = replace(made.calibration, transforms={}, order=(), joint_covariance=None)
    return Later(cell, fixed, made.recording)


def test_fixed_cell_is_verified() -> None:
    """A cell with all transforms fixed is verified, too."""
    made = everything_fixed()
    found = verify_cell(made, made.with_base_moved(np.array([0.02, 0, 0, 0, 0, 0])))
    assert found.moved is True
    assert len(found.requested) == 3


def test_samples_without_calibrated_views_are_undecided() -> None:
    """Samples without views of calibrated devices leave the result undecided."""
    made = later()
    blind = Recording(tuple(replace(s, observations=()) for s in made.recording.samples))
    found = verify_cell(made, blind)
    assert found.moved is None
    assert found.detectable_m is None


@pytest.mark.journey
def test_target_shape_found_by_calibration_is_no_movement() -> None:
    """Points stated a millimetre off, found by the calibration, are no movement in its own and later samples."""
    points = np.random.default_rng(8).uniform(-0.06, 0.06, (12, 3))
    made = simulate(Scenario(samples=24, target="points", board=points_target(points), state_robot_noise=False), 3)
    stated = points_target(points + 1e-3 * np.random.default_rng(9).standard_normal(points.shape))
    cell = replace(made.cell, targets={"board": replace(made.cell.targets["board"], target=stated)})
    taken = made.recording.samples
    calibration = calibrate(cell, Recording(taken[:18]))
    for samples in (taken[:18], taken[18:]):
        assert verify(cell, calibration, Recording(samples)).moved is False
    unshaped = replace(calibration, noise={k: of for k, of in calibration.noise.items() if k != "targets"})
    assert (
        verify(cell, unshaped, Recording(taken[:18])).chance
        < 0.1 * verify(cell, calibration, Recording(taken[:18])).chance
    )


def test_chance_is_at_most_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The chance of the best frame times their number is at most one, as for three frames without a shift."""
    seen = []

    def as_expected(of: Innovations) -> list[Shift]:
        """The frames, none of them off."""
        seen.extend(replace(each, statistic=1.0) for each in frame_shifts(of))
        return seen

    monkeypatch.setattr(verify_module, "frame_shifts", as_expected)
    assert verify_cell(later().first(1)).chance == 1.0
    assert len(seen) == 3
    assert np.exp(seen[0].log_chance) > 0.9


def test_unlikely_alternatives_are_omitted() -> None:
    """Alternatives that are e^3 times less likely are omitted; a rotation of the base over six samples has none."""
    made = later()
    plain = verify_cell(made, made.with_base_moved(np.array([0.003, 0, 0, 0, 0, 0])))
    assert plain.shift is not None
    scores = [each.statistic - each.freedoms for each in plain.alternatives]
    best = plain.shift.statistic - plain.shift.freedoms
    assert all(score > best - 6.0 for score in scores)
    far = verify_cell(made, made.with_base_moved(np.array([0.01, -0.01, 0.01, 0.01, 0.02, 0])))
    assert far.shift is not None
    assert far.shift.frame == "hand_base"
    assert far.alternatives == ()


@pytest.mark.parametrize(("count", "blamed"), [(3, False), (4, True), (5, True)])
def test_outlier_needs_four_samples(count: int, blamed: bool) -> None:
    """One of four samples may be the outlier; of three, it may be the only correct one."""
    made = later().first(count)
    first, *others = made.recording.samples
    hand = first.robots["hand"].base_from_flange
    bumped = replace(first, robots={**first.robots, "hand": RobotState(SE3.exp(np.full(6, 0.02)) @ hand)})
    found = verify_cell(made, Recording((bumped, *others)))
    assert found.outliers == ((first.sample,) if blamed else ())
    assert found.moved is not blamed


@pytest.mark.parametrize("length_m", [0.09, 0.11, None])
def test_detectable_shift_above_tenth_of_metre_is_undecided(
    monkeypatch: pytest.MonkeyPatch, length_m: float | None
) -> None:
    """Beyond a detectable shift of 0.1 m neither movement nor its absence is reported.

    If no shift is detectable, an alarm stays.
    """
    made = later()
    monkeypatch.setattr(verify_module, "detectable_m", lambda *given: length_m)
    still, moved = verify_cell(made), verify_cell(made, made.with_base_moved(np.array([0.02, 0, 0, 0, 0, 0])))
    assert still.detectable_m == moved.detectable_m == length_m
    assert (still.moved, moved.moved) == {0.09: (False, True), 0.11: (None, None), None: (None, True)}[length_m]


@pytest.mark.parametrize("nothing_asked", [False, True])
def test_detectable_shift_is_worst_of_requested(nothing_asked: bool) -> None:
    """The detectable shift is the worst of the requested frames, at a level shared by all frames.

    The chance is that of the likeliest frame times their number; without requests all frames count.
    """
    made = everything_fixed() if nothing_asked else later()
    found = verify_cell(made)
    frames = list(frame_shifts(innovations(made.cell, made.calibration, made.recording)))
    asked = frames if nothing_asked else [each for each in frames if each.transform == BASE]
    lengths = [detectable_m(each, MOVED_LEVEL / len(frames), POWER) for each in asked]
    assert found.detectable_m == pytest.approx(max(lengths))
    assert [each.transform for each in found.requested] == [each.transform for each in asked]
    best = min(frames, key=lambda each: each.log_chance)
    assert found.chance == pytest.approx(min(1.0, len(frames) * np.exp(best.log_chance)))
    assert found.shift.frame == best.frame
    assert found.samples == tuple(s.sample for s in made.recording.samples)


CAMERA_MOTION = 2e-3  # [m, rad] camera motion at each sample, many sigmas of the robots
many = partial(later, new=24)


def shake_camera(made: Later, size: float) -> Later:
    """Samples whose camera moved randomly at each of them."""
    rng, samples = np.random.default_rng(5), []
    for sample in made.recording.samples:
        pose = sample.robots["eye"].base_from_flange @ SE3.exp(size * rng.standard_normal(6))
        samples.append(replace(sample, robots={**sample.robots, "eye": RobotState(pose)}))
    return replace(made, recording=Recording(tuple(samples)))


def find_innovations(made: Later):
    return innovations(made.cell, made.calibration, made.recording)


def likeliest_shift(found):
    return min(frame_shifts(found), key=lambda shift: shift.log_chance)


@pytest.mark.parametrize("seed", [0, 1])
def test_shaking_camera_has_not_moved(seed: int) -> None:
    """Independent view errors suggest a movement of a shaking camera; with their scatter it has not moved."""
    found = find_innovations(shake_camera(many(seed), CAMERA_MOTION))
    assert likeliest_shift(found).log_chance < np.log(1e-6)
    wider = with_shared_errors(found, likeliest_shift(found))
    assert likeliest_shift(wider).log_chance > np.log(1e-2)
    per_view = np.einsum("iaia->ia", (wider.predicted - found.predicted).reshape(24, 6, 24, 6))
    assert per_view.min() >= 0


@pytest.mark.parametrize("seed", [0, 1])
def test_independent_view_errors_are_unchanged(seed: int) -> None:
    """Independent view errors scatter within chance, so the innovations are unchanged."""
    found = find_innovations(many(seed))
    assert with_shared_errors(found, likeliest_shift(found)) is found


def test_moved_base_is_no_shared_error() -> None:
    """A base moved by a centimetre is found equally in many samples and in few."""
    made = many()
    tangent = np.array([0.01, 0, 0, 0, 0, 0])
    moved = replace(made, recording=made.with_base_moved(tangent))
    found = find_innovations(moved)
    assert with_shared_errors(found, likeliest_shift(found)) is found
    verification = verify(made.cell, made.calibration, moved.recording)
    assert verification.moved is True
    assert verification.shift.frame == "hand_base"
    np.testing.assert_allclose(verification.shift.size[:3], tangent[:3], atol=1e-3)


def test_few_samples_have_no_shared_errors() -> None:
    """Few samples are verified by the calibration's own view noise, without shared errors."""
    few = shake_camera(many(), CAMERA_MOTION).first(FEWEST_FOR_SCATTER - 1)
    found = verify(few.cell, few.calibration, few.recording)
    assert found.chance == pytest.approx(min(1.0, 3 * np.exp(likeliest_shift(find_innovations(few)).log_chance)))


@pytest.mark.journey
def test_moved_joint_is_no_shared_error() -> None:
    """The part explained by a joint offset is excluded from shared errors, too."""
    found = find_innovations(many(0, joints=True, robot_noise=(1e-4, 2e-4)))
    moves = found.whiten(found.joint_jacobian("hand")[..., 2:3])
    off = replace(found, deviation=found.deviation + 0.01 * moves[:, 0])
    joint = next(shift for shift in joint_shifts(off) if shift.frame == "hand_flange" and shift.joint == 2)
    assert with_shared_errors(off, joint) is off
    assert with_shared_errors(off, replace(joint, size=np.zeros(1))) is not off


COUNT = 24  # samples; by chance the scatter reaches (1 + sqrt(6 / 24))^2 = 2.25


@pytest.mark.parametrize(("scatter", "excess"), [(2.2, 0.0), (2.3, 1.3)])
@pytest.mark.parametrize("views", [1, 2])
def test_scatter_beyond_chance_adds_covariance(scatter: float, excess: float, views: int) -> None:
    """Scatter beyond chance adds its excess over one to the camera covariance, in each sample and the calibration.

    Two views of a sample count by their sum, whose share of the information is twice as large.
    """
    rng = np.random.default_rng(2)
    directions, _ = np.linalg.qr(rng.standard_normal((COUNT, 6)))
    deviations = np.sqrt(COUNT) * directions * np.sqrt([scatter, 1.0, 0.5, 1.0, 1.5, 0.1])  # mean squares
    sample = np.tile(np.arange(COUNT), views)
    left = np.tile(deviations / np.sqrt(views), (views, 1)).ravel()
    of = SimpleNamespace(covariance_inverse=np.eye(6 * len(sample)), sample=sample)
    found = _camera_covariance(of, np.tile(np.eye(6), (len(sample), 1)), left)
    first = np.diag([excess, 0, 0, 0, 0, 0]) / (COUNT * views)
    alike = np.where(sample[:, None] == sample, 1 + COUNT, 1)
    np.testing.assert_allclose(found, np.kron(alike, first), atol=1e-9)


def test_unseen_directions_add_no_covariance() -> None:
    """Directions that views do not show add no covariance; more information adds less."""
    rng = np.random.default_rng(2)
    directions, _ = np.linalg.qr(rng.standard_normal((COUNT, 6)))
    by_place = np.diag([10.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    inverse = 4.0 * np.eye(6)
    deviations = np.sqrt(COUNT) * directions * np.sqrt([5.0, 5.0, 1.0, 9.0, 9.0, 9.0])
    of = SimpleNamespace(covariance_inverse=np.kron(np.eye(COUNT), inverse), sample=np.arange(COUNT))
    found = _camera_covariance(of, np.tile(by_place, (COUNT, 1)), (2.0 * deviations).ravel())
    open_by = np.diag([4.0, 4.0, 0, 0, 0, 0]) / (4 * COUNT)
    np.testing.assert_allclose(found[:6, 6:12], open_by, atol=1e-9)
    np.testing.assert_allclose(found[:6, :6], (1 + COUNT) * open_by, atol=1e-9)
