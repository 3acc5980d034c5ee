"""Tests of Laplace approximations: unknown sigmas widen the covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.estimation.noise.test_reml import NOISY, ROBOTS, problem_at_truth
from tests.made_up_model import made_up

from basecal.effects.faces.shared_errors import SharedErrors, SharedPrior
from basecal.estimation.noise import laplace
from basecal.estimation.noise.hyperpriors import LogNormals, hyperpriors
from basecal.estimation.noise.laplace import (
    Secant,
    SigmaPosterior,
    correct_curvature,
    integrated_covariance,
    moments,
    sigma_posterior,
)
from basecal.estimation.noise.mixed_model import mixed_model
from basecal.estimation.noise.reml import posterior, scales
from basecal.estimation.noise.robot_noise import count_stops
from quick import quick


def test_integration_over_sigmas_widens_the_covariance(small_posterior):
    """The mode of the sigmas is stationary, and the integrated covariance is larger than the one at the mode."""
    assert (
        np.abs(
            posterior(small_posterior.model, small_posterior.logs).slope()
            + small_posterior.prior.value(small_posterior.logs)[1]
        ).max()
        < 0.1
    )
    whole = integrated_covariance(
        [small_posterior], np.ones(1), posterior(small_posterior.model, small_posterior.logs).step
    )
    assert np.trace(whole[:6, :6]) > 1.02 * np.trace(
        posterior(small_posterior.model, small_posterior.logs).covariance[:6, :6]
    )


def test_models_are_weighted_by_relative_evidence(small_posterior):
    """The weights do not depend on the absolute evidence: two equal models have the covariance of either."""
    small_posterior = replace(small_posterior, covariance=1e-6 * np.eye(len(small_posterior.logs)))
    alone = integrated_covariance(
        [small_posterior], np.ones(1), posterior(small_posterior.model, small_posterior.logs).step
    )
    for minus_2_log_evidence in (-1e5, 0.0, 1e5):
        both = [
            replace(small_posterior, minus_2_log_evidence=minus_2_log_evidence),
            replace(small_posterior, minus_2_log_evidence=minus_2_log_evidence),
        ]
        np.testing.assert_allclose(
            integrated_covariance(both, np.ones(2), posterior(small_posterior.model, small_posterior.logs).step),
            alone,
            rtol=1e-9,
        )


@pytest.mark.journey
@pytest.mark.parametrize(("samples", "seed", "nodes"), quick([(4, 2, 1500), (5, 3, 4000)], [(4, 2, 1500)]))
def test_heavy_tails_of_few_stops_are_integrated(samples, seed, nodes):
    """The covariance equals that of many nodes weighted by prior and likelihood of the sigmas, to a tenth.

    Those differ by 3 % among themselves, of five stops with 4,000; nodes at one distance from the mode are short by a
    fifth here.
    """
    model = mixed_model(*problem_at_truth(replace(NOISY, samples=samples), seed), ROBOTS)
    prior = hyperpriors(model, dict.fromkeys(ROBOTS, 0.5))
    found = sigma_posterior(model, prior)
    whole = integrated_covariance([found], np.ones(1), posterior(found.model, found.logs).step)[:6, :6]
    rng, width = np.random.default_rng(seed), 2.0 * np.linalg.cholesky(found.covariance)
    total, weight = np.zeros((6, 6)), 0.0
    for _ in range(nodes):
        step = rng.standard_normal(len(found.logs))
        logs = found.logs + width @ step
        known = posterior(model, logs)
        minus_log = 0.5 * (known.value + prior.value(logs)[0] - found.minus_2_log_evidence) - 0.5 * step @ step
        off = (known.step - posterior(found.model, found.logs).step)[:6]
        share = np.exp(-minus_log)
        total += share * (known.covariance[:6, :6] + np.outer(off, off))
        weight += share
    ratio = np.trace(np.linalg.solve(total / weight, whole)) / 6
    assert 0.9 < ratio < 1.1


@pytest.mark.parametrize("samples", [4, 8, 20])
def test_covariance_is_independent_of_robot_order(samples):
    """Nodes are along axes of the posterior, not of the sigmas. Formerly, the drawn nodes depended on names."""
    problem, state = problem_at_truth(replace(NOISY, samples=samples), 3)
    covariances = []
    for robots in (ROBOTS, ROBOTS[::-1]):
        model = mixed_model(problem, state, robots)
        found = sigma_posterior(model, hyperpriors(model, dict.fromkeys(robots, 0.5)))
        covariances.append(integrated_covariance([found], np.ones(1), posterior(model, found.logs).step))
    np.testing.assert_allclose(*covariances, rtol=1e-6, atol=1e-9 * covariances[0].max())


def test_moments_integrate_the_whole_posterior():
    """Moments of unknowns are the integrated covariance about the state.

    Those of sigmas exceed the squares at the mode.
    """
    problem, state = problem_at_truth(NOISY)
    shared = {robot: SharedErrors.repeat_coordinates(np.ones((count_stops(problem, robot), 1))) for robot in ROBOTS}
    model = mixed_model(problem, state, ROBOTS, [shared])
    found = sigma_posterior(model, hyperpriors(model, dict.fromkeys(ROBOTS, 0.5), [SharedPrior((2.5, 2.0), "")]))
    columns = np.arange(len(model.prior))
    mean, covariance, squares = moments(found, columns)
    products = covariance + np.outer(mean, mean)
    whole = integrated_covariance([found], np.ones(1), np.zeros(model.width))
    np.testing.assert_allclose(products[: model.width, : model.width], whole, rtol=1e-9, atol=1e-9 * whole.max())
    excess = squares / np.exp(2 * found.logs)
    assert np.all(excess > 0.98)  # 128 samples of the sigmas of the views, which are known to 3 %
    assert np.all(excess[2:] > 1.3)
    # An error shared by all stops cannot be separated from mounts and bases: it has the size of its sigma, in metres.
    for robot in ROBOTS:
        first = model.layout.shared[0][robot][0]
        own = np.diag(products)[first : first + 6]
        expected = squares[model.sigmas.shared[0][robot]].repeat(3)
        assert np.all(own < 1.05 * expected)
        assert own.max() > 0.5 * expected.max()


@pytest.fixture(scope="module")
def small_posterior():
    """The posterior of the sigmas of a small model."""
    model = mixed_model(*problem_at_truth(NOISY), ROBOTS)
    return sigma_posterior(model, hyperpriors(model, dict.fromkeys(ROBOTS, 0.5)))


def test_evidence_is_laplaces_approximation(small_posterior):
    """The negative log evidence is -2 log of the height at the mode times a volume.

    The volume is that of a normal with that covariance.
    """
    assert (np.linalg.eigvalsh(small_posterior.covariance) > 0).all()
    here = posterior(small_posterior.model, small_posterior.logs)
    height = here.value + small_posterior.prior.value(small_posterior.logs)[0]
    assert small_posterior.minus_2_log_evidence == pytest.approx(
        height - np.linalg.slogdet(2 * np.pi * small_posterior.covariance)[1], rel=1e-9
    )
    information = 0.5 * (here.average_information() + small_posterior.prior.curvature)
    np.testing.assert_allclose(small_posterior.covariance, np.linalg.inv(information), rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(small_posterior.columns.mean[: small_posterior.model.width], here.step)


def test_mode_is_found_from_any_start(small_posterior):
    """The mode does not depend on the first logarithms, and no neighbours are more likely."""
    k = len(small_posterior.logs)

    def height(logs):
        return posterior(small_posterior.model, logs).value + small_posterior.prior.value(logs)[0]

    for start in (
        small_posterior.logs[:1] + 2.0,
        small_posterior.logs - 1.5,
        small_posterior.logs + np.resize([2.5, -2.5], k),
    ):
        again = sigma_posterior(small_posterior.model, small_posterior.prior, start)
        assert height(again.logs) == pytest.approx(height(small_posterior.logs), abs=0.02)
        np.testing.assert_allclose(again.logs, small_posterior.logs, atol=0.1)
    for step in 0.3 * np.eye(k):
        assert height(small_posterior.logs + step) > height(small_posterior.logs) < height(small_posterior.logs - step)


def test_sigmas_are_bounded_by_usual_devices():
    """For data without noise, views have a twentieth of the expected sigma, however vague the prior is."""
    exact = replace(NOISY, pixel_px=1e-9, robot_noise=(1e-9, 1e-9), state_pixel_noise=False)
    model = mixed_model(*problem_at_truth(exact), ROBOTS)
    prior = hyperpriors(model, dict.fromkeys(ROBOTS, 0.5))
    vague = replace(prior, sigma=30 * prior.sigma)
    least = sigma_posterior(model, vague).logs - vague.start
    views = len(model.sigmas.views)
    np.testing.assert_allclose(least[:views], -np.log(20.0), atol=1e-9)
    assert np.all(least[views:] < -np.log(20.0))
    assert np.all(least[views:] > -np.log(400.0) - 1e-9)


def test_sigmas_known_to_a_twentieth_count_as_known(small_posterior):
    """The covariance is then that at the mode plus the offset of its mean. Otherwise nodes about it are weighted."""
    k, width = len(small_posterior.logs), small_posterior.model.width
    mean, covariance = small_posterior.columns.mean[:width], small_posterior.columns.spread[:width, :width]
    about = 0.9 * mean
    off = np.outer(mean - about, mean - about)
    sure = replace(small_posterior, covariance=0.049**2 * np.eye(k))
    np.testing.assert_allclose(integrated_covariance([sure], np.ones(1), about), covariance + off, rtol=1e-12)
    less = replace(small_posterior, covariance=0.051**2 * np.eye(k))
    assert not np.allclose(integrated_covariance([less], np.ones(1), about), covariance + off, rtol=1e-6, atol=0)


def test_nearly_normal_sigmas_are_integrated_by_cubature(small_posterior):
    """Nodes are at sqrt(k) standard deviations to either side along k principal axes, weighted by likelihood."""
    rng, k, about = (
        np.random.default_rng(3),
        len(small_posterior.logs),
        posterior(small_posterior.model, small_posterior.logs).step,
    )
    root = 0.1 * np.eye(k) + 0.05 * np.tril(rng.standard_normal((k, k)))
    near = replace(small_posterior, covariance=root @ root.T)
    assert 0.05 < np.sqrt(np.diag(near.covariance)).max() < 0.5
    total, weights = 0.0, 0.0
    sigmas = np.sqrt(np.diag(near.covariance))
    values, vectors = np.linalg.eigh(near.covariance / np.outer(sigmas, sigmas))
    for axis in (sigmas[:, None] * vectors * np.sqrt(values)).T:
        for sign in (1, -1):
            logs = small_posterior.logs + sign * np.sqrt(k) * axis
            node = posterior(small_posterior.model, logs)
            height = node.value + small_posterior.prior.value(logs)[0] - small_posterior.minus_2_log_evidence
            off = node.step - about
            total = total + np.exp(-0.5 * height) * (node.covariance + np.outer(off, off))
            weights += np.exp(-0.5 * height)
    expected = total / weights
    np.testing.assert_allclose(
        integrated_covariance([near], np.ones(1), about), expected, rtol=1e-9, atol=1e-10 * expected.max()
    )


def test_models_are_weighted_by_evidence(small_posterior):
    """A model three times as likely as another has three quarters, and one of a millionth has no weight."""
    k, about = len(small_posterior.logs), np.zeros(small_posterior.model.width)
    sure = replace(small_posterior, covariance=1e-4 * np.eye(k), minus_2_log_evidence=7.0)
    other = replace(sure, logs=small_posterior.logs + 0.5)
    first, second = (integrated_covariance([of], np.ones(1), about) for of in (sure, other))
    third = replace(other, minus_2_log_evidence=7.0 + 2 * np.log(3.0))
    np.testing.assert_allclose(
        integrated_covariance([sure, third], np.ones(2), about), 0.75 * first + 0.25 * second, rtol=1e-9
    )
    for share, rest in ((1.1e-6, 1.0), (0.9e-6, 0.0)):
        hardly = replace(other, minus_2_log_evidence=7.0 - 2 * np.log(share))
        left = integrated_covariance([sure, hardly], np.ones(2), about) - first / (1 + share)
        np.testing.assert_allclose(left, rest * share * second, rtol=1e-4, atol=1e-7 * share * second.max())


@pytest.fixture
def synthetic_posterior(rng):
    """Eleven sigmas of a synthetic model, expected within a factor of e."""
    model, _ = made_up(rng)
    prior = LogNormals(np.eye(11), 0.1 * np.arange(11.0), np.ones(11))
    root = 0.02 * rng.standard_normal((11, 30))
    return SigmaPosterior(model, prior, 0.1 * rng.standard_normal(11), root @ root.T, 0.0)


def test_sigmas_are_searched_within_bounds(synthetic_posterior):
    """The bounds are 400 times the expected value, and a four-hundredth, or a twentieth for views, which come first."""
    least, most = laplace._bounds(synthetic_posterior.model, synthetic_posterior.prior)
    np.testing.assert_allclose(np.exp(most - synthetic_posterior.prior.start), 400.0)
    np.testing.assert_allclose(np.exp(synthetic_posterior.prior.start - least), [20.0] * 2 + [400.0] * 9)


def test_covariance_root_exists_for_singular_matrices(rng):
    """The outer products of its rows add up to the covariance, also if rounding removes the last axis."""
    rows = rng.standard_normal((3, 4))
    for covariance in (rows.T @ rows + np.eye(4), rows.T @ rows, np.diag([1.0, 4.0, 0.0, 9.0]), np.zeros((0, 0))):
        root = laplace._root(covariance)
        np.testing.assert_allclose(root.T @ root, covariance, atol=1e-9)
    assert laplace._root(np.diag([4.0, 9.0])).tolist() == [[2.0, 0.0], [0.0, 3.0]]


def test_cubature_nodes_have_the_mean_and_covariance(synthetic_posterior):
    """Two nodes of equal weight are along each axis of the root."""
    nodes, drawn = laplace._cubature(synthetic_posterior)
    assert (nodes.shape, drawn.tolist()) == ((22, 11), [0.0] * 22)
    np.testing.assert_allclose(nodes.mean(0), synthetic_posterior.logs, atol=1e-12)
    np.testing.assert_allclose(np.cov(nodes.T, bias=True), synthetic_posterior.covariance, rtol=1e-9, atol=1e-12)


def test_drawn_nodes_are_pairs_with_their_density(synthetic_posterior):
    """Nodes are drawn from Student's t with five freedoms and clipped to the bounds.

    The distribution is a fifth wider than the covariance.
    """
    nodes, drawn = laplace._draw_nodes(synthetic_posterior)
    assert (nodes.shape, drawn.shape) == ((128, 11), (128,))
    np.testing.assert_allclose(nodes[:64] + nodes[64:], np.tile(2 * synthetic_posterior.logs, (64, 1)), atol=1e-12)
    off = nodes - synthetic_posterior.logs
    squares = np.einsum("ni,ij,nj->n", off, np.linalg.inv(synthetic_posterior.covariance), off) / 1.2**2
    np.testing.assert_allclose(drawn, (5 + 11) * np.log(1 + squares / 5), rtol=1e-8)
    assert 0.4 * 11 < np.median(squares) < 2.5 * 11  # the median of that t is 12.6
    np.testing.assert_array_equal(laplace._draw_nodes(synthetic_posterior)[0], nodes)
    least, most = laplace._bounds(synthetic_posterior.model, synthetic_posterior.prior)
    wide = laplace._draw_nodes(replace(synthetic_posterior, covariance=1e4 * synthetic_posterior.covariance))[0]
    assert np.all((wide >= least) & (wide <= most))
    assert np.any(wide == most)


@pytest.mark.parametrize(
    ("sigma", "blocks", "nodes"), [(0.049, 2, 1), (0.051, 2, 22), (0.49, 2, 22), (0.51, 40, 128), (0.51, 41, 22)]
)
def test_integration_method_depends_on_the_largest_uncertainty(synthetic_posterior, sigma, blocks, nodes):
    """The mode, cubature, or, with few stops, drawn nodes are used, and each node is weighted by its height."""
    variances = np.full(11, 1e-4)
    variances[3] = sigma**2
    layout = replace(synthetic_posterior.model.layout, sizes=np.full(blocks, 7))
    of = replace(
        synthetic_posterior, covariance=np.diag(variances), model=replace(synthetic_posterior.model, layout=layout)
    )
    found, logs, _ = laplace._weighted_nodes(of, np.arange(3))
    assert 1 <= len(found) <= nodes
    assert (len(found) == 1) == (nodes == 1)
    assert found.sum() == pytest.approx(1.0)
    if nodes == 1:
        np.testing.assert_array_equal(logs, [of.logs])
        return
    where, drawn = laplace._draw_nodes(of) if nodes == 128 else laplace._cubature(of)
    of_node = {node.tobytes(): weight for node, weight in zip(logs, found, strict=True)}
    heights = [posterior(of.model, node).value + of.prior.value(node)[0] for node in where]
    expected = np.exp(-0.5 * (np.array(heights) - drawn - np.min(np.array(heights) - drawn)))
    weights = [of_node.get(node.tobytes(), 0.0) for node in where]
    np.testing.assert_allclose(weights, expected / expected.sum(), rtol=1e-6, atol=1e-12)


def test_bounded_step_is_newtons_inside_the_bounds():
    """An unknown at a bound that the step would cross is fixed.

    Uphill slopes count twice in the curvature, which is floored.
    """
    logs, least, most = np.array([0.0, 1.0, 0.0, 1.0, 0.5, 0.5]), np.zeros(6), np.ones(6)
    slope = np.array([0.3, -0.4, -5.0, 4.0, 0.7, -0.6])
    curvature = np.diag([2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    curvature[2, 4] = curvature[4, 2] = 0.5
    curvature[0, 2] = curvature[2, 0] = 0.4
    step = laplace._bounded_step(slope, curvature, logs, least, most, [])
    free = [2, 3, 4, 5]
    expected = np.zeros(6)
    full = curvature + 2 * np.diag([0.3, 0.0, 0.0, 4.0, 0.7, 0.0])
    expected[free] = -np.linalg.solve(full[np.ix_(free, free)], slope[free])
    np.testing.assert_allclose(step, expected, rtol=1e-9)
    flat = np.array([-1.0]), np.array([[0.01]])
    np.testing.assert_allclose(laplace._bounded_step(*flat, np.zeros(1), -np.ones(1), np.ones(1), []), [10.0])


def test_integrated_covariance_of_two_models(synthetic_posterior):
    """The covariance about a point is the weighted sum of both models, with the offset of each mean."""
    sure = replace(synthetic_posterior, covariance=1e-6 * np.eye(11), minus_2_log_evidence=1e5)
    other = replace(sure, logs=sure.logs + 0.3, minus_2_log_evidence=1e5 + 2 * np.log(3.0))
    about = np.array([0.1, -0.2, 0.3])
    expected = 0.0
    for share, of in ((0.75, sure), (0.25, other)):
        known = posterior(of.model, of.logs)
        expected = expected + share * (known.covariance + np.outer(known.step - about, known.step - about))
    np.testing.assert_allclose(integrated_covariance([sure, other], np.ones(2), about), expected, rtol=1e-9)
    columns = np.array([0, 3, 10])
    mean, covariance, squares = moments(sure, columns)
    known, units = posterior(sure.model, sure.logs), scales(sure.logs, sure.model.of_columns)[columns]
    np.testing.assert_allclose(mean, known.mean_columns[columns] * units)
    spread = known.spread[np.ix_(columns, columns)] * np.outer(units, units)
    np.testing.assert_allclose(covariance, spread, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(squares, np.exp(2 * sure.logs))


def test_mode_of_synthetic_numbers_is_stationary(synthetic_posterior):
    """The remaining slope is below the tolerance of the last step's gain.

    Curvature and evidence are those at the mode.
    """
    model, prior = synthetic_posterior.model, synthetic_posterior.prior
    surface = laplace._Surface(posterior(model, synthetic_posterior.logs), prior)
    known, (height, slope) = posterior(model, synthetic_posterior.logs), prior.value(synthetic_posterior.logs)
    assert surface.value == pytest.approx(known.value + height)
    np.testing.assert_allclose(surface.slope, known.slope() + slope)
    np.testing.assert_allclose(surface.curvature, known.average_information() + prior.curvature)
    found = sigma_posterior(model, prior)
    at_mode = laplace._Surface(posterior(model, found.logs), prior)
    gain = 0.5 * at_mode.slope @ np.linalg.solve(at_mode.curvature, at_mode.slope)
    assert 0.0 <= gain < 0.01
    assert at_mode.value < surface.value
    np.testing.assert_allclose(found.covariance, np.linalg.inv(0.5 * at_mode.curvature), rtol=1e-6, atol=1e-9)
    spread = np.linalg.slogdet(2 * np.pi * found.covariance)[1]
    assert found.minus_2_log_evidence == pytest.approx(at_mode.value - spread)
    again = sigma_posterior(model, prior, found.logs[:3])
    np.testing.assert_allclose(again.logs, found.logs, atol=0.1)


def _random_secants(curvature: np.ndarray, seed: int, count: int) -> list[Secant]:
    steps = np.random.default_rng(seed).standard_normal((count, len(curvature)))
    return [Secant(step, curvature @ step) for step in steps]


def test_secants_in_every_direction_determine_the_curvature() -> None:
    """For a quadratic, k steps in general position correct any curvature that is too small."""
    root = np.random.default_rng(1).standard_normal((4, 4))
    right = root @ root.T + np.eye(4)
    found = correct_curvature(0.05 * np.eye(4), _random_secants(right, 2, 4))
    np.testing.assert_allclose(found, right, rtol=1e-9, atol=1e-9)


def test_single_secant_is_satisfied() -> None:
    """The change of slope over the last step follows from the corrected curvature, larger or smaller than before."""
    for factor in (0.5, 2.0):
        right, guess = np.diag([1.0, 4.0, 9.0]), factor * np.diag([1.0, 4.0, 9.0])
        (secant,) = _random_secants(right, 3, 1)
        np.testing.assert_allclose(correct_curvature(guess, [secant]) @ secant.step, secant.change, rtol=1e-12)


def test_irregular_secants_are_left_out() -> None:
    """A slope that decreases along a step, and a change orthogonal to it, leave the curvature unchanged."""
    unit = np.eye(2)
    for change in (np.array([-1.0, 0.0]), np.array([1.0, 3.0])):
        np.testing.assert_array_equal(correct_curvature(unit, [Secant(np.array([1.0, 0.0]), change)]), unit)


@pytest.mark.parametrize(("cosine", "counts"), [(1.1e-8, True), (0.9e-8, False)])
def test_nearly_orthogonal_change_is_ignored(cosine: float, counts: bool) -> None:
    """The limit is independent of the lengths of step and change."""
    for length in (1e-3, 1.0, 1e3):
        for size in (1e-3, 5.0):
            off, step = size * np.array([cosine, 1.0]), np.array([length, 0.0])
            curvature = np.diag([0.0, 1e12])
            found = correct_curvature(curvature, [Secant(step, off)])
            assert np.array_equal(found, curvature) != counts


@pytest.mark.parametrize("left", [0.19, 0.21])
def test_correction_leaves_a_fifth_of_the_curvature(left: float) -> None:
    """A correction that would reduce the curvature further is not made, along each axis."""
    curvature = np.diag([4.0, 2.0])
    for axis in range(2):
        step = np.eye(2)[axis]
        found = correct_curvature(curvature, [Secant(step, left * curvature @ step)])
        lowered = curvature - (1 - left) * curvature * np.outer(step, step)
        np.testing.assert_allclose(found, lowered if left > 0.2 else curvature, rtol=1e-12)


def test_secants_are_applied_in_sequence() -> None:
    """The second uses the curvature that the first left, also if the first was left out."""
    curvature = np.eye(2)
    bad, good = Secant(np.array([1.0, 0.0]), np.array([-1.0, 0.0])), Secant(np.array([0.0, 2.0]), np.array([0.0, 6.0]))
    np.testing.assert_allclose(correct_curvature(curvature, [bad, good]), np.diag([1.0, 3.0]))
    again = Secant(np.array([0.0, 1.0]), np.array([0.0, 5.0]))
    np.testing.assert_allclose(correct_curvature(curvature, [good, again]), np.diag([1.0, 5.0]))
