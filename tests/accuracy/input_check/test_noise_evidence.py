"""Likelihoods of wider hypotheses where arms have noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2
from tests.shared.declared import declared
from tests.shared.rewriting import resized, with_pixels

from basecal.accuracy.input_check import noise_evidence as module
from basecal.accuracy.input_check.hypothesis_fit import fit_hypothesis
from basecal.accuracy.input_check.noise_evidence import _scatter_gain, noise_evidence
from basecal.accuracy.input_check.target_sizes import target_size
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from quick import quick

FEW = Scenario(samples=8, robot_noise=(1e-4, 2e-4), state_robot_noise=False, state_pixel_noise=False, pixel_px=0.02)
STATED = Settings(robot_noise="stated")


def with_lens(cell, shift_px=0.0, status="fixed"):
    """The cell with the principal point stated off by so much."""
    camera = cell.cameras["wrist"]
    parameters = camera.intrinsics.camera.parameters.copy()
    parameters[2] += shift_px
    lens = camera.intrinsics.camera.with_parameters(parameters)
    changed = replace(camera, intrinsics=replace(camera.intrinsics, camera=lens, status=status))
    return replace(cell, cameras={"wrist": changed})


def fitted(reading):
    return fit_hypothesis(reading.cell, reading.problem, STATED)


def of_size(made, factor):
    """Evidence for a board so many times as large as stated."""
    given = declared(made.cell, made.recording)
    return noise_evidence(fitted(target_size("board", factor, made.cell).reread(given)), fitted(given))


def of_lens(made, cell):
    """Evidence for a lens that is not as the cell states."""
    given = declared(cell, made.recording)
    return noise_evidence(fitted(given.restate(with_lens(cell, status="free"))), fitted(given))


@pytest.mark.parametrize("seed", quick(range(3), [0]))
def test_noise_of_arms_is_no_size(seed):
    """By 0.3 % a board may seem larger where arms are off by 0.1 mm: likelihoods do not ask for it; for 3 % they do."""
    made = simulate(FEW, seed)
    assert of_size(made, 1.003).chance > 1e-3
    true = resized(made.cell, {"board": 1.03})
    wrong = of_size(replace(made, cell=true), 1 / 1.03)
    assert wrong.chance < 1e-6
    assert wrong.gain > 30


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_pixels_of_any_size_scatter_alike(seed):
    """Pixels bent as no lens bends them say nothing for or against a size of 2 % where arms are off by millimetres."""
    made = simulate(replace(FEW, samples=12, robot_noise=(3e-3, 5e-3), intrinsics="free", pixel_px=0.1), seed)
    bent = with_pixels(made.recording, lambda uv: uv + 6.0 * np.sin(uv[:, ::-1] / (90.0, 70.0)))
    assert abs(of_size(replace(made, recording=bent), 1.02).gain) < 2.0


def test_points_in_space_show_their_size():
    """Distances between points that are measured in space tell a size of 5 % whatever arms do."""
    made = simulate(replace(FEW, target="points3d"), 0)
    wrong = resized(made.cell, {"board": 1.05})
    found = of_size(replace(made, cell=wrong), 1 / 1.05)
    assert found.gain > 100
    assert found.chance < 1e-12


@pytest.mark.parametrize("seed", quick(range(3), [1]))
def test_noise_of_arms_is_no_lens(seed):
    """A lens as stated has chance; one whose centre is stated 30 px off has none."""
    made = simulate(FEW, seed)
    assert of_lens(made, made.cell).chance > 1e-3
    assert of_lens(made, with_lens(made.cell, 30.0)).chance < 1e-6


@pytest.mark.parametrize("stated", [True, False])
def test_points_in_space_speak_for_the_size_about_which_they_scatter_less(stated):
    """The true size gains over one a hundredth off what that loses over it, and nothing over itself."""
    made = simulate(Scenario(samples=6, target="points3d", state_pixel_noise=stated), 0)
    if not stated:
        unstated = [replace(o, sigma_m=None) for s in made.recording.samples for o in s.observations]
        samples = [replace(s, observations=(o,)) for s, o in zip(made.recording.samples, unstated, strict=True)]
        made = replace(made, recording=replace(made.recording, samples=tuple(samples)))
    wrong = resized(made.cell, {"board": 1.01})
    right, off = (fitted(declared(cell, made.recording)).solution for cell in (made.cell, wrong))
    assert _scatter_gain(right, right) == 0.0
    assert _scatter_gain(right, off) > 10
    assert _scatter_gain(off, right) == pytest.approx(-_scatter_gain(right, off))


def known(monkeypatch, narrower, wider):
    """Evidence of a fit beside the declared one, whose solutions with noise are these."""
    fits = [
        SimpleNamespace(solution=SimpleNamespace(problem=of, state=None, views=of.views)) for of in (wider, narrower)
    ]
    told = {}

    def solve(problem, state, settings, guess=None):
        """As it is told."""
        told[problem.name] = guess
        return problem

    monkeypatch.setattr(module, "solve_at_mode", solve)
    monkeypatch.setattr(module, "_views", lambda solution: solution.views)
    found = noise_evidence(*fits)
    if found is not None:
        assert told == {"narrower": None, "wider": narrower.noise}
    return found


def solution_of(name, minus_2_log_evidence=0.0, columns=(), views=5):
    return SimpleNamespace(
        name=name,
        views=views,
        noise=SimpleNamespace(minus_2_log_evidence=minus_2_log_evidence),
        problem=SimpleNamespace(columns=dict.fromkeys(columns)),
        state=SimpleNamespace(cameras={k: SimpleNamespace(parameters=k) for k in ("a", "b", "c")}),
    )


@pytest.mark.parametrize(("minus_2_log_evidence", "scatter"), [(7.0, 2.0), (3.0, -1.0), (12.0, 1.0)])
def test_a_gain_is_of_both_likelihoods(monkeypatch, minus_2_log_evidence, scatter):
    """What the declared noise is surprised by more, and by how much less points scatter; one freedom gives a chance."""
    monkeypatch.setattr(module, "_scatter_gain", lambda wider, narrower: scatter)
    found = known(monkeypatch, solution_of("narrower", 10.0, ["a"]), solution_of("wider", minus_2_log_evidence, ["a"]))
    gain = 10.0 - minus_2_log_evidence + scatter
    assert found.gain == pytest.approx(gain)
    assert found.chance == pytest.approx(chi2.sf(max(gain, 0.0), 1))


def test_of_what_is_freed_it_is_how_far_it_is_from_what_was_stated(monkeypatch):
    """Of all that only the hypothesis estimates, squares and freedoms together."""
    squares = {"b": (5.0, 4), "c": (7.0, 9)}
    monkeypatch.setattr(module, "_distance", lambda solution, stated, name: squares[name])
    found = known(monkeypatch, solution_of("narrower", 10.0, ["a"]), solution_of("wider", 3.0, ["a", "b", "c"]))
    assert found.gain == 12.0
    assert found.chance == pytest.approx(chi2.sf(12.0, 13))


def test_other_views_have_other_likelihoods(monkeypatch):
    """Nothing is compared."""
    assert known(monkeypatch, solution_of("narrower"), solution_of("wider", views=4)) is None


def test_scatter_counts_by_its_squares_or_their_logarithm(monkeypatch):
    """Where sigmas are stated by the squares, else by how many times less, for each freedom; of none not at all."""
    of = {
        "wider": {
            "stated": (10.0, 30.0),
            "point_m": (4.0, 20.0),
            "nothing": (0.0, 9.0),
            "exact": (3.0, 9.0),
            "m": (0.2, 3.0),
        },
        "narrower": {
            "stated": (14.5, 30.0),
            "point_m": (8.0, 20.0),
            "nothing": (2.0, 9.0),
            "exact": (0.0, 9.0),
            "m": (0.4, 3.0),
        },
    }
    monkeypatch.setattr(module, "_scatter", of.get)
    assert _scatter_gain("wider", "narrower") == pytest.approx(4.5 + 23 * np.log(2.0))


def test_scatter_is_that_of_all_points_in_space(monkeypatch):
    """Of every group of them, by what their sigmas are; pixels have none."""
    groups = [
        build_problem(made.cell, made.recording)[0].groups[0]
        for made in (simulate(Scenario(samples=2, target=target), 0) for target in ("points3d", "charuco", "points3d"))
    ]
    estimates = [{"stated": (1.0, 2)}, {"stated": (100.0, 200)}, {"stated": (4.0, 8), "point_m": (16.0, 32)}]

    def view_estimates(problem, group, state):
        """Squares and freedoms of each."""
        of = estimates[[id(g) for g in groups].index(id(group))]
        return {name: SimpleNamespace(white=white, white_count=count) for name, (white, count) in of.items()}

    monkeypatch.setattr(module, "view_estimates", view_estimates)
    solution = SimpleNamespace(problem=SimpleNamespace(groups=groups), state=None)
    assert module._scatter(solution) == {"stated": (5.0, 10), "point_m": (16.0, 32)}


def test_a_lens_is_off_in_sigmas_of_all_of_its_terms():
    """Terms that were not stated are off from zero."""
    step, sigma = np.array([3.0, -1.0, 0.5, 0.25, 0.02]), np.array([1.0, 2.0, 0.5, 0.1, 0.01])
    stated = np.array([500.0, 510.0, 320.0, 240.0])
    found = SimpleNamespace(parameters=np.append(stated, 0.0) + step)
    solution = SimpleNamespace(
        problem=SimpleNamespace(columns={"wrist": slice(1, 6)}),
        state=SimpleNamespace(cameras={"wrist": found}),
        covariance=np.diag(np.append(7.0, sigma**2)),
    )
    before = SimpleNamespace(cameras={"wrist": SimpleNamespace(parameters=stated)})
    squared, count = module._distance(solution, before, "wrist")
    assert squared == pytest.approx(np.sum((step / sigma) ** 2))
    assert count == 5


@pytest.mark.parametrize("size", [6, 3])
def test_a_transform_is_off_by_its_tangent_in_sigmas(size):
    """Of a point's mount the translation alone."""
    step, sigma = np.array([3e-3, -1e-3, 5e-4, 0.01, 0.0, -0.02]), np.array([1e-3, 2e-3, 5e-4, 0.01, 0.02, 0.01])
    before = SE3.exp(np.array([0.3, 0.1, -0.2, 0.4, -0.1, 0.2]))
    solution = SimpleNamespace(
        problem=SimpleNamespace(columns={"a_from_b": slice(0, size)}),
        state=SimpleNamespace(cameras={}, transforms={"a_from_b": before @ SE3.exp(step)}),
        covariance=np.diag(sigma[:size] ** 2),
    )
    squared, count = module._distance(
        solution, SimpleNamespace(cameras={}, transforms={"a_from_b": before}), "a_from_b"
    )
    assert squared == pytest.approx(np.sum((step[:size] / sigma[:size]) ** 2), rel=1e-6)
    assert count == size
