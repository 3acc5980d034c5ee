"""Mix-ups are named, symmetries are told, and clean cells left alone; `benchmarks.mutations` is the whole matrix."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.mutate import lines_of, mutations, recording_of
from tests.shared.real_recordings import example, nao_cell

from basecal.accuracy.input_check import conventions
from basecal.accuracy.input_check.hypotheses import ConventionHypothesis, resized
from basecal.accuracy.input_check.hypothesis_choice import TriedHypothesis
from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit
from basecal.accuracy.input_check.loop_fit import LoopFit
from basecal.accuracy.input_check.rewriting import exchanged, inverted, with_robots, with_targets
from basecal.accuracy.verdict import calibrate
from basecal.errors import DatasetError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_packed
from basecal.geometry import SE3, Camera
from basecal.simulation import Scenario, simulate

STATED = Settings(robot_noise="stated")
BOARD = simulate(Scenario(samples=20), 7)
POSES = simulate(Scenario(samples=20, target="pose"), 7)
LIGHT = simulate(Scenario(samples=24, target="led", camera_mount="fixed", target_mount="fixed"), 7)


def mixed_up(made, name):
    """What `calibrate` finds after the mix-up of that name."""
    each = next(m for m in mutations(made.cell, lines_of(made.recording), 0) if m.name.startswith(name))
    return calibrate(each.cell, recording_of(each.lines(lines_of(made.recording)), each.cell))


def named(calibration):
    return {(f.code, f.about) for f in calibration.findings if f.severity == "error"}


@pytest.mark.parametrize(
    ("made", "name", "code", "about"),
    [
        (BOARD, "eye inverted", "robot-pose-inverted", ("eye",)),
        (BOARD, "robots in mm", "length-unit", ("eye", "hand")),
        (BOARD, "everything in mm", "length-unit", ("eye", "hand")),
        pytest.param(BOARD, "target times", "board-size", ("board",), marks=pytest.mark.slow),  # as in mistakes
        pytest.param(BOARD, "focal length", "intrinsics", ("wrist",), marks=pytest.mark.slow),
        (POSES, "target mirrored", "mirrored", ()),
        (LIGHT, "eye in mm", "length-unit", ("eye",)),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (
                (BOARD, "eye and hand inverted", "robot-pose-inverted", ("eye", "hand")),
                (BOARD, "eye and hand swapped", "robots-swapped", ("eye", "hand")),
                (BOARD, "hand w x y z", "quaternion-order", ("hand",)),
                (BOARD, "seen one late", "pairing-shifted", ()),
                (BOARD, "a detection missed", "pairing-shifted", ()),
                (POSES, "target in", "target-pose-inverted", ()),
                (POSES, "targets in mm", "length-unit", ()),
                (LIGHT, "hand inverted", "robot-pose-inverted", ("hand",)),
            )
        ),
    ],
)
def test_a_mix_up_is_named(made, name, code, about):
    """The finding holds the code and the names, and nothing is given for good."""
    calibration = mixed_up(made, name)
    assert (code, about) in named(calibration)
    assert calibration.verdict == "refused"


def none_survives(*given):
    """As `_surviving`: it asks for no fit and has no hypothesis."""
    yield from ()
    return []


@pytest.mark.parametrize("look", ["quick", pytest.param("none", marks=pytest.mark.slow)])
def test_exchanged_joints_are_named(look, monkeypatch):
    """Two arms of one model: also where a mount is known by a prior, and no loop closes without it."""
    if look == "none":
        monkeypatch.setattr(conventions, "_surviving", none_survives)
    made = simulate(Scenario(samples=12, joints=True, target_mount="prior"), 3)
    found = calibrate(made.cell, exchanged(made.recording, "eye", "hand"))
    assert named(found) == {("robots-swapped", ("eye", "hand"))}
    assert "the joints of eye and hand are exchanged" in found.findings[0].message


@pytest.mark.parametrize("made", [BOARD, POSES, LIGHT])
def test_clean_cells_are_left_alone(made):
    """Two arms that turn freely: no other reading comes near, and the verdict is good."""
    assert calibrate(made.cell, made.recording).verdict == "good"


@pytest.mark.parametrize("factor", [1.0, 1.2])
def test_links_explain_no_mix_up(factor):
    """Arms by joints, whose links are estimated: no mix-up is suspected, and a size that is wrong is found."""
    scenario = Scenario(samples=16, joints=True, link_error=(5e-4, 1e-3), link_parameters="prior")
    made = simulate(scenario, 7)
    cell = resized(made.cell, {"board": factor})
    problem, _ = build_problem(cell, made.recording)
    plain = solve_packed(problem, cell, STATED)
    found = conventions.check_conventions(cell, made.recording, problem, plain, STATED)
    assert [f.code for f in found] == (["board-size"] if factor > 1 else [])


@pytest.mark.slow
def test_exchanged_robots_and_an_inverted_target_are_one():
    """A target whose z points to the camera stays before it when inverted: both mix-ups fit alike and both are named.

    Turns are measured so well that noise does not tell the two ends of a pose apart.
    """
    made = simulate(Scenario(samples=20, target="pose", pose_noise=(1e-3, 1e-5)), 7)
    half = SE3.from_rotvec([np.pi, 0, 0], [0, 0, 0])
    towards_the_camera = with_targets(made.recording, lambda poses: poses @ half)
    found = named(calibrate(made.cell, with_targets(towards_the_camera, inverted)))
    assert {code for code, _ in found} - {"unobservable-direction"} == {"target-pose-inverted", "robots-swapped"}


def test_a_still_arm_by_poses_is_ambiguous():
    """Its one pose may be inverted, which no data could tell: listed, with how to tell, and no doubt."""
    made = simulate(Scenario(samples=15, arms="eye_still", camera_mount="fixed"), 0)
    calibration = calibrate(made.cell, made.recording)
    (finding,) = [f for f in calibration.findings if f.code == "ambiguous-convention"]
    assert (calibration.verdict, finding.severity) == ("good", "info")
    assert "robot-pose-inverted" in finding.message
    assert "turn eye" in finding.message


@pytest.mark.slow
def test_nao_and_its_twin_are_ambiguous():
    """The head's poses inverted fit as well and put the base 0.58 m away: said of the recording and of its twin."""
    try:
        cell, recording = nao_cell()
    except DatasetError as error:
        pytest.skip(str(error))
    for told in (recording, with_robots(recording, {"eye": inverted})):
        calibration = calibrate(cell, told)
        (finding,) = [f for f in calibration.findings if f.code == "ambiguous-convention"]
        assert calibration.verdict == "doubtful"
        assert "the poses of eye are inverted" in finding.message


def test_rct_with_a_wrong_fixed_lens_names_it():
    """The guess that ships with the recording, 1400 px and no distortion, stated as fixed: `intrinsics`."""
    cell, recording = example("rct_charuco")
    camera = cell.cameras["camera"]
    lens = Camera("pinhole", np.array([1400.0, 1400.0, 800.0, 600.0, 0, 0, 0, 0, 0]), camera.size_px)
    fixed = replace(camera, intrinsics=replace(camera.intrinsics, status="fixed", camera=lens))
    found = calibrate(replace(cell, cameras={"camera": fixed}), recording)
    assert "intrinsics" in {f.code for f in found.findings}
    assert found.verdict != "good"
    right = calibrate(cell, recording)
    assert "intrinsics" not in {f.code for f in right.findings}
    assert right.verdict != "refused"


def test_a_reading_that_leaves_the_answer_is_not_mentioned():
    """A camera alone moves and the board lies on the world: a chessboard's half turn moves nothing but its mount."""
    made = simulate(Scenario(samples=15, layout="eye_in_hand", target="chessboard"), 0)
    assert calibrate(made.cell, made.recording).verdict == "good"


def test_a_size_off_by_a_thousandth_is_no_mix_up():
    """What hardly improves the fit is not named, though it moves the answer."""
    made = simulate(Scenario(samples=20, robot_noise=(3e-4, 5e-4)), 1)
    found = calibrate(resized(made.cell, {"board": 1.001}), made.recording)
    assert "board-size" not in {f.code for f in found.findings}


@pytest.mark.slow
def test_poses_that_fit_nothing_are_not_good():
    """Observed poses disturbed by half a metre and radian fit no reading: none is named, and it is not good."""
    rng = np.random.default_rng(0)
    made = simulate(Scenario(samples=20, target="pose", state_observation_noise=False), 0)
    wild = with_targets(made.recording, lambda poses: poses @ SE3.exp(0.5 * rng.normal(size=(len(poses), 6))))
    found = calibrate(made.cell, wild)
    assert found.verdict != "good"
    assert {f.code for f in found.findings} <= {"poor-fit", "unobservable-direction", "not-converged"}


@pytest.mark.parametrize(("samples", "can"), [(5, False), (6, True)])
def test_two_of_three_folds_leave_more_equations_than_unknowns(samples, can):
    """Of measured poses, six equations each for 18 unknowns: by a quarter more from six of them."""
    made = simulate(Scenario(samples=samples, target="pose"), 0)
    assert conventions._can_hold_out(build_problem(made.cell, made.recording)[0]) == can


def hypothesis(words, code="length-unit", about=("eye",), nested=False):
    """One that changes nothing."""
    return ConventionHypothesis(code, about, words, "", "", lambda cell, recording: (cell, recording), nested)


def surviving(monkeypatch, offs, among=None, of_light=False, made=BOARD):
    """Words of those that survive a quick look by which views of each are so far off, the declared one first."""
    fits = [{("wrist", "board"): LoopFit((), np.full(4, off), of_light)} if off is not None else {} for off in offs]
    inputs_seen = []

    def screened(inputs, lenses):
        """As `_screened`, with fits that are known."""
        inputs_seen.extend(inputs)
        yield from ()
        return fits

    monkeypatch.setattr(conventions, "_screened", screened)
    among = among or [hypothesis(str(k)) for k in range(1, len(offs))]
    (found,) = conventions._in_step([conventions._surviving(made.cell, made.recording, {}, among)])
    return [each.words for each, _ in found], len(inputs_seen)


@pytest.mark.parametrize(
    ("offs", "of_light", "words"),
    [
        ((0.02, 0.071, 0.069, 0.01), False, ["3"]),  # three times the best and 0.01 rad are 0.04
        ((0.1, 0.3, 0.29, 0.32, 0.2), False, ["4", "2", "1"]),
        ((0.26, 0.24), False, ["1"]),
        ((0.26, 0.26), False, []),
        ((0.02, None), False, []),
        ((0.01, 0.031, 0.033), True, ["1"]),  # of a light the floor is 0.002 rad
        ((0.06, 0.049), True, ["1"]),
        ((0.06, 0.051), True, []),
    ],
)
def test_hypotheses_that_close_loops_about_as_well_as_the_best_are_fitted(monkeypatch, offs, of_light, words):
    """Within three times the best and a floor, the best first; none where even the best leaves loops open."""
    assert surviving(monkeypatch, offs, of_light=of_light) == (words, len(offs))


def test_no_more_than_eight_hypotheses_are_fitted(monkeypatch):
    """The best of them."""
    words, _ = surviving(monkeypatch, [0.02, *np.linspace(0.03, 0.02, 12)])
    assert words == [str(k) for k in range(12, 4, -1)]


def test_what_a_quick_look_cannot_tell_is_left_out_of_it(monkeypatch):
    """Wider models, and samples paired one late with robots that never move."""
    late = [hypothesis("both", "pairing-shifted", ("eye", "hand")), hypothesis("hand", "pairing-shifted", ("hand",))]
    among = [hypothesis("wider", nested=True), *late, hypothesis("exchanged", about=("eye", "hand"))]
    still = simulate(Scenario(samples=6, arms="eye_still"), 0)
    assert surviving(monkeypatch, [0.02] * 3, among, made=still) == (["hand", "exchanged"], 3)


def test_a_hypothesis_is_out_of_the_race_at_twice_the_declared_error(monkeypatch):
    """So much it is told that its error may be; nothing is fitted where a fact stands against it."""
    limits = []
    monkeypatch.setattr(conventions, "fit_hypothesis", lambda *given: limits.append(given[-1]))
    whole = HypothesisFit(None, np.full(10, 0.03), True)
    declared = TriedHypothesis(hypothesis("declared"), whole, ())
    assert conventions._try(BOARD.cell, BOARD.recording, hypothesis("other"), STATED, None, declared) == []
    assert limits == [pytest.approx(0.06)]
    monkeypatch.setattr(conventions, "impossible_input", lambda *given: ("a fact",))
    assert conventions._try(BOARD.cell, BOARD.recording, hypothesis("other"), STATED, None, declared) == []
    assert len(limits) == 1


@pytest.mark.parametrize(("equations", "enough"), [(6, False), (33, False), (34, True), (100, True)])
def test_two_thirds_of_the_samples_need_a_quarter_more_equations_than_unknowns(equations, enough):
    """Of 18 unknowns 22.5 must be left in two folds: 34 equations leave 22.7, one less is too few."""
    measurement = SimpleNamespace(equations=lambda: np.array([equations - 3, 3]))
    problem = SimpleNamespace(groups=(SimpleNamespace(measurement=measurement),), width=18)
    assert conventions._can_hold_out(problem) == enough


def test_robots_that_move_are_told_by_poses_or_joints():
    """Those that stand elsewhere in any sample."""
    assert conventions._moving(BOARD.recording) == ["eye", "hand"]
    assert conventions._moving(simulate(Scenario(samples=4, arms="eye_still"), 0).recording) == ["hand"]
    assert sorted(conventions._moving(simulate(Scenario(samples=3, joints=True), 0).recording)) == ["eye", "hand"]
    one = replace(BOARD.recording, samples=BOARD.recording.samples[:1])
    assert conventions._moving(one) == []
