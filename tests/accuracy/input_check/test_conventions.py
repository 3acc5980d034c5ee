"""Mix-ups are named, symmetries are told, and clean cells left alone; `benchmarks.mutations` is the whole matrix."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.mutate import lines_of, mutations, recording_of
from tests.shared.real_recordings import example, nao_cell

from basecal.accuracy.input_check import conventions
from basecal.accuracy.input_check.hypotheses import AS_DECLARED, ConventionHypothesis, resized
from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit
from basecal.accuracy.input_check.rewriting import inverted, with_robots, with_targets
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
        (BOARD, "target times", "board-size", ("board",)),
        (BOARD, "focal length", "intrinsics", ("wrist",)),
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


ASKED = "eye_base_from_hand_base"


def predicted(core, whole=None, sigma=1e-3, moved=0.0, unobservable=()):
    """A fit whose views are off by so much [rad], with what is asked moved by so many of its sigmas."""
    off = np.full(10, core)
    off[7:] = np.sqrt((10 * (whole or core) ** 2 - 7 * core**2) / 3)
    solution = SimpleNamespace(
        state=SimpleNamespace(transforms={ASKED: SE3.exp([moved * sigma, 0, 0, 0, 0, 0])}),
        covariance_of=lambda names: sigma**2 * np.eye(6),
        observability=SimpleNamespace(unobservable=frozenset(unobservable)),
        noise=SimpleNamespace(estimated=("pose_m",)),
        converged=True,
        cost=1.0,
    )
    return HypothesisFit(solution, off, False)


def findings_about(declared, *others, impossible=(), nested=False, code="inverted", explained=False, still=frozenset()):
    """Findings about other readings."""
    cell = SimpleNamespace(asked=(ASKED,), mount_name=lambda name: "mount")
    tried = []
    for k, other in enumerate(others):
        about = ("eye", f"hand{k}")
        reading = ConventionHypothesis(code, about, f"words {k}", "fix", "tell", lambda c, r: (c, r), nested)
        tried.append(conventions._Tried(reading, other, ()))
    return conventions._decided(cell, conventions._Tried(AS_DECLARED, declared, impossible), tried, explained, still)


def decided(declared, other, impossible=(), nested=False, code="inverted"):
    """Codes of the findings about one other reading."""
    found = findings_about(declared, other, impossible=impossible, nested=nested, code=code)
    return [f.code for f in found]


@pytest.mark.parametrize(("moved", "found"), [(2.9, []), (3.1, ["ambiguous-convention"])])
def test_a_reading_that_fits_as_well_must_move_what_is_asked(moved, found):
    """Readings that predict as well are told from three sigmas on."""
    assert decided(predicted(1e-3), predicted(1e-3, moved=moved)) == found


@pytest.mark.parametrize(("core", "found"), [(0.92e-3, []), (0.9e-3, ["inverted"])])
def test_a_better_reading_is_a_tenth_better(core, found):
    """What moves the answer is believed where it predicts a tenth better; what does not, twice better."""
    assert decided(predicted(1e-3), predicted(core, moved=5), code="inverted")[:1] == (
        found or ["ambiguous-convention"]
    )
    assert decided(predicted(1e-3), predicted(core)) == []


@pytest.mark.parametrize(("core", "found"), [(0.51e-3, []), (0.49e-3, ["inverted"])])
def test_what_moves_nothing_must_be_twice_as_good(core, found):
    """A reading that leaves what is asked alone is named from a factor of two on."""
    assert decided(predicted(1e-3), predicted(core)) == found


@pytest.mark.parametrize(("core", "found"), [(0.68e-3, []), (0.66e-3, ["inverted"])])
def test_a_wider_model_must_be_half_better(core, found):
    """A reading with more freedoms is named from a factor of 1.5 on, and never as ambiguous."""
    assert decided(predicted(1e-3), predicted(core, moved=50), nested=True) == found


def test_facts_decide_between_equals():
    """Where the declared reading contradicts a fact, one that predicts as well is named, a wider one is not."""
    assert decided(predicted(1e-3), predicted(1.09e-3), impossible=("reach 9 m",)) == ["inverted"]
    assert decided(predicted(1e-3), predicted(1.11e-3), impossible=("reach 9 m",)) == []
    assert decided(predicted(1e-3), predicted(1e-3), impossible=("reach 9 m",), nested=True) == []


def test_loops_that_nothing_closes_are_told():
    """A declared reading beyond 0.03 rad with no better one is a poor fit; so is no reading that is not seen."""
    assert decided(predicted(0.029), predicted(0.05)) == []
    assert decided(predicted(0.031), predicted(0.05)) == ["poor-fit"]
    assert decided(predicted(0.031), predicted(1e-3, unobservable=[ASKED])) == ["poor-fit"]
    assert decided(predicted(1e-3, unobservable=[ASKED]), predicted(1e-3, moved=5)) == []


@pytest.mark.parametrize(("core", "whole"), [(0.8e-3, 2.0e-3), (1.0e-3, 1.6e-3)])
def test_most_samples_or_all_of_them_must_be_predicted_better(core, whole):
    """Better for most and as good for all, or the reverse, is better; where neither is, both fit alike."""
    declared = predicted(1e-3, 2.0e-3)
    assert decided(declared, predicted(core, whole, moved=5)) == ["inverted"]
    assert decided(declared, predicted(0.95e-3, 1.95e-3, moved=5)) == ["ambiguous-convention"]
    assert decided(declared, predicted(core, 2.3e-3, moved=5)) == []


def test_what_explains_the_data_better_is_an_error_with_both_errors():
    """Its words, how well it predicts and how well what is declared does, and what to do."""
    (found,) = findings_about(predicted(1e-3), predicted(0.5e-3, moved=5))
    assert (found.severity, found.about) == ("error", ("eye", "hand0"))
    errors = "0.5 mm a metre (or mrad) instead of 1 mm a metre (or mrad)"
    assert found.message == f"words 0: fix (so read, the cross-validation error is {errors})"


def test_what_cannot_be_is_said():
    """Where a reading only fits as well, but the declared one contradicts facts."""
    (found,) = findings_about(predicted(1e-3), predicted(1e-3), impossible=("a reach of 9 m", "a board in a wall"))
    assert found.message == (
        "words 0: fix (as declared it fits as well, but a reach of 9 m and a board in a wall cannot be)"
    )
    assert found.severity == "error"


@pytest.mark.parametrize(("core", "severity"), [(0.51e-3, "warning"), (0.49e-3, "error")])
def test_a_wider_model_of_what_fits_is_a_warning_up_to_a_factor_of_two(core, severity):
    """Beside a declared reading that is plausible; beside one that is not it is an error."""
    (found,) = findings_about(predicted(1e-3), predicted(core, moved=5), nested=True)
    assert found.severity == severity
    (found,) = findings_about(predicted(0.04), predicted(0.021, moved=5), nested=True)
    assert found.severity == "error"


def test_readings_about_as_good_as_the_best_are_all_named():
    """Within a tenth of it."""
    found = findings_about(predicted(1e-3), predicted(0.4e-3), predicted(0.43e-3), predicted(0.45e-3))
    assert [f.about[1] for f in found] == ["hand0", "hand1"]


def test_ambiguous_readings_are_one_finding():
    """With how far each moves what is asked, all that they are about once, and how to tell them apart once."""
    (found,) = findings_about(predicted(1e-3), predicted(1e-3, moved=5), predicted(1.05e-3, moved=7), predicted(1e-3))
    assert (found.code, found.severity, found.about) == ("ambiguous-convention", "warning", ("eye", "hand0", "hand1"))
    assert f"words 0 (inverted: 1 mm a metre (or mrad), {ASKED} 5 mm away) or words 1" in found.message
    assert f"{ASKED} 7 mm away" in found.message
    assert found.message.endswith("to tell them apart, tell")


def test_a_reading_that_is_no_answer_is_not_named():
    """Contradicting facts, not seeing what is asked, or implausible."""
    good = predicted(0.5e-3, moved=5)
    assert findings_about(predicted(1e-3), good) != ()
    for wrong in (
        predicted(0.5e-3, moved=5, unobservable=[ASKED]),
        HypothesisFit(SimpleNamespace(**vars(good.solution) | {"converged": False}), good.off, False),
    ):
        assert findings_about(predicted(1e-3), wrong) == ()


def test_a_mount_that_a_symmetry_moves_does_not_count():
    """A board's own mount, free, moves by half a turn where the grid is read from its other end; fixed it counts."""
    for status, codes in (("free", []), ("fixed", ["ambiguous-convention"])):
        transforms = {ASKED: SimpleNamespace(status=status)}
        cell = SimpleNamespace(asked=(ASKED,), mount_name=lambda name: ASKED, transforms=transforms)
        reading = ConventionHypothesis("board-symmetry", ("board",), "words", "fix", "", lambda c, r: (c, r))
        tried = conventions._Tried(reading, predicted(1e-3, moved=50), ())
        found = conventions._decided(cell, conventions._Tried(AS_DECLARED, predicted(1e-3), ()), [tried])
        assert [f.code for f in found] == codes
