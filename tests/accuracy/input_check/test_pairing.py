"""Tests of the pairing hypotheses: slips of the pairing, and inverted views of a symmetric grid."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared import rewriting
from tests.shared.declared import declared

from basecal.accuracy.input_check import pairing
from basecal.accuracy.input_check.loop_fit import trimmed_rms
from basecal.accuracy.input_check.pairing import half_turn_hypotheses, slip_hypotheses
from basecal.cell import Recording
from basecal.cell.targets.chessboard import chessboard_target
from basecal.estimation.problem.correspondence import half_turn
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def test_missed_detection_is_located():
    """Observations one too early from sample 9 on are shifted back from there by the first hypothesis."""
    made = simulate(Scenario(samples=24), 3)
    wrong = rewriting.shifted(made.recording, None, -1, start=9)
    first, fits = slip_hypotheses(declared(made.cell, wrong), made.cameras, [None, "eye", "hand"])[0]
    (found,) = first.reread(declared(made.cell, wrong)).problem.groups
    (true,) = declared(made.cell, made.recording).problem.groups
    assert first.about == ()
    np.testing.assert_array_equal(found.measurement.pixels, true.measurement.pixels[found.sample])
    assert len(found) == 22
    (fit,) = fits.values()
    assert trimmed_rms(fit.errors, 1.0) < 0.01


def test_last_samples_are_no_slip():
    """No slip starts in the last samples, which outliers would explain.

    The last two observations belong one sample later.
    """
    made = simulate(Scenario(samples=24), 3)
    wrong = rewriting.shifted(made.recording, None, -1, start=21)
    given = declared(made.cell, wrong)
    recorded = dict(
        zip(given.problem.groups[0].sample.tolist(), given.problem.groups[0].measurement.pixels, strict=True)
    )
    for guess, _ in slip_hypotheses(declared(made.cell, wrong), made.cameras, [None]):
        (found,) = guess.reread(given).problem.groups
        pairs = zip(found.sample.tolist(), found.measurement.pixels, strict=True)
        assert min(number for number, pixels in pairs if np.any(pixels != recorded[number])) <= 20


def test_slip_needs_six_samples_on_each_side():
    """With fewer than six samples on each side, no slip is proposed."""
    made = simulate(Scenario(samples=11), 0)
    assert slip_hypotheses(declared(made.cell, made.recording), made.cameras, [None]) == []


def test_turned_views_are_found():
    """One of the two hypotheses turns exactly the views that were read from the other end."""
    board = chessboard_target((8, 6), 0.03)
    made = simulate(Scenario(samples=12, target="pose", board=board), 0)
    cell = replace(made.cell, targets={n: replace(t, target=board) for n, t in made.cell.targets.items()})
    turn = half_turn(board)
    samples = list(made.recording.samples)
    for k in (2, 3, 7):
        (one,) = rewriting.with_targets(Recording((samples[k],)), lambda poses: poses @ turn).samples
        samples[k] = one
    found = half_turn_hypotheses(declared(cell, Recording(tuple(samples))))
    assert {reading.about for reading in found} >= {("board", "2", "3", "7")}
    assert half_turn_hypotheses(declared(cell, made.recording)) == []


@pytest.mark.parametrize(("count", "more"), [(10, False), (11, True)])
def test_ten_turned_views_are_listed(count, more):
    """At most ten turned views are listed in the message, and all of them are turned."""
    board = chessboard_target((8, 6), 0.03)
    made = simulate(Scenario(samples=26, target="pose", board=board), 0)
    cell = replace(made.cell, targets={n: replace(t, target=board) for n, t in made.cell.targets.items()})
    turned = rewriting.with_targets(made.recording, lambda poses: poses @ half_turn(board))
    wrong = [
        t if k % 2 and k < 2 * count else s
        for k, (s, t) in enumerate(zip(made.recording.samples, turned.samples, strict=True))
    ]
    numbers = tuple(str(k) for k in range(1, 2 * count, 2))
    (found,) = [
        h for h in half_turn_hypotheses(declared(cell, Recording(tuple(wrong)))) if h.about == ("board", *numbers)
    ]
    assert (", ..." in found.words) == more
    assert f"at sample {', '.join(numbers[:10])}{', ...' if more else ''}: read" in found.words
    (right,) = found.reread(declared(cell, Recording(tuple(wrong)))).problem.groups
    (true,) = declared(cell, made.recording).problem.groups
    found_poses, poses = (of.measurement.measured_camera_from_target for of in (right, true))
    np.testing.assert_allclose(found_poses.matrix, poses.matrix, atol=1e-9)


@pytest.mark.parametrize("at", [4, 9, 15, 16])
@pytest.mark.parametrize("lost", [0, 1])
def test_slip_is_at_fewest_large_errors(at, lost):
    """The slip is where the fewest samples are off: before it as recorded, after it as shifted.

    A sample lost there is off both ways and not counted.
    """
    rng = np.random.default_rng(0)
    fine, off = 0.002 * rng.uniform(0.8, 1.2, 20), 0.3 * rng.uniform(0.8, 1.2, 20)
    before = np.where(np.arange(20) < at, fine, off)
    after = np.where(np.arange(20) < at + lost, off, fine)
    score, found = pairing._find_slip(before, after, lost)
    counted = np.concatenate([fine[:at], fine[at + lost :]])
    assert found == at
    assert score == pytest.approx(np.sqrt(np.sum(counted**2) / 20))


def test_slip_is_four_samples_from_ends():
    """A slip nearer than four samples to an end is rejected, and the best other one is returned.

    There, a large error counts as four times the rest.
    """
    before, after = np.full(20, 0.01), np.full(20, np.nan)
    before[18:] = 7.0
    after[18:] = 0.01
    score, found = pairing._find_slip(before, after, 0)
    assert found == 16
    assert score == pytest.approx(np.sqrt((16 * 0.01**2 + 2 * 0.04**2 + 2 * 0.01**2) / 20))
    assert pairing._find_slip(before / 100, after / 100, 0)[1] == 16


def test_small_loop_errors_are_equal():
    """Loop errors below 5 mrad are equally good; four times that is the largest error of a sample."""
    before, after = np.full(20, 1e-6), np.full(20, 1.0)
    before[10:], after[10:] = 1.0, 1e-6
    before[5] = 0.9
    score, found = pairing._find_slip(before, after, 0)
    assert found == 10
    assert score == pytest.approx(np.sqrt((19 * 1e-12 + 0.02**2) / 20))


def test_error_cap_uses_best_two_fifths():
    """The cap on sample errors uses the best two fifths of the better pairing. Half of its samples may be far off."""
    for k in (0, 1):
        both = [np.full(20, 0.5), np.where(np.arange(20) < 10, 0.5, 0.01)]
        before, after = both if k else both[::-1]
        score, _ = pairing._find_slip(before, after, 0)
        assert score < 0.05
    fine, bad = np.full(20, 0.01), np.full(20, 0.5)
    bad[:8] = 0.01
    assert pairing._find_slip(bad, np.full(20, 0.5), 0)[0] == pytest.approx(
        np.sqrt((8 * 0.01**2 + 12 * 0.04**2) / 20), rel=1e-12
    )
    assert pairing._find_slip(fine, fine, 0) == (pytest.approx(0.01), 4)


def test_halves_are_fitted_recorded_and_shifted(monkeypatch):
    """The first half is fitted as recorded, the second with each stream one sample later and earlier.

    Twelve samples are enough.
    """
    made = simulate(Scenario(samples=13, target="pose"), 0)
    fitted = []

    def fits(readings, lenses):
        fitted.extend(readings)
        return [{} for _ in readings]

    monkeypatch.setattr(pairing, "_fit_readings", fits)
    slip_hypotheses(declared(made.cell, made.recording), made.cameras, [None, "hand"])
    assert [part.order.tolist() for part in fitted[:1]] == [list(range(6))]
    (true,) = declared(made.cell, made.recording).problem.groups
    poses, flanges = true.measurement.measured_camera_from_target, true.hand.base_from_flange
    for stream, by, part in zip([None, None, "hand", "hand"], [1, -1, 1, -1], fitted[1:], strict=True):
        kept = list(range(1, 13)) if by > 0 else list(range(12))
        assert part.order.tolist() == kept[6:]
        (group,) = part.problem.groups
        order = np.argsort(group.sample)
        other, own = group.sample[order] - by, group.sample[order]
        seen, hand = (other, own) if stream is None else (own, other)
        found = group.measurement.measured_camera_from_target[order]
        np.testing.assert_array_equal(found.matrix, poses[seen].matrix)
        np.testing.assert_array_equal(group.hand.base_from_flange[order].matrix, flanges[hand].matrix)


@pytest.mark.parametrize(("count", "some"), [(11, False), (12, True)])
def test_slip_search_needs_twelve_samples(monkeypatch, count, some):
    """Twelve samples are needed, six on each side; the two likeliest slips are returned, best first."""
    made = simulate(Scenario(samples=count, target="pose"), 0)
    monkeypatch.setattr(pairing, "_fit_readings", lambda readings, lenses: [{k: k} for k in range(len(readings))])
    monkeypatch.setattr(
        pairing, "_sample_errors", lambda pairs, order, fits: np.full(count, 0.1 * (7 - next(iter(fits))))
    )
    found = slip_hypotheses(declared(made.cell, made.recording), made.cameras, [None, "eye", "hand"])
    assert [fits for _, fits in found] == ([{6: 6}, {5: 5}] if some else [])


def test_later_stream_loses_sample_at_slip(monkeypatch):
    """A stream shifted to later leaves one sample out at the slip; one shifted to earlier loses its last."""
    made = simulate(Scenario(samples=12, target="pose"), 0)
    lost = []
    monkeypatch.setattr(pairing, "_fit_readings", lambda readings, lenses: [{} for _ in readings])
    monkeypatch.setattr(pairing, "_find_slip", lambda before, after, by: lost.append(by) or (0.1, 5))
    found = slip_hypotheses(declared(made.cell, made.recording), made.cameras, [None])
    assert lost == [1, 1, 0, 0]
    assert "from sample 5 on belongs 1 sample later" in found[0][0].words


def test_sample_errors_are_rms_over_views(monkeypatch):
    """Sample errors are the rms over the views of fitted pairs; NaN for a sample without views."""
    offs = {"a": [0.1, 0.2, 0.3], "b": [0.4, 0.5], "c": [9.0, 9.0]}
    monkeypatch.setattr(pairing, "loop_errors", lambda sight, triple: np.array(offs[triple]))
    pairs = [
        SimpleNamespace(group=SimpleNamespace(camera=camera, target="board", sample=np.array(rows)))
        for camera, rows in (("a", [7, 2, 5]), ("b", [2, 4]), ("c", [1, 2]))
    ]
    fits = {(name, "board"): SimpleNamespace(triple=name) for name in "ab"}
    order = SimpleNamespace(order=np.array([1, 2, 4, 5, 7]))
    expected = [np.nan, np.sqrt((0.2**2 + 0.4**2) / 2), 0.5, 0.3, 0.1]
    np.testing.assert_allclose(pairing._sample_errors(pairs, order, fits), expected)


def test_turned_views_align_with_first_view():
    """Views read from the other end are found relative to the first view, few or many of them, but for noise."""
    turn = half_turn(chessboard_target((8, 6), 0.03))
    poses = SE3.exp(0.3 * np.random.default_rng(0).standard_normal((9, 6)))
    for other in ([1], [2, 5, 7], [1, 2, 3, 4, 5, 6, 7]):
        is_other = np.isin(np.arange(9), other)
        turned = poses @ turn
        read = SE3(*(np.where(is_other[(...,) + (None,) * (a.ndim - 1)], b, a) for a, b in
                     ((poses.rotation, turned.rotation), (poses.translation, turned.translation))))  # fmt: skip
        np.testing.assert_array_equal(pairing._is_nearer_turned(read, read @ turn), is_other)
    assert not pairing._is_nearer_turned(poses, poses).any()


def test_turned_views_are_found_in_wide_spread():
    """Turned views spread by half a radian are found in nine of ten recordings.

    By the first view alone it would be six or seven.
    """
    turn, rng, correct_count = half_turn(chessboard_target((8, 6), 0.03)), np.random.default_rng(1), 0
    for _ in range(100):
        poses = SE3.exp(np.pad(0.5 * rng.standard_normal((20, 3)), ((0, 0), (3, 0))))
        is_other = rng.random(20) < 0.3
        read = poses @ SE3(np.where(is_other[:, None, None], turn.rotation, np.eye(3)), np.zeros((20, 3)))
        found = pairing._is_nearer_turned(read, read @ SE3(turn.rotation, np.zeros(3)))
        correct_count += bool(np.all(found == is_other) or np.all(found != is_other))
    assert correct_count >= 85


@pytest.mark.parametrize("count", [5, 6])
def test_half_turns_need_six_views(count):
    """Six views of a grid show which ones are turned.

    Views of other targets, or of other measurements, do not count.
    """
    board = chessboard_target((8, 6), 0.03)
    made = simulate(Scenario(samples=count, target="pose", board=board), 0)
    (entry,) = made.cell.targets.values()
    others = {name: replace(entry, name=name) for name in ("other", "blank")}
    cell = replace(made.cell, targets={"board": replace(entry, target=board), **others})
    turn = half_turn(board)
    samples = []
    for k, sample in enumerate(made.recording.samples):
        (seen,) = sample.observations
        other = replace(seen, target="other", camera_from_target=seen.camera_from_target @ turn)
        mine = replace(seen, camera_from_target=seen.camera_from_target @ turn) if k == 2 else seen
        samples.append(replace(sample, observations=(mine, other)))
    found = half_turn_hypotheses(declared(cell, Recording(tuple(samples))))
    assert [h.about for h in found] == ([] if count < 6 else [("board", "2"), ("board", *"01345")])
    if found:
        given, true = declared(cell, Recording(tuple(samples))), declared(made.cell, made.recording)
        groups = {g.target: g.measurement.measured_camera_from_target for g in found[0].reread(given).problem.groups}
        poses = true.problem.groups[0].measurement.measured_camera_from_target
        np.testing.assert_allclose(groups["board"].matrix, poses.matrix, atol=1e-9)
        (other,) = (g for g in given.problem.groups if g.target == "other")
        np.testing.assert_array_equal(groups["other"].matrix, other.measurement.measured_camera_from_target.matrix)
