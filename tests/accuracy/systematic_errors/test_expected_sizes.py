"""Tests of effects of an expected size: their uncertainty, and how far they move the answer."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from tests.touch_cells import recorded, touch_cell, touch_lines

from basecal.accuracy.clocks.step import clock_step
from basecal.accuracy.covariance.widening import state_step
from basecal.accuracy.systematic_errors import expected_sizes
from basecal.accuracy.systematic_errors.expected_sizes import (
    ExpectedEffect,
    contain_expected_sizes,
    posteriors_by_sigma,
    size_posterior,
    with_expected_sizes,
)
from basecal.accuracy.systematic_errors.score_tests import linearise_views
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Clock, RobotState
from basecal.effects import lens_sag, mount_bend, target_size
from basecal.effects.faces.effect import FoundEffect, SigmaPrior
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve, solve_problem
from basecal.estimation.streams.streams import recording_streams, synchronise
from basecal.geometry import SE3
from basecal.numerics.mixtures import mixture, probabilities
from basecal.simulation import Scenario, simulate
from stream_cells import streamed

OPEN = Scenario(samples=12, state_pixel_noise=False, robot_noise=(1e-4, 1e-4))
MADE = simulate(OPEN, 3)
QUIET = simulate(Scenario(samples=24, robot_noise=(2e-5, 5e-5), pixel_px=0.05), 1)
STATED = Settings(robot_noise="stated")
FOUND = FoundEffect("target_size", "length-scale", "board", False, True, None, "", *(np.zeros(k) for k in (1, 1, 1)))
DOWN = np.array([0.0, 0.0, -1.0])


def with_board(cell, share=1.0, **stated):
    """A cell whose board is larger by a share, or has other statements."""
    board = cell.targets["board"]
    target = replace(board.target, points=board.target.points * share)
    return replace(cell, targets={"board": replace(board, target=target, **stated)})


def cover_single_effect(solution, module, *sigmas):
    """Mean and covariance of one effect alone."""
    problem = solution.noise.hold_sigmas(solution.problem)
    situation = Situation(problem, solution.state, problem, {}, solution.noise)
    candidates = module.candidates(situation)
    prior = SigmaPrior(np.array(sigmas), np.full(len(sigmas), 1 / len(sigmas)))
    is_contained = not module.EFFECT.expected.is_stated
    effects = [ExpectedEffect(module.EFFECT.name, each, prior, is_contained) for each in candidates]
    known = size_posterior(situation, (), effects)
    return SimpleNamespace(
        mean=known.by_sizes @ known.mean, covariance=known.by_sizes @ known.covariance @ known.by_sizes.T
    )


def bend_mount(made, size_rad, robot="hand"):
    """A recording whose mount on a robot rotates by l x g, with l along x of the flange.

    The poses err the other way.
    """

    def recorded(pose):
        turn = np.cross([size_rad, 0.0, 0.0], pose.rotation.T @ DOWN)
        return RobotState(pose @ SE3.exp(-np.append(np.zeros(3), turn)))

    samples = tuple(
        replace(s, robots={**s.robots, robot: recorded(s.robots[robot].base_from_flange)})
        for s in made.recording.samples
    )
    return replace(made.recording, samples=samples)


def test_sigma_of_size_moves_answer_as_larger_board():
    """A small sigma of the target size moves the answer as a larger board does.

    It is far below what the data determine and spreads the columns by their own difference quotient.
    """
    sigma, share = 1e-7, 1e-4
    solution = solve(MADE.cell, MADE.recording, STATED)
    larger = solve(with_board(MADE.cell, 1 + share), MADE.recording, STATED)
    expected = state_step(solution.problem, solution.state, larger.state) * sigma / share
    found = cover_single_effect(solution, target_size, sigma).covariance
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.abs(expected), rtol=0.02, atol=0.01 * np.abs(expected).max())


@pytest.mark.parametrize("module", [target_size, mount_bend, lens_sag])
def test_wide_sigma_is_limited_by_data(module):
    """A sigma a hundred times wider than one far beyond the data's own changes the covariance little."""
    solution = solve(QUIET.cell, QUIET.recording, STATED)
    first, second = (cover_single_effect(solution, module, sigma) for sigma in (1.0, 100.0))
    np.testing.assert_allclose(
        first.covariance, second.covariance, rtol=1e-3, atol=1e-3 * np.abs(first.covariance).max()
    )


@pytest.mark.parametrize(
    ("made", "stated", "found", "counts"),
    [
        (MADE, {}, None, True),
        (MADE, {"size_sigma": 0.0}, None, False),
        (MADE, {}, FOUND, False),
        (MADE, {}, replace(FOUND, about="other"), True),
        (simulate(replace(OPEN, state_pixel_noise=True), 3), {}, None, False),
        (simulate(replace(OPEN, state_pixel_noise=True), 3), {"size_sigma": 2e-4}, None, True),
        (simulate(replace(OPEN, target="led"), 3), {}, None, False),
    ],
)
def test_targets_whose_size_counts(monkeypatch, made, stated, found, counts):
    """A size counts if the target's views state no noise or a sigma of the size is stated.

    Exact sizes, found ones, and single points do not count.
    """
    name = next(iter(made.cell.targets))
    cell = replace(made.cell, targets={name: replace(made.cell.targets[name], **stated)})
    solution = solve(cell, made.recording, STATED)
    given = []
    monkeypatch.setattr(
        expected_sizes,
        "size_posterior",
        lambda at, fields, each, axes: given.extend(each) or size_posterior(at, fields, each, axes),
    )
    with_expected_sizes(cell, solution, found)
    assert any(each.effect == "target_size" for each in given) == counts
    assert any(each.effect == "mount_bend" for each in given)


def test_failed_answer_is_unchanged():
    """The answer of a solve that did not converge is unchanged."""
    failed = replace(solve(MADE.cell, MADE.recording, STATED), converged=False)
    assert with_expected_sizes(MADE.cell, failed, None) is failed


def test_target_size_does_not_move_answer():
    """The answer stays that of the stated size; its covariance covers that of the data's size, too."""
    solution = solve(with_board(MADE.cell, 1.001), MADE.recording, STATED)
    known, wide = (cover_single_effect(solution, target_size, sigma) for sigma in (1e-6, 1e-2))
    assert not wide.mean.any()
    assert np.sqrt(np.trace(wide.covariance)) > 100 * np.sqrt(np.trace(known.covariance))


def test_bending_mount_moves_answer_to_truth():
    """With the effect, a mount that bends by 3 mrad leaves the base within its sigmas, without it far off."""
    recording = bend_mount(QUIET, 3e-3)
    before = solve(QUIET.cell, recording, STATED)
    after = with_expected_sizes(QUIET.cell, before, None)
    far, near = (distance(each) for each in (before, after))
    assert far > 100
    assert near < 16.8  # 99 % of chi-square with 6 freedoms
    name = QUIET.cell.requested_transforms[0]
    assert np.trace(after.transforms[name].covariance) < 4 * np.trace(before.transforms[name].covariance)


def distance(solution):
    """Squared distance of the base from the truth in its sigmas."""
    name = QUIET.cell.requested_transforms[0]
    off = (solution.transforms[name].mean.inverse() @ QUIET.truth[name]).log()
    return float(off @ np.linalg.solve(solution.transforms[name].covariance, off))


def test_clean_answer_stays_precise():
    """Effects that the data show to be small widen the base's sigmas by less than a fifth on average."""
    before = solve(QUIET.cell, QUIET.recording, STATED)
    after = with_expected_sizes(QUIET.cell, before, None)
    name = QUIET.cell.requested_transforms[0]
    wider = np.log([np.diag(each.transforms[name].covariance) for each in (after, before)])
    assert 1.0 <= np.exp(0.5 * np.mean(wider[0] - wider[1])) < 1.2


def test_many_effects_are_computed_by_mount(monkeypatch):
    """Too many effects for one computation are handled by robot, mount or target."""
    robots = {name: replace(robot, is_total_noise=False) for name, robot in MADE.cell.robots.items()}
    cell, solution, given = replace(MADE.cell, robots=robots), solve(MADE.cell, MADE.recording, STATED), []
    monkeypatch.setattr(expected_sizes, "_MOST_TOGETHER", 3)
    monkeypatch.setattr(
        expected_sizes,
        "size_posterior",
        lambda at, fields, each, axes: given.append((each, axes)) or size_posterior(at, fields, each, axes),
    )
    after = with_expected_sizes(cell, solution, None)
    assert [[each.robot for each in axes] for _, axes in given] == [["eye"], ["hand"], [], [], [], []]
    names = [{each.candidate.about for each in group} for group, _ in given]
    assert names == [
        set(),
        set(),
        {("eye_flange_from_wrist",)},
        {("hand_flange_from_board",)},
        {("wrist",)},
        {("board",)},
    ]
    assert (np.linalg.eigvalsh(after.covariance - solution.covariance) > -1e-18).all()


def test_touching_tips_have_no_bend_or_play():
    """Tips of exact arms that touch marks neither bend nor slide.

    The covariance is that of the touches, and the answer stays.
    """
    cell = touch_cell()
    solution = solve(cell, recorded(cell, touch_lines(np.random.default_rng(1), 24, 2e-4, is_stated=True)))
    found = with_expected_sizes(cell, solution, None)
    np.testing.assert_allclose(found.covariance, solution.covariance, rtol=1e-3, atol=1e-12)


def test_mounts_of_single_points_have_no_bend_or_play():
    """LEDs and reflectors are light: their mounts have no bend or play, the camera's has."""
    made = simulate(Scenario(samples=20, target="led"), 2)
    solution = solve(made.cell, made.recording, STATED)
    problem = solution.noise.hold_sigmas(solution.problem)
    situation = Situation(problem, solution.state, problem, {}, solution.noise)
    given = expected_sizes._cell_effects(made.cell, situation, None)
    bent = {each.candidate.about[0] for each in given if each.effect in ("mount_bend", "mount_play")}
    assert bent == {"eye_flange_from_wrist"}


@pytest.mark.parametrize("clock", [Clock("free", 0.03), Clock("prior", 0.0315, 1e-3)])
def test_sizes_and_clock_offsets_share_posterior(monkeypatch, clock):
    """Answer, clock offset and bend have one posterior.

    The reference solves the normal equations of all three, one millisecond off the optimum.
    """
    made, sigma = streamed(clock=clock), 3e-3
    offsets_s = {"arm": 0.0, "wrist": 0.031}
    streams = recording_streams(made.cell, made.recording)
    samples = synchronise(streams, offsets_s)
    solution = solve_problem(build_problem(made.cell, samples.recording)[0], made.cell)
    left = clock_step(streams, samples, offsets_s, solution)
    (bend,) = mount_bend.candidates(Situation(solution.problem, solution.state, solution.problem, {}))
    expected = ExpectedEffect("mount_bend", bend, SigmaPrior.single_value(sigma))
    monkeypatch.setattr(expected_sizes, "known_sizes", lambda *of: [size_posterior(of[1], (), [expected])])
    found = contain_expected_sizes(made.cell, solution, None, left.offsets)
    (views,), p = linearise_views(solution.problem, solution.state).views, solution.problem.width
    by_all = np.concatenate([views.by_unknowns, left.offsets.moves[0], bend.moves[0][:, 0]], axis=-1)
    hessian = np.einsum("nik,nij,njl->kl", by_all, views.information, by_all)
    gradient = np.einsum("nik,ni->k", by_all, views.gradient)
    off_s = 0.031 + left.step_s[0] - clock.offset_s
    beforehand = 0.5 if clock.sigma_s is None else np.hypot(clock.sigma_s, off_s)
    hessian += np.diag([*np.zeros(p), beforehand**-2, *np.full(3, sigma**-2)])
    gradient[p] += (0.031 - clock.offset_s) / beforehand**2 if clock.sigma_s else 0.0
    both, clocked = slice(0, p + 4), slice(0, p + 1)
    wide, plain = (np.linalg.inv(hessian[at, at]) for at in (both, clocked))
    steps = [-inverse @ gradient[: len(inverse)] for inverse in (wide, plain)]
    moved, added = steps[0][clocked] - steps[1], wide[clocked, clocked] - plain
    np.testing.assert_allclose(found.shift_s, moved[p:], rtol=1e-6)
    np.testing.assert_allclose(found.offset_covariance, added[p:, p:], rtol=1e-6)
    added_to_answer = found.solution.covariance - solution.covariance
    np.testing.assert_allclose(added_to_answer, added[:p, :p], atol=1e-6 * np.abs(added[:p, :p]).max())
    np.testing.assert_allclose(
        state_step(solution.problem, solution.state, found.solution.state),
        moved[:p],
        atol=1e-6 * np.abs(moved[:p]).max(),
    )
    assert added[p, p] > 0.1 * plain[p, p]


def draw_prior(rng, options, width):
    """A prior over several options of sigmas of several sizes, the first option all zero."""
    sigmas = np.concatenate([np.zeros((1, width)), rng.uniform(0.1, 2, (options - 1, width))])
    return SigmaPrior(sigmas, rng.dirichlet(np.ones(options)))


def all_at_once(gradient, information, priors):
    """Each combination of sigmas alone: prior shares, logarithms of the evidence, means and covariances."""
    shares, evidences, means, covariances = [], [], [], []
    for each in product(*(zip(p.sigmas, p.probabilities, strict=True) for p in priors)):
        s = np.diag(np.concatenate([sigmas for sigmas, _ in each]))
        covariance = s @ np.linalg.inv(s @ information @ s + np.eye(len(s))) @ s
        means.append(-covariance @ gradient)
        covariances.append(covariance)
        evidences.append(gradient @ covariance @ gradient - np.linalg.slogdet(s @ information @ s + np.eye(len(s)))[1])
        shares.append(np.prod([share for _, share in each]))
    return tuple(np.array(each) for each in (shares, evidences, means, covariances))


@pytest.mark.parametrize("widths", [(3,), (2, 3), (4, 1, 2), (0, 2, 0)])
def test_posterior_by_levels_equals_all_combinations(widths):
    """Sizes eliminated level by level have the posterior of all combinations of sigmas solved separately."""
    rng, q = np.random.default_rng(3), sum(widths)
    root, gradient = rng.normal(size=(q + 2, q)), rng.normal(size=q)
    priors = [draw_prior(rng, options, width) for options, width in zip((3, 4, 5), widths, strict=False)]
    shares, evidences, means, covariances = all_at_once(gradient, root.T @ root, priors)
    given = posteriors_by_sigma(gradient, root.T @ root, priors)
    found = mixture(priors[0].probabilities, given)
    weights = probabilities(shares, evidences)
    mean = weights @ means
    off = means - mean
    np.testing.assert_allclose(found.two_log_evidence, 2 * np.log(shares @ np.exp(0.5 * evidences)))
    np.testing.assert_allclose(found.mean, mean, atol=1e-12)
    spread = np.einsum("m,mij->ij", weights, covariances + off[:, :, None] * off[:, None])
    np.testing.assert_allclose(found.covariance, spread, atol=1e-12)
    of_first = weights.reshape(len(priors[0].probabilities), -1).sum(1)
    np.testing.assert_allclose(probabilities(priors[0].probabilities, given.two_log_evidence), of_first)


@pytest.mark.parametrize("sigmas", [None, [], [0.1, 0.2]])
def test_failed_solution_moves_no_clock(monkeypatch, sigmas):
    """A failed solution adds zero to each clock offset, for any number of clocks."""
    offsets = None if sigmas is None else SimpleNamespace(sigma_s=np.array(sigmas))
    monkeypatch.setattr(
        expected_sizes, "situate", lambda solution, offsets: SimpleNamespace(problem=SimpleNamespace(width=6))
    )
    solution = SimpleNamespace(converged=False)
    found = expected_sizes.contain_expected_sizes(None, solution, None, offsets)
    assert found[0] is solution
    count = len(sigmas or [])
    np.testing.assert_array_equal(found[1], np.zeros(count))
    np.testing.assert_array_equal(found[2], np.zeros((count, count)))


@pytest.mark.parametrize(
    ("counts", "size"),
    [
        ([], 0.0),
        ([{"stated": 9}], 0.0),
        ([{"stated": 9}, {"pixel_px": 1}], 5e-4),
        ([{"pose_m": 1, "pixel_px": 0}], 5e-4),
        ([{"point_m": 4}], 0.0),
    ],
)
def test_unstated_noise_leaves_target_size_uncertain(counts, size):
    """Views of unstated noise leave the target's own size uncertain; a stated size sigma counts for any measurement."""
    groups = [SimpleNamespace(target="board", measurement=SimpleNamespace(counts=lambda of=of: of)) for of in counts]
    groups.append(SimpleNamespace(target="other", measurement=SimpleNamespace(counts=lambda: {"pixel_px": 3})))
    for stated, found in ((None, size), (0.0, 0.0), (2e-3, 2e-3)):
        target = SimpleNamespace(has_free_scale=False, size_sigma=stated)
        cell = SimpleNamespace(targets={"board": target})
        assert expected_sizes._size_sigma(cell, tuple(groups), "board") == found


def test_unit_error_is_per_target(monkeypatch):
    """The unit of each target has its own mean and sigma, without other priors beside it."""
    asked = []
    candidates = [SimpleNamespace(about=(name,)) for name in ("first", "second")]
    monkeypatch.setattr(expected_sizes.target_size, "candidates", lambda situation: iter(candidates))

    def posterior(situation, fields, expected):
        asked.append((fields, expected))
        return SimpleNamespace(mean=np.array([0.01]), covariance=np.array([[0.04]]))

    monkeypatch.setattr(expected_sizes, "size_posterior", posterior)
    assert expected_sizes.unit_error(None, "second") == pytest.approx((0.01, 0.2))
    ((fields, (only,)),) = asked
    assert fields == ()
    assert only[1] is candidates[1]
