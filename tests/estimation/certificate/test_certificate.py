"""Tests of the certificate: bounds of the cost, proven cells, and cells without a claim."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.deceivers import adversarial, trial

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.stages.judging import prove_solution
from basecal.cell import Recording, RobotState, Unknown
from basecal.cell.targets.points import points_target
from basecal.estimation.certificate import certificate as module
from basecal.estimation.certificate.certificate import _perturbed_states, certify, proven_loops
from basecal.estimation.certificate.relaxation import kronecker_product
from basecal.estimation.certificate.rotation_cost import loop_form, rotation_factors, state_rotations
from basecal.estimation.certificate.view_rotation import view_costs
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve, solve_from
from basecal.estimation.start.closed_form import Rotations
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_exp, rotation_log
from basecal.simulation import Scenario, simulate
from quick import quick

NOISY = {"pose_noise": (2e-3, 0.1), "robot_noise": (2e-3, 0.1), "spread_rad": 1.2, "target": "pose"}
PROVEN = {
    "hand-eye": Scenario(layout="eye_in_hand", **NOISY),
    "eye-to-hand": Scenario(layout="eye_to_hand", **NOISY),
    "two arms": Scenario(**NOISY),
    "camera mount known": Scenario(camera_mount="fixed", **NOISY),
    "both mounts known": Scenario(camera_mount="fixed", target_mount="fixed", **NOISY),
    "nothing free": Scenario(base="fixed", camera_mount="fixed", target_mount="fixed", target="pose"),
    "3-D points": Scenario(target="points3d"),
    "board": Scenario(robot_noise=(3e-4, 5e-4)),
    "four corners": Scenario(
        target="points", board=points_target(np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]]))
    ),
    "points at stations": Scenario(target="points", arms="stations", robot_noise=(3e-4, 5e-4)),
    "two cameras, a robot each": Scenario(layout="two_cameras", target="pose"),
    "two cameras on the world": Scenario(layout="two_world_cameras", target="pose"),
    "ring of three robots": Scenario(layout="chain", target="pose", samples=60),
    "noise as small as numbers": Scenario(target="pose", samples=15, pose_noise=(1e-11, 1e-11)),
}
NOT_TOLD = {
    "a light": (Scenario(target="led"), "no pose from a single view"),
    "a lens that is free": (Scenario(intrinsics="free"), "the lens of wrist"),
    "a board that reads from both ends": (Scenario(target="chessboard"), "read in several ways"),
}


def solve_scenario(scenario: Scenario, seed: int = 1) -> Solution:
    made = simulate(scenario, seed)
    return solve(made.cell, made.recording)


def perturb_state(solution: Solution, rng: np.random.Generator, size: float) -> State:
    """A state perturbed by `size` from the solution, with random stop errors."""
    state = solution.state
    moved = {
        name: state.transforms[name] @ SE3.exp(size * rng.standard_normal(6))
        for name in solution.problem.columns
        if name in state.transforms
    }
    errors = state.stop_errors + min(size, 3.0) * rng.standard_normal(state.stop_errors.shape)
    return replace(state, transforms={**state.transforms, **moved}, stop_errors=errors)


@pytest.mark.journey
@pytest.mark.parametrize("name", quick(PROVEN, list(PROVEN)[:6]))
def test_well_posed_cells_are_proven(name):
    """Every kind of loop is proven global without a gap.

    Noise is up to 0.1 rad on arms and views, and arms rotate by 1.2 rad.
    """
    certificate, better = certify(solve_scenario(PROVEN[name]))
    assert certificate.is_global is True
    assert certificate.reason == ""
    assert certificate.gap is not None
    assert certificate.gap < 1e-3
    assert better is None


@pytest.mark.parametrize("name", NOT_TOLD)
def test_cells_without_view_poses_are_not_certified(name):
    """The result is null with the reason, and has no bound."""
    scenario, reason = NOT_TOLD[name]
    certificate = certify(solve_scenario(scenario)).certificate
    assert certificate.gap is None
    assert certificate.is_global is None
    assert reason in certificate.reason


def test_form_is_the_sum_over_loops():
    """At any rotations the form is the weighted mean of sin^2 of half the loops' angles, to 1e-12."""
    solution = solve_scenario(Scenario(target="pose", samples=7))
    problem, (group,) = solution.problem, solution.problem.groups
    made = loop_form(problem, solution.state, group, view_costs(problem, solution.state, group))
    rng = np.random.default_rng(0)
    for _ in range(20):
        x, y, z = rotation_exp(rng.standard_normal((3, 3)) * 2)
        loop = made.loop
        turned = np.swapaxes(loop.a.rotation @ x @ loop.b.rotation, -1, -2) @ y @ loop.c.rotation @ z
        angles = np.linalg.norm(rotation_log(turned), axis=-1)
        v = kronecker_product(rotation_factors(loop, Rotations(x, y, z)))
        assert v @ made.form @ v == pytest.approx(np.average(np.sin(angles / 2) ** 2, weights=loop.weight), abs=1e-12)


SOUND = {
    "poses": (Scenario(target="pose"), (1e-3, 0.03, 0.3, 3.0)),
    "poses of noisy arms": (Scenario(target="pose", robot_noise=(1e-3, 3e-3)), (1e-3, 0.03, 0.3, 3.0)),
    "stops of several views": (
        Scenario(target="pose", arms="stations", robot_noise=(1e-3, 3e-3)),
        (1e-3, 0.03, 0.3, 3.0),
    ),
    "3-D points": (Scenario(target="points3d", robot_noise=(1e-3, 1e-3)), (1e-3, 0.03, 0.3, 3.0)),
    "mounts fixed": (Scenario(target="pose", camera_mount="fixed"), (1e-3, 0.03, 0.3, 3.0)),
    "three robots": (Scenario(target="pose", layout="chain", samples=30), (1e-3, 0.03, 0.3, 3.0)),
    "pixels, within five degrees": (Scenario(robot_noise=(3e-4, 5e-4)), (1e-4, 1e-3, 1e-2, 0.05)),
}


@pytest.mark.parametrize("name", SOUND)
def test_no_state_costs_less_than_its_bound(name):
    """The cost of any state is at least the views' constants plus the loops' forms at its rotations."""
    scenario, sizes = SOUND[name]
    solution = solve_scenario(scenario)
    problem = solution.problem
    views = [view_costs(problem, solution.state, group) for group in problem.groups]
    forms = [loop_form(problem, solution.state, g, v) for g, v in zip(problem.groups, views, strict=True)]
    rng = np.random.default_rng(3)
    for size in sizes:
        for _ in range(12):
            state = perturb_state(solution, rng, size)
            least = sum(v.constant.sum() for v in views)
            for group, made in zip(problem.groups, forms, strict=True):
                v = kronecker_product(rotation_factors(made.loop, state_rotations(state, group, made.merged)))
                least += made.weight * (v @ made.form @ v)
            assert linearise(problem, state).cost >= least * (1 - 1e-9)


def test_bound_nearly_equals_the_cost_of_rotations():
    """With nearly unweighted translations and equal sigmas, the bound leaves less than 2 % of the cost."""
    solution = solve_scenario(Scenario(target="pose", pose_noise=(10.0, 3e-3), samples=40))
    rotation_only = replace(
        solution.problem.groups[0].measurement,
        weight=solution.problem.groups[0].measurement.weight * np.array([1e-9] * 3 + [1.0] * 3),
    )
    problem = solution.problem.with_groups([replace(solution.problem.groups[0], measurement=rotation_only)])
    only = solve_from(problem, solution.state)
    loops, constant = proven_loops(replace(only, problem=problem))
    lower = constant + sum(loop.form.weight * loop.bound.lower for loop in loops)
    assert 0.98 * only.cost < lower <= only.cost * (1 + 1e-9)


@pytest.mark.journey
@pytest.mark.parametrize("seed", range(6))
def test_rotations_about_one_axis_are_never_proven(seed):
    """Arms that rotate about one axis leave a continuum of solutions, and no claim is made."""
    problem, start, _, _ = adversarial("one axis", seed)
    assert certify(solve_from(problem, start)).certificate.is_global is None


@pytest.mark.journey
def test_ambiguous_views_do_not_count():
    """At 0.2 px every view of a far board counts. At 8 px some do not, and no claim is made."""
    clear, blurred = (
        solve_scenario(Scenario(pixel_px=px, samples=12, spread_rad=0.3, distance_m=(0.85, 0.9))) for px in (0.2, 8.0)
    )
    counted = []
    for solution in (clear, blurred):
        views = view_costs(solution.problem, solution.state, solution.problem.groups[0])
        kept = views.without_doubtful(solution.cost - float(views.constant.sum()))
        counted.append(np.count_nonzero(kept.weight))
    assert counted[0] == 12
    assert counted[1] < 12
    assert certify(clear).certificate.is_global is True
    assert certify(blurred).certificate.is_global is None


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bad start", "outliers", "far out of scale"])
def test_no_claim_is_undercut_by_random_starts(kind):
    """No deceptive cell is claimed global if a thousand random starts find a better optimum."""
    assert not any(trial(kind, seed).false for seed in range(100, 101))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bad start", "narrow", "outliers", "few", "loud", "far out of scale"])
def test_no_claim_of_forty_cells_is_undercut(kind):
    """No claim is undercut by random starts, for forty cells of each kind."""
    assert not any(trial(kind, seed).false for seed in range(200, 240))


def cell_with_wrong_guesses(seed: int):
    """A cell whose guesses are far off, and its recording."""
    made = simulate(Scenario(target="pose", spread_rad=1.0, samples=12), seed)
    rng = np.random.default_rng(seed)

    def wrong(name: str) -> Unknown:
        return Unknown("free", made.truth[name] @ SE3.exp(np.concatenate([np.zeros(3), 2 * rng.standard_normal(3)])))

    cell = replace(
        made.cell,
        bases={"hand": wrong("eye_base_from_hand_base")},
        cameras={"wrist": replace(made.cell.cameras["wrist"], mount=wrong("eye_flange_from_wrist"))},
        targets={"board": replace(made.cell.targets["board"], mount=wrong("hand_flange_from_board"))},
    )
    return cell, made.recording


@pytest.mark.slow
def test_better_optimum_replaces_the_solution():
    """From misleading guesses the result returns to the proven optimum, with a finding."""
    astray = 0
    for seed in range(12):
        cell, recording = cell_with_wrong_guesses(seed)
        guessed = solve(cell, recording, Settings(start="guess", robot_noise="stated"))
        best = solve(cell, recording)
        calibration = calibrate(cell, recording, Settings(start="guess", certify=True))
        unguessed = calibrate(cell, recording)
        certificate = calibration.certificate
        assert certificate is not None
        assert certificate.is_global is True
        name = "eye_base_from_hand_base"
        np.testing.assert_allclose(calibration[name].mean.matrix, unguessed[name].mean.matrix, atol=1e-6)
        if guessed.cost > best.cost * (1 + 1e-6):
            astray += 1
            assert "better-optimum" in {f.code for f in calibration.findings}
    assert astray >= 1


def test_certificate_is_made_on_request_or_if_disputed():
    """A certificate is not made by default. It is made without a request if starts ended in different optima."""
    solution = solve_scenario(Scenario(target="pose"))
    assert prove_solution(solution, Settings())[1] is None
    for certificate in (
        prove_solution(solution, Settings(certify=True))[1],
        prove_solution(replace(solution, disputed=True), Settings())[1],
    ):
        assert certificate is not None
        assert certificate.is_global is True


@pytest.mark.journey
def test_differing_starts_trigger_a_certificate(monkeypatch):
    """If no start looks plausible and guesses end elsewhere, a certificate is made without a request.

    If all agree, it is not.
    """
    monkeypatch.setattr("basecal.estimation.solve.PLAUSIBLE_SIGMAS", 0.0)

    def leads_elsewhere(seed):
        """Whether a descent from the guesses of a cell ends above its best start."""
        cell, recording = cell_with_wrong_guesses(seed)
        best = solve(cell, recording).cost
        return solve(cell, recording, Settings(start="guess", robot_noise="stated")).cost > best * (1 + 1e-5)

    cell, recording = cell_with_wrong_guesses(next(filter(leads_elsewhere, range(12))))
    assert solve(cell, recording).disputed
    certificate = calibrate(cell, recording).certificate
    assert certificate is not None
    assert certificate.is_global is True
    made = simulate(Scenario(target="pose"), 0)
    assert not solve(made.cell, made.recording).disputed


@pytest.mark.parametrize("target", ["charuco", "led"])
def test_perturbed_starts_have_the_requested_rotation(target):
    """All rotations together change by 0.5 rad. An LED, which has no rotation, and fixed transforms are unchanged."""
    solution = solve_scenario(Scenario(target=target, samples=8))
    moves = [name for name in solution.problem.columns if name not in solution.problem.point_mounts]
    for state in _perturbed_states(solution, 0.5):
        off = {n: (t.inverse() @ state.transforms[n]).log() for n, t in solution.state.transforms.items()}
        assert np.linalg.norm([off[n][3:] for n in moves]) == pytest.approx(0.5)
        assert not any(off[n].any() for n in off if n not in moves)


@pytest.mark.parametrize("reference", ["eye", "hand"])
def test_proven_rotations_lead_back_from_a_worse_state(reference, monkeypatch):
    """A few steps reach the best fit, whichever arm's base is the world. No claim is made about the worse state."""
    monkeypatch.setattr("basecal.estimation.certificate.certificate._DESCENT_STEPS", 2)
    made = simulate(Scenario(target="pose", samples=12, pose_noise=(1e-3, 1e-2)), 1)
    # Arms that face each other have a base that is nearly its own inverse; this one is oblique.
    askew = SE3.exp([0.3, 0.2, -0.1, 0.5, -0.4, 0.8])
    samples = [
        replace(s, robots={**s.robots, "hand": RobotState(askew @ s.robots["hand"].base_from_flange)})
        for s in made.recording.samples
    ]
    other = "hand" if reference == "eye" else "eye"
    best = solve(replace(made.cell, reference=reference, bases={other: Unknown()}), Recording(tuple(samples)))
    astray = replace(best, state=perturb_state(best, np.random.default_rng(0), 0.8), cost=1e3 * best.cost)
    certificate, better = certify(astray)
    assert certificate.is_global is None
    assert certificate.reason == "the proven rotations lead to a better fit"
    assert better is not None
    for name, transform in best.state.transforms.items():
        np.testing.assert_allclose(better.transforms[name].matrix, transform.matrix, atol=1e-4)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda of: replace(of, converged=False), "the solution is not an optimum"),
        (lambda of: replace(of, problem=of.problem.with_groups(())), "nothing was seen"),
        (
            lambda of: replace(of, problem=replace(of.problem, columns={**of.problem.columns, "eye": slice(18, 19)})),
            "more than transforms is estimated",
        ),
        (
            lambda of: replace(of, problem=of.problem.with_groups(g.take(np.arange(2)) for g in of.problem.groups)),
            "no pose from a single view: fewer than 3 views of board by wrist have an unambiguous pose",
        ),
    ],
)
def test_reasons_for_no_certificate(change, reason):
    """Each reason is tested separately. A gap is present if it was found on the way."""
    solution = solve_scenario(Scenario(target="pose", samples=8))
    certificate, better = certify(change(solution))
    assert (certificate.is_global, certificate.reason, better) == (None, reason, None)
    assert (certificate.gap is None) == (reason != "the solution is not an optimum")


@pytest.mark.parametrize(("corners", "has_pose"), [(3, False), (4, True)])
def test_views_of_four_points_have_a_pose(corners, has_pose):
    """Views of three points have none, and the certificate reports it."""
    square = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]])[:corners]
    certificate = certify(
        solve_scenario(Scenario(target="points", samples=10, board=points_target(square)))
    ).certificate
    reason = "no pose from a single view: fewer than four points are seen"
    assert (certificate.reason == reason) != has_pose
    assert (certificate.gap is None) != has_pose


@pytest.mark.parametrize(("cost", "off", "is_global", "is_better"), [
    (1.0, 0.1, True, False), (2.0, 0.0, True, False), (2.0, 0.9e-6, True, False), (2.0, 1.1e-6, None, False),
    (0.5, 1e-3, None, True),
])  # fmt: skip
def test_other_optima_differ_in_cost_and_transforms(monkeypatch, cost, off, is_global, is_better):
    """If descents end at another cost, the transforms decide if it is another optimum. A better one is returned."""
    solution = solve_scenario(Scenario(target="pose", samples=5, layout="eye_in_hand"))
    state = solution.state
    other = replace(state, transforms={n: t @ SE3.exp([off, 0, 0, 0, 0, 0]) for n, t in state.transforms.items()})
    ends = iter([SimpleNamespace(cost=1.0, state=state), SimpleNamespace(cost=cost, state=other)])
    monkeypatch.setattr(module, "bundle_adjust", lambda *_: next(ends))
    monkeypatch.setattr(module, "_perturbed_states", lambda solution, angle: [state])
    monkeypatch.setattr(module, "_better_state", lambda solution, found: found)
    certificate, better = module._explore_surroundings(solution, 0.01, 1e-9)
    assert (certificate.is_global, certificate.gap) == (is_global, 1e-9)
    assert (better is other) == is_better
    if is_global is None:
        assert certificate.reason == "within the 11 deg in which a better fit could be there are several optima"


def test_search_radius_follows_from_the_bound(monkeypatch):
    """A better fit is near if the bound is tight.

    The radius is the excess of the cost over the bound, divided by the growth of the cost of other rotations.
    """
    asked = []
    monkeypatch.setattr(module, "_explore_surroundings", lambda *given: asked.append(given))
    solution = solve_scenario(Scenario(target="pose", samples=8, layout="eye_in_hand"))
    certify(solution)
    ((_, share, _),) = asked
    (loop,), constant = proven_loops(solution)
    excess = solution.cost - constant - loop.form.weight * loop.bound.lower
    assert 0 <= excess < solution.cost
    assert share == pytest.approx(excess / (loop.form.weight * loop.bound.growth), rel=1e-9)
