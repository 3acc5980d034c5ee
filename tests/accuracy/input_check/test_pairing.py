"""Where the pairing slips, and which views of a grid are upside down."""

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


def test_the_sample_of_a_missed_detection_is_found():
    """Observations from sample 9 on one too early: the first guess moves them back from there."""
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


def test_the_last_few_samples_are_no_slip():
    """The last two observations are of one sample later: no guess is from there on, which outliers would explain."""
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


def test_few_samples_give_no_slip():
    """With fewer than six samples to either side there is nothing to start from."""
    made = simulate(Scenario(samples=11), 0)
    assert slip_hypotheses(declared(made.cell, made.recording), made.cameras, [None]) == []


def test_turned_views_are_found():
    """Of the two readings one turns exactly the views that were read from the other end."""
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
    """Of more the first ten stand in the words, and all are turned."""
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
def test_the_change_is_where_fewest_samples_are_off(at, lost):
    """Before it as recorded, after it as shifted; what is lost there is off in neither way, and is not counted."""
    rng = np.random.default_rng(0)
    fine, off = 0.002 * rng.uniform(0.8, 1.2, 20), 0.3 * rng.uniform(0.8, 1.2, 20)
    before = np.where(np.arange(20) < at, fine, off)
    after = np.where(np.arange(20) < at + lost, off, fine)
    score, found = pairing._find_slip(before, after, lost)
    counted = np.concatenate([fine[:at], fine[at + lost :]])
    assert found == at
    assert score == pytest.approx(np.sqrt(np.sum(counted**2) / 20))


def test_a_change_nearer_to_an_end_than_four_samples_is_none():
    """The best of the others is told, at which what is off counts as off by four times the rest, whatever it is."""
    before, after = np.full(20, 0.01), np.full(20, np.nan)
    before[18:] = 7.0
    after[18:] = 0.01
    score, found = pairing._find_slip(before, after, 0)
    assert found == 16
    assert score == pytest.approx(np.sqrt((16 * 0.01**2 + 2 * 0.04**2 + 2 * 0.01**2) / 20))
    assert pairing._find_slip(before / 100, after / 100, 0)[1] == 16


def test_loops_that_close_well_are_alike():
    """Below 5 mrad what is smaller still is no better: four times that is as far as a sample can be off."""
    before, after = np.full(20, 1e-6), np.full(20, 1.0)
    before[10:], after[10:] = 1.0, 1e-6
    before[5] = 0.9
    score, found = pairing._find_slip(before, after, 0)
    assert found == 10
    assert score == pytest.approx(np.sqrt((19 * 1e-12 + 0.02**2) / 20))


def test_what_counts_as_off_goes_by_the_best_two_fifths():
    """Of either pairing: half of the samples of the better one are off by as much as a sample can be."""
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


def test_the_halves_are_fitted_as_recorded_and_as_shifted(monkeypatch):
    """The first half as it is, the second with each stream one sample later and earlier; twelve samples are enough."""
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
def test_six_samples_to_either_side_are_needed(monkeypatch, count, some):
    """And the two likeliest slips are given, best first."""
    made = simulate(Scenario(samples=count, target="pose"), 0)
    monkeypatch.setattr(pairing, "_fit_readings", lambda readings, lenses: [{k: k} for k in range(len(readings))])
    monkeypatch.setattr(
        pairing, "_sample_errors", lambda pairs, order, fits: np.full(count, 0.1 * (7 - next(iter(fits))))
    )
    found = slip_hypotheses(declared(made.cell, made.recording), made.cameras, [None, "eye", "hand"])
    assert [fits for _, fits in found] == ([{6: 6}, {5: 5}] if some else [])


def test_a_stream_that_comes_later_leaves_a_sample_out(monkeypatch):
    """Where it changes nothing is left for that sample; one that comes earlier loses its last."""
    made = simulate(Scenario(samples=12, target="pose"), 0)
    lost = []
    monkeypatch.setattr(pairing, "_fit_readings", lambda readings, lenses: [{} for _ in readings])
    monkeypatch.setattr(pairing, "_find_slip", lambda before, after, by: lost.append(by) or (0.1, 5))
    found = slip_hypotheses(declared(made.cell, made.recording), made.cameras, [None])
    assert lost == [1, 1, 0, 0]
    assert "from sample 5 on belongs 1 sample later" in found[0][0].words


def test_how_far_samples_are_off(monkeypatch):
    """Root of the mean square over the views of a sample, of pairs that were fitted; NaN where it has none."""
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


def test_views_are_turned_to_the_end_of_the_first():
    """Few or many that were read from the other end, but for noise."""
    turn = half_turn(chessboard_target((8, 6), 0.03))
    poses = SE3.exp(0.3 * np.random.default_rng(0).standard_normal((9, 6)))
    for other in ([1], [2, 5, 7], [1, 2, 3, 4, 5, 6, 7]):
        is_other = np.isin(np.arange(9), other)
        turned = poses @ turn
        read = SE3(*(np.where(is_other[(...,) + (None,) * (a.ndim - 1)], b, a) for a, b in
                     ((poses.rotation, turned.rotation), (poses.translation, turned.translation))))  # fmt: skip
        np.testing.assert_array_equal(pairing._is_nearer_turned(read, read @ turn), is_other)
    assert not pairing._is_nearer_turned(poses, poses).any()


def test_views_far_from_the_first_are_turned_to_the_others():
    """Views spread by half a radian: told in nine of ten recordings, by the first view alone in six or seven."""
    turn, rng, told = half_turn(chessboard_target((8, 6), 0.03)), np.random.default_rng(1), 0
    for _ in range(100):
        poses = SE3.exp(np.pad(0.5 * rng.standard_normal((20, 3)), ((0, 0), (3, 0))))
        is_other = rng.random(20) < 0.3
        read = poses @ SE3(np.where(is_other[:, None, None], turn.rotation, np.eye(3)), np.zeros((20, 3)))
        found = pairing._is_nearer_turned(read, read @ SE3(turn.rotation, np.zeros(3)))
        told += bool(np.all(found == is_other) or np.all(found != is_other))
    assert told >= 85


@pytest.mark.parametrize("count", [5, 6])
def test_six_views_of_a_grid_show_which_are_turned(count):
    """Of this target alone: views of others do not count, nor does what was seen otherwise."""
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
