"""Tests of shifts of a single frame or joint, and of the detectable shift."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2
from scipy.stats import f as fisher

from basecal.accuracy.drift import shifts
from basecal.accuracy.drift.innovations import innovations
from basecal.accuracy.drift.shifts import Shift, _directions, detectable_m, frame_shifts, joint_shifts, size_shifts
from drift_cells import BASE, later

TANGENT = np.array([3e-3, -2e-3, 1e-3, 4e-3, -2e-3, 1e-3])


def of_base(recording=None):
    made = later()
    of = innovations(made.cell, made.calibration, made.recording if recording is None else recording)
    return next(each for each in frame_shifts(of) if each.transform == BASE)


def test_shift_is_found_with_sigma() -> None:
    """A moved base is found within its covariance, and with a small chance."""
    found = of_base(later().with_base_moved(TANGENT))
    off = found.size - TANGENT
    assert found.freedoms == 6
    assert off @ np.linalg.solve(found.covariance, off) < 22.5  # 99.9 % of chi-square with 6 freedoms
    assert found.shift_m == pytest.approx(np.linalg.norm(found.size[:3]))
    assert found.shift_rad == pytest.approx(np.linalg.norm(found.size[3:]))
    assert found.log_chance < np.log(1e-6) < of_base().log_chance


def test_every_frame_is_tried() -> None:
    """Every frame is tried, and no joint if poses are recorded."""
    made = later()
    of = innovations(made.cell, made.calibration, made.recording)
    assert {each.frame for each in frame_shifts(of)} == {"hand_base", "wrist", "board"}
    assert list(joint_shifts(of)) == []


def test_joint_offsets_are_tried_if_joints_recorded() -> None:
    """Joint offsets are tried if joints are recorded, and the shifted joint is found."""
    made = later(joints=True, spread_rad=0.5)
    shifted = [
        replace(s, robots={**s.robots, "hand": replace(s.robots["hand"], joints_rad=s.robots["hand"].joints_rad - q)})
        for s in made.recording.samples
        for q in [np.array([0, 0, 0.02, 0, 0, 0])]
    ]
    of = innovations(made.cell, made.calibration, replace(made.recording, samples=tuple(shifted)))
    best = min(joint_shifts(of), key=lambda each: each.log_chance)
    assert (best.frame, best.joint) == ("hand_flange", 2)
    assert best.size[0] == pytest.approx(0.02, abs=4 * np.sqrt(best.covariance[0, 0]))


def test_detectable_shift_has_stated_power() -> None:
    """A detectable shift is detected with the stated power in 20,000 draws, within three standard errors of 0.0015."""
    shift, level, power = of_base(), 2e-3, 0.95
    length = detectable_m(shift, level, power)
    assert length is not None
    rng = np.random.default_rng(4)
    along = rng.standard_normal((20_000, 3))
    tangents = np.zeros((20_000, 6))
    tangents[:, :3] = length * along / np.linalg.norm(along, axis=1)[:, None]
    root = np.linalg.cholesky(shift.information)
    drawn = np.sum((tangents @ root + rng.standard_normal((20_000, 6))) ** 2, axis=1)
    assert np.mean(drawn > chi2.isf(level, 6)) == pytest.approx(power, abs=0.005)


def test_unseen_shift_has_no_detectable_size() -> None:
    """A frame that is not seen, or in one direction only, has no finite detectable size."""
    shift = of_base()
    blind = replace(shift, information=np.zeros((6, 6)), freedoms=0)
    assert detectable_m(blind, 1e-3, 0.95) is None
    one_way = replace(shift, information=np.diag([1e8, 0, 0, 0, 0, 0.0]), freedoms=1)
    assert detectable_m(one_way, 1e-3, 0.99) is None or detectable_m(one_way, 1e-3, 0.99) > 1e-3


def _of_noise(freedoms: float, statistic: float = 30.0) -> Shift:
    """A shift of a frame with noise of so many freedoms."""
    information = np.diag([4e6, 1e6, 2e6, 1e6, 1e6, 1e6])
    inverse = np.linalg.inv(information)
    return Shift("board", "hand_flange_from_board", None, np.zeros(6), inverse, information, statistic, 6, freedoms)


@pytest.mark.parametrize("freedoms", [6.0, 12.0, 150.0])
def test_noise_of_few_freedoms_has_heavier_tails(freedoms: float) -> None:
    """With noise of few freedoms the chance follows Fisher's distribution, and the threshold has the level."""
    of = _of_noise(freedoms)
    assert np.exp(of.log_chance) == pytest.approx(fisher.sf(5.0, 6, freedoms), rel=1e-9)
    assert of.log_chance > _of_noise(np.inf).log_chance
    assert fisher.sf(of.threshold(0.005) / 6, 6, freedoms) == pytest.approx(0.005, rel=1e-9)


@pytest.mark.parametrize("freedoms", [12.0, np.inf])
def test_detectable_shift_allows_for_noise_freedoms(freedoms: float) -> None:
    """95 % of 20,000 draws of a detectable shift, its direction and the noise are detected, within half a percent."""
    of, rng = _of_noise(freedoms), np.random.default_rng(3)
    length = detectable_m(of, 0.005, 0.95)
    along = rng.standard_normal((20_000, 3))
    shifts = length * along / np.linalg.norm(along, axis=1, keepdims=True)
    strength = np.einsum("di,ij,dj->d", shifts, of.information[:3, :3], shifts)
    scale = rng.chisquare(freedoms, 20_000) / freedoms if np.isfinite(freedoms) else 1.0
    assert np.mean(rng.noncentral_chisquare(6, strength) / scale > of.threshold(0.005)) == pytest.approx(0.95, abs=5e-3)


def test_tiny_chances_are_logarithms() -> None:
    """Tiny chances have finite logarithms for a statistic of thousands; an unseen shift has a chance of one."""
    far = _of_noise(150.0, 1e8)
    assert np.isfinite(far.log_chance)
    assert far.log_chance < -500
    assert _of_noise(np.inf, 30.0).log_chance == pytest.approx(chi2.logsf(30.0, 6))
    assert replace(_of_noise(12.0, 0.0), freedoms=0).log_chance == 0.0


def test_joint_shift_has_angle_only() -> None:
    """A joint shift has an angle and no length; a frame has both."""
    of = _of_noise(np.inf)
    joint = replace(of, joint=2, size=np.array([-0.03]))
    assert (joint.shift_m, joint.shift_rad) == (0.0, pytest.approx(0.03))
    frame = replace(of, size=np.array([0.003, 0.004, 0.0, 0.0, 0.06, 0.08]))
    assert (frame.shift_m, frame.shift_rad) == (pytest.approx(0.005), pytest.approx(0.1))


def test_detectable_shift_is_below_ten_metres() -> None:
    """A detectable shift above 10 m is None: 9.9 m is stated, 10.1 m is not. It scales with the views' sigma."""
    of = _of_noise(np.inf)
    length = detectable_m(of, 0.005, 0.95)
    near, far = (replace(of, information=(length / least_m) ** 2 * of.information) for least_m in (9.9, 10.1))
    assert detectable_m(near, 0.005, 0.95) == pytest.approx(9.9)
    assert detectable_m(far, 0.005, 0.95) is None


@pytest.mark.parametrize("joints", [False, True])
def test_shift_equals_generalised_least_squares(joints: bool) -> None:
    """Size, covariance and statistic of a shift equal generalised least squares of whitened innovations."""
    made = later(joints=joints)
    of = innovations(made.cell, made.calibration, made.with_base_moved(TANGENT) if not joints else made.recording)
    root = np.linalg.cholesky(np.eye(len(of.deviation)) + of.predicted)
    found = [(each, of.frame_jacobian(each.transform)) for each in frame_shifts(of)]
    zeros = [each for each in joint_shifts(of) if each.freedoms]
    found += [(each, of.joint_jacobian(each.frame[:-7])[..., each.joint : each.joint + 1]) for each in zeros]
    assert bool(zeros) == joints
    off = np.linalg.solve(root, of.deviation)
    for each, moves in found:
        if each.freedoms < moves.shape[-1]:
            continue
        by_shift = np.linalg.solve(root, of.whiten(moves))
        size, left, *_ = np.linalg.lstsq(by_shift, off)
        np.testing.assert_allclose(each.size, size, rtol=1e-4, atol=1e-5 * np.abs(size).max())
        assert each.statistic == pytest.approx(off @ off - left[0], rel=1e-5, abs=1e-6)
        wanted = np.linalg.inv(by_shift.T @ by_shift)
        np.testing.assert_allclose(each.covariance, wanted, rtol=0, atol=1e-4 * np.abs(wanted).max())
        np.testing.assert_allclose(each.information @ wanted, np.eye(len(size)), atol=1e-3)
        assert each.freedoms == len(size)
        assert each.noise_freedoms == of.noise_freedoms


def group(target: str, count: int) -> SimpleNamespace:
    return SimpleNamespace(target=target, hand=SimpleNamespace(mount=f"mount of {target}"), views=count)


def test_each_sized_target_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each target with a size is tried by the moves of its own views, sorted by name; single points have none."""
    groups = [group("tag", 2), group("board", 1), group("light", 3), group("tag", 1)]
    problem = SimpleNamespace(groups=groups, point_mounts={"mount of light"})
    of = SimpleNamespace(situation=SimpleNamespace(problem=problem))
    monkeypatch.setattr(shifts, "size_moves", lambda situation, k: np.full((groups[k].views, 6, 1), 1.0 + k))
    monkeypatch.setattr(shifts, "_shift", lambda innovations, *of_what: of_what)
    (first, kind, joint, by_board), (second, *_, by_tag) = size_shifts(of)  # type: ignore[arg-type,misc]
    assert (first, second, kind, joint) == ("board", "tag", shifts.SIZE_KIND, None)
    np.testing.assert_array_equal(by_board[:, 0, 0], [0, 0, 2, 0, 0, 0, 0])
    np.testing.assert_array_equal(by_tag[:, 0, 0], [1, 1, 0, 0, 0, 0, 4])


def test_point_shifts_without_rotation(monkeypatch: pytest.MonkeyPatch) -> None:
    """A point has a translation only, other frames have both; they are named after the placed device."""
    problem = SimpleNamespace(point_mounts={"hand_flange_from_light"})
    of = SimpleNamespace(
        situation=SimpleNamespace(frames=(BASE, "hand_flange_from_light"), problem=problem),
        frame_jacobian=lambda name: np.full((2, 6, 6), 3.0),
    )
    monkeypatch.setattr(shifts, "_shift", lambda innovations, *of_what: of_what)
    (base, name, _, by_base), (light, _, _, by_light) = frame_shifts(of)  # type: ignore[arg-type,misc]
    assert (base, name, light) == ("hand_base", BASE, "light")
    np.testing.assert_array_equal(by_base, np.full((2, 6, 6), 3.0))
    np.testing.assert_array_equal(by_light, np.broadcast_to([3.0, 3, 3, 0, 0, 0], (2, 6, 6)))


@pytest.mark.parametrize("count", [1, 2, 50, 400])
def test_directions_are_even_over_sphere(count: int) -> None:
    """The directions have unit length and zero mean, and each axis has a third of the squares."""
    along = _directions(count)
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), 1.0)
    if count > 2:
        assert np.linalg.norm(along.mean(0)) < 2 / count
        np.testing.assert_allclose(along.T @ along / count, np.eye(3) / 3, atol=2 / count)
        between = np.arccos(np.clip(along @ along.T - 2 * np.eye(count), -1, 1)).min(1)
        assert between.min() > 2.5 / np.sqrt(count)
