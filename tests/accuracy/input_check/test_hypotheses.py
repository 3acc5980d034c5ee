"""Each hypothesis undoes the mix-up that it is about, and is made where the mix-up can be."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared import rewriting
from tests.shared.declared import declared

from basecal.accuracy.input_check.hypotheses import (
    AS_DECLARED,
    convention_hypotheses,
    other_resolution,
    robot_subjects,
    shift_hypothesis,
    streams,
)
from basecal.accuracy.input_check.target_sizes import size_hypothesis
from basecal.cell import CellCamera, Intrinsics, Recording
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import Camera
from basecal.simulation import Scenario, simulate

BOARD = simulate(Scenario(samples=7), 0)
POSES = simulate(Scenario(samples=7, target="pose"), 0)
POINTS = simulate(Scenario(samples=7, target="points3d"), 0)
LIGHT = simulate(Scenario(samples=7, target="led"), 0)
JOINTS = simulate(Scenario(samples=7, joints=True), 0)


def hypotheses(made, code):
    return [h for h in convention_hypotheses(declared(made.cell, made.recording)) if h.code == code]


def told(made):
    """How many of each code."""
    codes = [h.code for h in convention_hypotheses(declared(made.cell, made.recording))]
    return {code: codes.count(code) for code in codes}


def robots_of(reading):
    """Poses or joints of all robots, by name."""
    return {n: t.pose.matrix if t.joints is None else t.joints for n, t in reading.tracks.items()}


def seen_of(reading):
    (group,) = reading.problem.groups
    seen = group.measurement
    if isinstance(seen, PixelMeasurement):
        return seen.pixels
    return seen.points_in_camera if isinstance(seen, PointMeasurement) else seen.measured_camera_from_target.matrix


def undone(made, mixed, hypothesis):
    """Whether a hypothesis about what was mixed up gives back what was made, in the problem as well."""
    right, wrong = declared(made.cell, made.recording), declared(made.cell, mixed)
    found = hypothesis.reread(wrong)
    robots, true = robots_of(found), robots_of(right)
    if not all(np.allclose(robots[name], true[name], atol=1e-9) for name in true):
        return False
    pairs = zip(found.problem.groups, right.problem.groups, strict=True)
    for one, other in (ends for pair in pairs for ends in zip(*(group.ends for group in pair), strict=True)):
        np.testing.assert_allclose(one.base_from_flange.matrix, other.base_from_flange.matrix, atol=1e-9)
    return np.allclose(seen_of(found), seen_of(right), atol=1e-9) and found.cell is made.cell


PAIRINGS = {"pairing-shifted": 6}  # seven samples allow shifts by one; three streams


def test_a_board_by_pixels_and_poses():
    """Every subset of two arms inverted, in units, by quaternions; exchanged; its size, and the lens."""
    assert told(BOARD) == {
        "robot-pose-inverted": 3, "length-unit": 8, "quaternion-order": 6, "robots-swapped": 1, **PAIRINGS,
        "board-size": 1, "intrinsics": 1,
    }  # fmt: skip


def test_observed_poses_have_conventions_of_their_own():
    """Inverted, in units, by quaternions and mirrored; a size or a lens they have not."""
    assert told(POSES) == {
        "robot-pose-inverted": 3, "target-pose-inverted": 1, "length-unit": 10, "quaternion-order": 8,
        "robots-swapped": 1, **PAIRINGS, "mirrored": 1,
    }  # fmt: skip


def test_3d_points_and_lights():
    """Points in 3-D may be in millimetres or mirrored; a light has no size."""
    assert told(POINTS) == {
        "robot-pose-inverted": 3, "length-unit": 10, "quaternion-order": 6, "robots-swapped": 1, **PAIRINGS,
        "board-size": 1, "mirrored": 1,
    }  # fmt: skip
    assert "board-size" not in told(LIGHT)


def test_joints_have_angles_and_no_poses():
    """Degrees or radians for each arm and for both; exchanged; nothing is inverted or in millimetres."""
    assert told(JOINTS) == {"angle-unit": 6, "robots-swapped": 1, **PAIRINGS, "board-size": 1, "intrinsics": 1}


def test_joints_of_arms_with_other_axes_are_not_exchanged():
    """Six joints cannot stand where seven are asked for."""
    given = declared(JOINTS.cell, JOINTS.recording)
    hand = given.tracks["hand"]
    longer = replace(hand, joints=np.pad(hand.joints, ((0, 0), (0, 1))))
    given = replace(given, tracks={**given.tracks, "hand": longer})
    assert "robots-swapped" not in {h.code for h in convention_hypotheses(given)}


def test_a_lens_that_is_not_fixed_is_not_doubted():
    """Free or known by a prior it is estimated anyway."""
    made = simulate(Scenario(samples=7, intrinsics="prior"), 0)
    assert hypotheses(made, "intrinsics") == []
    (wrong,) = hypotheses(BOARD, "intrinsics")
    assert wrong.reread(declared(BOARD.cell, BOARD.recording)).cell.cameras["wrist"].intrinsics.status == "free"
    assert (wrong.about, wrong.is_wider) == (("wrist",), True)


@pytest.mark.parametrize("robots", [("eye",), ("hand",), ("eye", "hand")])
def test_inverted_robots(robots):
    """Flange from base, of one arm or both."""
    (hypothesis,) = [h for h in hypotheses(BOARD, "robot-pose-inverted") if h.about == robots]
    assert undone(BOARD, rewriting.with_robots(BOARD.recording, dict.fromkeys(robots, rewriting.inverted)), hypothesis)


@pytest.mark.parametrize(("made", "factor", "words"), [(POSES, 1e3, "millimetres"), (POSES, 1e-3, "too small")])
def test_units_of_lengths(made, factor, words):
    """Robots, observed poses, and everything together, in millimetres or divided once too often."""
    of = [h for h in hypotheses(made, "length-unit") if words in h.words]
    robots = rewriting.with_robots(made.recording, dict.fromkeys(("eye", "hand"), rewriting.scaled(factor)))
    assert sum(undone(made, robots, h) for h in of) == 1
    seen = rewriting.with_targets(made.recording, rewriting.scaled(factor))
    assert sum(undone(made, seen, h) for h in of) == 1
    (every,) = [h for h in of if h.words.startswith("all lengths")]
    found = every.reread(declared(made.cell, rewriting.with_targets(robots, rewriting.scaled(factor))))
    right = declared(made.cell, made.recording)
    np.testing.assert_allclose(seen_of(found), seen_of(right))
    np.testing.assert_allclose(robots_of(found)["eye"], robots_of(right)["eye"])


def test_units_of_3d_points_and_sizes():
    """Points a thousand times too far; a board whose squares are in millimetres."""
    far = rewriting.with_points(POINTS.recording, 1e3)
    of = [h for h in hypotheses(POINTS, "length-unit") if "3-D points" in h.words]
    assert [undone(POINTS, far, h) for h in of] == [True, False]
    (size,) = hypotheses(BOARD, "board-size")
    right = declared(BOARD.cell, BOARD.recording)
    board = size.reread(right.resize({"board": 1e3}))
    true = BOARD.cell.targets["board"].target.points
    np.testing.assert_allclose(board.cell.targets["board"].target.points, true)
    np.testing.assert_allclose(board.problem.groups[0].measurement.points_in_target, true)


@pytest.mark.parametrize(("factor", "row"), [(180 / np.pi, 0), (np.pi / 180, 1)])
def test_units_of_angles(factor, row):
    """Joints in degrees, or turned into radians once too often."""
    mixed = rewriting.with_joints(JOINTS.recording, "hand", factor)
    of = [h for h in hypotheses(JOINTS, "angle-unit") if h.about == ("hand",)]
    assert [undone(JOINTS, mixed, h) for h in of] == [k == row for k in range(2)]


def test_quaternions_written_in_another_order():
    """As w, x, y, z, and turned round though they were right; of arms and of what was observed."""
    for order in ((3, 0, 1, 2), (1, 2, 3, 0)):
        arm = rewriting.with_robots(POSES.recording, {"hand": rewriting.reordered(order)})
        seen = rewriting.with_targets(POSES.recording, rewriting.reordered(order))
        of = hypotheses(POSES, "quaternion-order")
        assert sum(undone(POSES, arm, h) for h in of) == 1
        assert sum(undone(POSES, seen, h) for h in of) == 1


def test_robots_exchanged_and_targets_inverted_or_mirrored():
    """Each by the one hypothesis of its code."""
    mixed = {
        "robots-swapped": rewriting.exchanged(POSES.recording, "eye", "hand"),
        "target-pose-inverted": rewriting.with_targets(POSES.recording, rewriting.inverted),
        "mirrored": rewriting.with_targets(POSES.recording, rewriting.through_the_camera),
    }
    for code, recording in mixed.items():
        (hypothesis,) = hypotheses(POSES, code)
        assert undone(POSES, recording, hypothesis)
    (mirrored,) = hypotheses(POINTS, "mirrored")
    assert undone(POINTS, rewriting.with_points(POINTS.recording, -1.0), mirrored)


def test_streams_that_may_be_late():
    """What was seen, and each of several robots; a single one only against what was seen."""
    assert streams(["eye", "hand"]) == [None, "eye", "hand"]
    assert streams(["arm"]) == [None]
    assert [h.about for h in hypotheses(BOARD, "pairing-shifted")] == [(), (), ("eye",), ("eye",), ("hand",), ("hand",)]
    longer = simulate(Scenario(samples=9), 0)
    assert len(hypotheses(longer, "pairing-shifted")) == 12
    assert hypotheses(simulate(Scenario(samples=5), 0), "pairing-shifted") == []


@pytest.mark.parametrize(
    ("by", "start", "first", "words"),
    [
        (1, 0, None, "what hand recorded belongs 1 sample later"),
        (-2, 0, None, "what hand recorded belongs 2 samples earlier"),
        (2, 4, 17, "what hand recorded from sample 17 on belongs 2 samples later"),
    ],
)
def test_a_shift_in_words(by, start, first, words):
    """How far, which way, and from where."""
    found = shift_hypothesis("hand", by, start, first)
    assert found.words == words
    assert ("missed" in found.fix) == bool(start)
    assert shift_hypothesis(None, by).words.startswith("what the cameras saw belongs")
    assert shift_hypothesis(None, by).about == ()
    assert len(found.reread(declared(BOARD.cell, BOARD.recording)).order) == 7 - abs(by)


def test_half_turns_of_poses_of_a_symmetric_board():
    """Observed poses of a chessboard of even and odd corners may count from its other end; ChArUco boards cannot."""
    chess = simulate(Scenario(samples=7, target="chessboard"), 0)
    board = chess.cell.targets["board"]
    cell = replace(POSES.cell, targets={"board": replace(POSES.cell.targets["board"], target=board.target)})
    (found,) = [h for h in convention_hypotheses(declared(cell, POSES.recording)) if h.code == "board-symmetry"]
    given = declared(cell, POSES.recording)
    once = found.reread(given)
    np.testing.assert_allclose(seen_of(found.reread(once)), seen_of(given), atol=1e-12)
    assert np.abs(seen_of(once) - seen_of(given)).max() > 0.1
    assert found.about == ("board",)
    assert hypotheses(chess, "board-symmetry") == []


def test_a_half_turn_is_of_one_target_alone():
    """The observed poses of another target stay."""
    chess = simulate(Scenario(samples=7, target="chessboard"), 0)
    board = replace(POSES.cell.targets["board"], target=chess.cell.targets["board"].target)
    cell = replace(POSES.cell, targets={"board": board, "second": replace(POSES.cell.targets["board"], name="second")})
    samples = [
        replace(s, observations=(*s.observations, *(replace(o, target="second") for o in s.observations)))
        for s in POSES.recording.samples
    ]
    given = declared(cell, Recording(tuple(samples)))
    (found,) = [h for h in convention_hypotheses(given) if h.code == "board-symmetry"]
    pairs = zip(given.problem.groups, found.reread(given).problem.groups, strict=True)
    changes = {
        old.target: np.abs(
            old.measurement.measured_camera_from_target.matrix - new.measurement.measured_camera_from_target.matrix
        ).max()
        for old, new in pairs
    }
    assert changes["board"] > 0.1
    assert changes["second"] == 0.0


def test_a_size_that_is_found():
    """Points grow by it, observed poses move off by it, and what the square would be is said."""
    found = size_hypothesis("board", 1.25, BOARD.cell)
    board = declared(BOARD.cell, BOARD.recording)
    reading = found.reread(board)
    true = BOARD.cell.targets["board"].target
    np.testing.assert_allclose(reading.cell.targets["board"].target.points, 1.25 * true.points)
    np.testing.assert_allclose(reading.problem.groups[0].measurement.points_in_target, 1.25 * true.points)
    np.testing.assert_array_equal(seen_of(reading), seen_of(board))
    assert found.words == "board is 1.25 times as large as stated"
    assert f"square_m would be {1.25 * true.options['square_m']:.5g}" in found.fix
    poses = declared(POSES.cell, POSES.recording)
    further = seen_of(size_hypothesis("board", 2.0, POSES.cell).reread(poses))
    np.testing.assert_allclose(further[:, :3, 3], 2.0 * seen_of(poses)[:, :3, 3])
    np.testing.assert_allclose(further[:, :3, :3], seen_of(poses)[:, :3, :3])
    others = replace(
        poses,
        cell=replace(
            POSES.cell, targets={**POSES.cell.targets, "other": replace(POSES.cell.targets["board"], name="other")}
        ),
    )
    other = size_hypothesis("other", 2.0, others.cell).reread(others)
    np.testing.assert_array_equal(seen_of(other), seen_of(poses))


def test_as_declared_changes_nothing():
    """It has no code and gives back what it is given."""
    given = declared(BOARD.cell, BOARD.recording)
    assert AS_DECLARED.reread(given) is given
    assert AS_DECLARED.code == ""


def test_robots_with_some_poses_only_are_not_reread():
    """An arm that gives joints in one sample has neither poses nor joints throughout."""
    first = BOARD.recording.samples[0]
    mixed = replace(first, robots={**first.robots, "hand": replace(JOINTS.recording.samples[0].robots["hand"])})
    recording = replace(BOARD.recording, samples=(mixed, *BOARD.recording.samples[1:]))
    of = convention_hypotheses(declared(JOINTS.cell, recording))
    about = {h.about for h in of if h.code == "robot-pose-inverted"}
    assert about == {("eye",)}


def test_units_are_told_in_whole_words():
    """Of each robot, of both, of what was seen and of all: what is wrong and what to do."""
    found = hypotheses(POSES, "length-unit")
    who = ["the poses of eye", "the poses of hand", "the poses of eye and hand", "the observed poses"]
    who += ["all lengths, of robots and targets,"]
    words = [f"{each} are {what}" for what in ("in millimetres", "1000 times too small") for each in who]
    assert [h.words for h in found] == words
    assert [h.fix for h in found] == [
        f"lengths are in metres: {advice} by 1000" for advice in ("divide them", "multiply them") for _ in who
    ]
    assert [h.about for h in found[:5]] == [("eye",), ("hand",), ("eye", "hand"), (), ("eye", "hand")]
    (size,) = hypotheses(BOARD, "board-size")
    assert size.words == "the size of board is in millimetres"
    points = size.reread(declared(BOARD.cell, BOARD.recording)).cell.targets["board"].target.points
    np.testing.assert_allclose(points, 1e-3 * BOARD.cell.targets["board"].target.points)
    angles = [h.words for h in hypotheses(JOINTS, "angle-unit")]
    assert angles[:2] == [
        "the joints of eye are in degrees",
        "the joints of eye are converted from degrees to radians although they were radians",
    ]


@pytest.mark.parametrize("samples", [6, 7, 9, 10])
def test_streams_are_late_by_less_than_a_third_of_the_samples(samples):
    """By one and two samples, and either way."""
    made = simulate(Scenario(samples=samples), 0)
    late = {h.words for h in hypotheses(made, "pairing-shifted") if h.about == ()}
    wanted = [by for by in (1, 2) if by < samples // 3]
    assert late == {
        f"what the cameras saw belongs {by} sample{'s' if by > 1 else ''} {way}"
        for by in wanted
        for way in ("later", "earlier")
    }


def test_subsets_are_each_and_all():
    """All together only where there are several."""
    assert [[*robot_subjects(names)] for names in ([], ["a"], ["a", "b", "c"])] == [
        [], [("a",)], [("a",), ("b",), ("c",), ("a", "b", "c")],
    ]  # fmt: skip
    assert robot_subjects(["a", "b"])["a", "b"] == "a and b"


def test_a_shift_of_all_samples_goes_by_their_order():
    """It is no wider model, and asks for no missed detection; what is declared is neither."""
    whole = shift_hypothesis(None, 1)
    assert (whole.fix, whole.depends_on_order, whole.is_wider) == ("pair it accordingly", True, False)
    assert (AS_DECLARED.depends_on_order, AS_DECLARED.is_wider) == (False, False)


def test_all_lengths_are_not_mistaken_where_an_arm_tells_joints():
    """Its kinematics are in metres: only poses of the other arm may be in millimetres."""
    samples = [
        replace(s, robots={"eye": s.robots["eye"], "hand": j.robots["hand"]})
        for s, j in zip(BOARD.recording.samples, JOINTS.recording.samples, strict=True)
    ]
    mixed = replace(BOARD.recording, samples=tuple(samples))
    found = [h for h in convention_hypotheses(declared(JOINTS.cell, mixed)) if h.code == "length-unit"]
    assert [h.about for h in found] == [("eye",), ("eye",)]
    none = replace(BOARD.recording, samples=tuple(replace(s, robots={}) for s in samples))
    assert not [h for h in convention_hypotheses(declared(JOINTS.cell, none)) if h.code == "length-unit"]


def test_the_size_of_what_is_seen_as_poses_does_not_matter():
    """Though the cell states it."""
    cell = replace(POSES.cell, targets=BOARD.cell.targets)
    assert not [h for h in convention_hypotheses(declared(cell, POSES.recording)) if h.code == "board-size"]


PIXELS = np.array([[[10.0, 20.0], [1200.0, 690.0], [5000.0, 5000.0]]])
SEEN = np.array([[True, True, False]])
VIEWS = PixelMeasurement(np.zeros((3, 3)), PIXELS, SEEN, np.ones((1, 3)), np.ones((1, 3)))
OTHERS = SimpleNamespace(camera="other", measurement=replace(VIEWS, pixels=9 * PIXELS))
PROBLEM = SimpleNamespace(groups=(SimpleNamespace(camera="wrist", measurement=VIEWS), OTHERS))


def camera(center, size_px):
    lens = Camera("pinhole", np.array([900.0, 900.0, *center]))
    return CellCamera("wrist", "eye", size_px=size_px, intrinsics=Intrinsics("fixed", lens))


@pytest.mark.parametrize(
    ("center", "size_px", "clause"),
    [
        ((643, 354), (1280, 720), ""),
        ((643, 354), None, ""),
        ((320, 354), (1280, 720), ""),  # a part cut out of an image
        ((322, 177), (1280, 720), "looks like that of images of about 6.. x 3.. px, not of 1280 x 720 px"),
        ((1286, 708), (1280, 720), "looks like that of images of about 25.. x 14.. px, not of"),
        ((322, 177), None, r"points reach to \(1200, 690\) px, its camera matrix is of smaller images"),
        ((-5, -5), (1280, 720), ""),
    ],
)
def test_another_resolution_is_named(center, size_px, clause):
    """Where the centre lies at one share of the middle both ways, and it is another."""
    found = other_resolution(camera(center, size_px), PROBLEM)
    assert re.search(clause, found) if clause else found == ""


def test_without_a_lens_nothing_is_said():
    """A camera that gives poses has no camera matrix."""
    assert other_resolution(CellCamera("wrist", "eye"), PROBLEM) == ""


@pytest.mark.parametrize(
    ("factors", "told"),
    [
        ((1.24, 1.24), False),
        ((1.26, 1.26), True),
        ((0.81, 0.81), False),
        ((0.79, 0.79), True),
        ((2.0, 2.28), True),
        ((2.0, 2.38), False),
    ],
)
def test_a_quarter_is_another_resolution_and_both_sides_agree(factors, told):
    """To a seventh of one another; the size is that of the images by the mean of both factors."""
    center = np.array(factors) * np.array([1280, 720]) / 2 - 0.5
    found = other_resolution(camera(center, (1280, 720)), PROBLEM)
    mean = np.sqrt(factors[0] * factors[1])
    size = f"{1280 * mean:.0f} x {720 * mean:.0f} px"
    said = f": its camera matrix looks like that of images of about {size}, not of 1280 x 720 px"
    assert found == (said if told else "")


@pytest.mark.parametrize(("center", "told"), [((479.6, 275.4), False), ((479.4, 275.4), True), ((479.4, 275.6), False)])
def test_points_reach_beyond_smaller_images(center, told):
    """A quarter beyond twice the centre both ways, by the pixels of this camera alone."""
    found = other_resolution(camera(center, None), PROBLEM)
    assert found == (": points reach to (1200, 690) px, its camera matrix is of smaller images" if told else "")
