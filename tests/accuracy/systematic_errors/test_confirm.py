"""Tests of the confirmation by held-out blocks: effects in all blocks are confirmed, in a single one not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, views
from tests.pose_problem import pose_problem

from basecal.accuracy.systematic_errors import confirm
from basecal.accuracy.systematic_errors.confirm import HeldOut, _configuration_blocks, _gain, _time_blocks
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Recording, RobotState, Sample
from basecal.effects.faces.candidates import Candidates
from basecal.effects.length_scale import candidates as length_scales
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def situation(factor):
    """Twenty-five samples of a hand whose lengths are off by a factor."""
    made = simulate(Scenario(samples=25, robot_noise=(1e-4, 1e-4)), 0)
    samples = []
    for sample in made.recording.samples:
        pose = sample.robots["hand"].base_from_flange
        read = SE3(pose.rotation, factor * pose.translation)
        samples.append(Sample(sample.sample, None, {**sample.robots, "hand": RobotState(read)}, sample.observations))
    problem, _ = build_problem(made.cell, Recording(tuple(samples)))
    return Situation(problem, solve_problem(problem, made.cell).state, problem, {})


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_wrong_length_scale_predicts_held_out_blocks(factor):
    """A length scale off by one per cent predicts held-out blocks and is confirmed, in both directions."""
    of = situation(factor)
    (scale,) = [c for c in length_scales(of) if c.about == ("hand",)]
    assert HeldOut(of, of.linearisation).confirms(scale)


def test_error_in_one_block_is_not_confirmed():
    """An error of a single view predicts no other and is not confirmed."""
    of = situation(1.0)
    moves = np.zeros((25, 1, 6, 1))
    moves[7, 0, 0, 0] = 1.0
    assert not HeldOut(of, of.linearisation).confirms(Candidates("", ("hand",), (None,), "", (moves,)))


def test_time_blocks_are_fifths():
    """Time blocks are fifths of equal sizes in sample order; without samples there are none."""
    for count, wanted in ((5, [0, 1, 2, 3, 4]), (10, [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]), (3, [0, 1, 3]), (0, [])):
        assert _time_blocks(SimpleNamespace(samples=np.zeros(count))).tolist() == wanted


@pytest.mark.parametrize("robots", [("eye", "hand"), ("hand",)])
def test_configuration_blocks_follow_widest_spread(robots):
    """Configuration blocks follow the widest spread of all robots' positions, each sample in its row, in any group.

    Without positions there is no spread.
    """
    rng = np.random.default_rng(3)
    along = rng.permutation(10)
    places = 1e-3 * rng.standard_normal((10, 3)) + (along[:, None] - 4.5) * np.array([0.1, -0.3, 0.2]) + 5.0
    order = rng.permutation(10)
    of_hand, of_eye = views(end(), end("hand")), views(end("eye"), end())
    groups = [replace(of_hand, sample=order[:6]), replace(of_eye, sample=order[6:]), replace(of_hand, sample=order[6:])]

    def pose(k, robot):
        """The hand along a line, the eye in one place."""
        where = places[groups[k].sample] if robot == "hand" else np.zeros((4, 3))
        return SE3(np.tile(np.eye(3), (len(where), 1, 1)), where)

    of = SimpleNamespace(
        samples=np.arange(10), robots=robots, groups=groups, sample_indices=lambda g: g.sample, recorded_pose=pose
    )
    found = _configuration_blocks(of)
    wanted = along // 2
    assert found.tolist() in (wanted.tolist(), (4 - wanted).tolist())
    nowhere = SimpleNamespace(samples=np.arange(10), robots=(), groups=groups)
    assert _configuration_blocks(nowhere).tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]


def test_gain_is_cost_decrease_of_held_out_blocks():
    """The gain is the cost decrease of held-out blocks, by fits of the others with and without the effect.

    Each fit is a linear system, as views are nearly linear.
    """
    rng = np.random.default_rng(6)
    problem, state = pose_problem(1e-3 * rng.standard_normal((8, 6)), np.array([1e-3, 2e-3, 1e-3, 1e-3, 3e-3, 1e-3]))
    of = Situation(problem, state, problem, {})
    blocks, moves = np.array([0, 0, 1, 1, 2, 2, 2, 0]), rng.standard_normal((8, 1, 6, 2))
    (views,) = of.linearisation.views
    both = np.concatenate([views.by_unknowns, moves[:, 0]], axis=-1)
    wanted = 0.0
    for block in range(3):
        used, held = np.flatnonzero(blocks != block), np.flatnonzero(blocks == block)
        for sign, by in ((1, views.by_unknowns), (-1, both)):
            hessian, gradient = (by.mT @ views.information @ by), (by.mT @ views.gradient[..., None])[..., 0]
            best = -np.linalg.solve(hessian[used].sum(0), gradient[used].sum(0))
            wanted += sign * float(2 * best @ gradient[held].sum(0) + best @ hessian[held].sum(0) @ best)
    held_out, error = HeldOut(of, of.linearisation), Candidates("", ("camera",), (None,), "", (moves,))
    found = sum(_gain(held_out._fold(blocks == block), error) for block in range(3))
    assert found == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(("gains", "wanted"), [
    ((0.1, 0.1), True), ((0.1, -0.1), False), ((-0.1, 0.1), False), ((0.1, 0.0), False), ((0.0, 0.1), False),
])  # fmt: skip
def test_both_kinds_of_blocks_must_gain(monkeypatch, gains, wanted):
    """Blocks of time and of configuration must both gain, by however little; zero is no gain."""
    monkeypatch.setattr(confirm, "_gain", lambda fold, candidate: fold)
    monkeypatch.setattr(HeldOut, "folds", [(0.25, gain - 0.25) for gain in gains])
    assert HeldOut(None, None).confirms(None) == wanted
