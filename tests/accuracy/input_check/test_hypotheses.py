"""Tests of the convention hypotheses: each undoes its mix-up, and is made only if the mix-up is possible."""

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


def count_codes(made):
    """Number of hypotheses of each code."""
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


def is_undone(made, mixed, hypothesis):
    """Whether a hypothesis restores the original recording, in the problem as well."""
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


def test_hypotheses_of_pixel_board_with_poses():
    """Hypotheses of board pixels with robot poses.

    Every subset of two arms may be inverted, in other units, or have reordered quaternions; also exchanged arms, the
    board size and the lens.
    """
    assert count_codes(BOARD) == {
        "robot-pose-inverted": 3, "length-unit": 8, "quaternion-order": 6, "robots-swapped": 1, **PAIRINGS,
        "board-size": 1, "intrinsics": 1,
    }  # fmt: skip


def test_hypotheses_of_observed_poses():
    """Observed poses may be inverted, in other units, mirrored, or have reordered quaternions.

    They have no size or lens.
    """
    assert count_codes(POSES) == {
        "robot-pose-inverted": 3, "target-pose-inverted": 1, "length-unit": 10, "quaternion-order": 8,
        "robots-swapped": 1, **PAIRINGS, "mirrored": 1,
    }  # fmt: skip


def test_hypotheses_of_3d_points_and_leds():
    """3-D points may be in millimetres or mirrored; an LED has no size."""
    assert count_codes(POINTS) == {
        "robot-pose-inverted": 3, "length-unit": 10, "quaternion-order": 6, "robots-swapped": 1, **PAIRINGS,
        "board-size": 1, "mirrored": 1,
    }  # fmt: skip
    assert "board-size" not in count_codes(LIGHT)


def test_joints_have_angle_unit_hypotheses_only():
    """Joints have degree or radian hypotheses for each arm and both, and exchange.

    None is inverted or in millimetres.
    """
    assert count_codes(JOINTS) == {"angle-unit": 6, "robots-swapped": 1, **PAIRINGS, "board-size": 1, "intrinsics": 1}


def test_arms_with_different_joint_counts_are_not_exchanged():
    """Arms with different joint counts cannot be exchanged: six joints do not fit seven axes."""
    given = declared(JOINTS.cell, JOINTS.recording)
    hand = given.tracks["hand"]
    longer = replace(hand, joints=np.pad(hand.joints, ((0, 0), (0, 1))))
    given = replace(given, tracks={**given.tracks, "hand": longer})
    assert "robots-swapped" not in {h.code for h in convention_hypotheses(given)}


def test_only_fixed_lens_has_intrinsics_hypothesis():
    """Only a fixed lens has an `intrinsics` hypothesis; a free one or one with a prior is estimated anyway."""
    made = simulate(Scenario(samples=7, intrinsics="prior"), 0)
    assert hypotheses(made, "intrinsics") == []
    (wrong,) = hypotheses(BOARD, "intrinsics")
    assert wrong.reread(declared(BOARD.cell, BOARD.recording)).cell.cameras["wrist"].intrinsics.status == "free"
    assert (wrong.about, wrong.is_wider) == (("wrist",), True)


@pytest.mark.parametrize("robots", [("eye",), ("hand",), ("eye", "hand")])
def test_inverted_robot_poses_are_undone(robots):
    """Inverted poses (flange from base) of one arm or both are undone."""
    (hypothesis,) = [h for h in hypotheses(BOARD, "robot-pose-inverted") if h.about == robots]
    assert is_undone(
        BOARD, rewriting.with_robots(BOARD.recording, dict.fromkeys(robots, rewriting.inverted)), hypothesis
    )


@pytest.mark.parametrize(("made", "factor", "words"), [(POSES, 1e3, "millimetres"), (POSES, 1e-3, "too small")])
def test_length_units_of_poses_are_undone(made, factor, words):
    """Robot poses, observed poses, or all lengths in millimetres or divided once too often are undone."""
    of = [h for h in hypotheses(made, "length-unit") if words in h.words]
    robots = rewriting.with_robots(made.recording, dict.fromkeys(("eye", "hand"), rewriting.scaled(factor)))
    assert sum(is_undone(made, robots, h) for h in of) == 1
    seen = rewriting.with_targets(made.recording, rewriting.scaled(factor))
    assert sum(is_undone(made, seen, h) for h in of) == 1
    (every,) = [h for h in of if h.words.startswith("all lengths")]
    found = every.reread(declared(made.cell, rewriting.with_targets(robots, rewriting.scaled(factor))))
    right = declared(made.cell, made.recording)
    np.testing.assert_allclose(seen_of(found), seen_of(right))
    np.testing.assert_allclose(robots_of(found)["eye"], robots_of(right)["eye"])


def test_length_units_of_points_and_boards_are_undone():
    """Points a thousand times too far, and a board whose squares are in millimetres, are undone."""
    far = rewriting.with_points(POINTS.recording, 1e3)
    of = [h for h in hypotheses(POINTS, "length-unit") if "3-D points" in h.words]
    assert [is_undone(POINTS, far, h) for h in of] == [True, False]
    (size,) = hypotheses(BOARD, "board-size")
    right = declared(BOARD.cell, BOARD.recording)
    board = size.reread(right.resize({"board": 1e3}))
    true = BOARD.cell.targets["board"].target.points
    np.testing.assert_allclose(board.cell.targets["board"].target.points, true)
    np.testing.assert_allclose(board.problem.groups[0].measurement.points_in_target, true)


@pytest.mark.parametrize(("factor", "row"), [(180 / np.pi, 0), (np.pi / 180, 1)])
def test_angle_units_are_undone(factor, row):
    """Joints in degrees, or converted to radians once too often, are undone."""
    mixed = rewriting.with_joints(JOINTS.recording, "hand", factor)
    of = [h for h in hypotheses(JOINTS, "angle-unit") if h.about == ("hand",)]
    assert [is_undone(JOINTS, mixed, h) for h in of] == [k == row for k in range(2)]


def test_quaternion_orders_are_undone():
    """Quaternions written as w, x, y, z, or reordered though right, are undone for robots and observed poses."""
    for order in ((3, 0, 1, 2), (1, 2, 3, 0)):
        arm = rewriting.with_robots(POSES.recording, {"hand": rewriting.reordered(order)})
        seen = rewriting.with_targets(POSES.recording, rewriting.reordered(order))
        of = hypotheses(POSES, "quaternion-order")
        assert sum(is_undone(POSES, arm, h) for h in of) == 1
        assert sum(is_undone(POSES, seen, h) for h in of) == 1


def test_exchanged_inverted_and_mirrored_are_undone():
    """Exchanged robots and inverted or mirrored targets are each undone by the one hypothesis of their code."""
    mixed = {
        "robots-swapped": rewriting.exchanged(POSES.recording, "eye", "hand"),
        "target-pose-inverted": rewriting.with_targets(POSES.recording, rewriting.inverted),
        "mirrored": rewriting.with_targets(POSES.recording, rewriting.through_the_camera),
    }
    for code, recording in mixed.items():
        (hypothesis,) = hypotheses(POSES, code)
        assert is_undone(POSES, recording, hypothesis)
    (mirrored,) = hypotheses(POINTS, "mirrored")
    assert is_undone(POINTS, rewriting.with_points(POINTS.recording, -1.0), mirrored)


def test_streams_of_pairing_shifts():
    """Pairing shifts concern the observations and each of several robots.

    A single robot only against the observations.
    """
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
def test_wording_of_shift_hypothesis(by, start, first, words):
    """A shift hypothesis states its size, its direction and the sample at which it starts."""
    found = shift_hypothesis("hand", by, start, first)
    assert found.words == words
    assert ("missed" in found.fix) == bool(start)
    assert shift_hypothesis(None, by).words.startswith("what the cameras saw belongs")
    assert shift_hypothesis(None, by).about == ()
    assert len(found.reread(declared(BOARD.cell, BOARD.recording)).order) == 7 - abs(by)


def test_symmetric_board_poses_have_half_turn_hypothesis():
    """Observed poses of an even-by-odd chessboard may be counted from its other end.

    Pixels of a chessboard have no such hypothesis.
    """
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


def test_half_turn_changes_one_target_only():
    """A half-turn hypothesis leaves the observed poses of another target unchanged."""
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


def test_size_hypothesis_scales_points_or_poses():
    """A size hypothesis scales target points, or the distances of observed poses.

    It states the resulting square size.
    """
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
    """`AS_DECLARED` has no code and returns the reading that it is given."""
    given = declared(BOARD.cell, BOARD.recording)
    assert AS_DECLARED.reread(given) is given
    assert AS_DECLARED.code == ""


def test_robots_with_mixed_states_have_no_hypothesis():
    """An arm with joints in only one sample has neither poses nor joints throughout, and gets no hypothesis."""
    first = BOARD.recording.samples[0]
    mixed = replace(first, robots={**first.robots, "hand": replace(JOINTS.recording.samples[0].robots["hand"])})
    recording = replace(BOARD.recording, samples=(mixed, *BOARD.recording.samples[1:]))
    of = convention_hypotheses(declared(JOINTS.cell, recording))
    about = {h.about for h in of if h.code == "robot-pose-inverted"}
    assert about == {("eye",)}


def test_wording_of_unit_hypotheses():
    """Unit hypotheses of each robot, both, the observations and all lengths state the problem and the fix in full."""
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
def test_shifts_are_below_a_third_of_samples(samples):
    """Streams are shifted by one or two samples, less than a third of the recording, in both directions."""
    made = simulate(Scenario(samples=samples), 0)
    late = {h.words for h in hypotheses(made, "pairing-shifted") if h.about == ()}
    wanted = [by for by in (1, 2) if by < samples // 3]
    assert late == {
        f"what the cameras saw belongs {by} sample{'s' if by > 1 else ''} {way}"
        for by in wanted
        for way in ("later", "earlier")
    }


def test_robot_subjects_are_each_and_all():
    """Robot subsets are each robot alone, and all together if there are several."""
    assert [[*robot_subjects(names)] for names in ([], ["a"], ["a", "b", "c"])] == [
        [], [("a",)], [("a",), ("b",), ("c",), ("a", "b", "c")],
    ]  # fmt: skip
    assert robot_subjects(["a", "b"])["a", "b"] == "a and b"


def test_whole_shift_depends_on_sample_order():
    """A shift of all samples depends on their order, is no wider model, and mentions no missed detection.

    `AS_DECLARED` has neither property.
    """
    whole = shift_hypothesis(None, 1)
    assert (whole.fix, whole.depends_on_order, whole.is_wider) == ("pair it accordingly", True, False)
    assert (AS_DECLARED.depends_on_order, AS_DECLARED.is_wider) == (False, False)


def test_all_lengths_hypothesis_needs_poses_of_all_arms():
    """If one arm gives joints, its kinematics are in metres: only the poses of the other arm may be in millimetres."""
    samples = [
        replace(s, robots={"eye": s.robots["eye"], "hand": j.robots["hand"]})
        for s, j in zip(BOARD.recording.samples, JOINTS.recording.samples, strict=True)
    ]
    mixed = replace(BOARD.recording, samples=tuple(samples))
    found = [h for h in convention_hypotheses(declared(JOINTS.cell, mixed)) if h.code == "length-unit"]
    assert [h.about for h in found] == [("eye",), ("eye",)]
    none = replace(BOARD.recording, samples=tuple(replace(s, robots={}) for s in samples))
    assert not [h for h in convention_hypotheses(declared(JOINTS.cell, none)) if h.code == "length-unit"]


def test_observed_poses_have_no_board_size_hypothesis():
    """A target observed as poses has no size hypothesis, though the cell states its size."""
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
        ((320, 354), (1280, 720), ""),  # a cropped image
        ((322, 177), (1280, 720), "looks like that of images of about 6.. x 3.. px, not of 1280 x 720 px"),
        ((1286, 708), (1280, 720), "looks like that of images of about 25.. x 14.. px, not of"),
        ((322, 177), None, r"points reach to \(1200, 690\) px, its camera matrix is of smaller images"),
        ((-5, -5), (1280, 720), ""),
    ],
)
def test_other_image_resolution_is_named(center, size_px, clause):
    """Another resolution is named if the principal point is at one ratio of the centre in both axes, and not 1."""
    found = other_resolution(camera(center, size_px), PROBLEM)
    assert re.search(clause, found) if clause else found == ""


def test_camera_without_lens_has_no_resolution_clause():
    """A camera that gives poses has no camera matrix, hence no clause on its resolution."""
    assert other_resolution(CellCamera("wrist", "eye"), PROBLEM) == ""


@pytest.mark.parametrize(
    ("factors", "is_reported"),
    [
        ((1.24, 1.24), False),
        ((1.26, 1.26), True),
        ((0.81, 0.81), False),
        ((0.79, 0.79), True),
        ((2.0, 2.28), True),
        ((2.0, 2.38), False),
    ],
)
def test_resolution_ratio_limits(factors, is_reported):
    """Another resolution is named from a ratio of a quarter on, if both axes agree within a seventh.

    The stated size is that of the images by the mean of both ratios.
    """
    center = np.array(factors) * np.array([1280, 720]) / 2 - 0.5
    found = other_resolution(camera(center, (1280, 720)), PROBLEM)
    mean = np.sqrt(factors[0] * factors[1])
    size = f"{1280 * mean:.0f} x {720 * mean:.0f} px"
    clause = f": its camera matrix looks like that of images of about {size}, not of 1280 x 720 px"
    assert found == (clause if is_reported else "")


@pytest.mark.parametrize(
    ("center", "is_reported"), [((479.6, 275.4), False), ((479.4, 275.4), True), ((479.4, 275.6), False)]
)
def test_points_beyond_smaller_images_are_reported(center, is_reported):
    """Points over a quarter beyond twice the principal point in both axes are reported.

    This camera's pixels alone count.
    """
    found = other_resolution(camera(center, None), PROBLEM)
    assert found == (": points reach to (1200, 690) px, its camera matrix is of smaller images" if is_reported else "")
