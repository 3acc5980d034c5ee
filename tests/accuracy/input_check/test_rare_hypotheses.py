"""Tests of the rare hypotheses: each undoes its mix-up, and is named if no usual one explains the data."""

from __future__ import annotations

import shlex
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.journeys.personas import ros_sessions
from tests.shared.declared import declared
from tests.shared.rewriting import turned_round, with_robots

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fixing.cures import find_cures
from basecal.accuracy.input_check.rare_hypotheses import (
    _choose_nearest,
    _choose_shorter,
    _largest_rotation_rad,
    _number_triples,
    _order_hypotheses,
    _reinterpret_rotations,
    _still_runs,
    rare_hypotheses,
)
from basecal.accuracy.readings.reading import Track
from basecal.cell import Unknown
from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=20), 1)


def hypotheses(made, code):
    return [h for h in rare_hypotheses(declared(made.cell, made.recording)) if h.code == code]


def rotations(recording, robot="hand"):
    return np.stack([s.robots[robot].base_from_flange.rotation for s in recording.samples])


def reread_rotations(hypothesis, recording, robot="hand"):
    """Rotations of a robot under a hypothesis."""
    return hypothesis.reread(declared(MADE.cell, recording)).tracks[robot].pose.rotation


def read_as(recording, listed, read):
    """The recording with the hand's rotations written in one convention and read in another."""

    def of(poses):
        turned = Rotation.from_matrix(poses.rotation)
        numbers = turned.as_euler(listed) if listed else turned.as_rotvec()
        return SE3((Rotation.from_euler(read, numbers) if read else Rotation.from_rotvec(numbers)).as_matrix(),
                   poses.translation)  # fmt: skip

    return with_robots(recording, {"hand": of})


def test_number_of_rare_hypotheses():
    """Numbers of rare hypotheses by code.

    Each stream has the reverse order, two orders by name and shifts by 3 to 5 both ways. Each subset of arms has 43
    angle lists, and inches for millimetres and for metres; the target may be on the world instead of an arm.
    """
    assert Counter(h.code for h in rare_hypotheses(declared(MADE.cell, MADE.recording))) == {
        "pairing-shifted": 3 * (1 + 2 + 6), "matrix-transposed": 3, "euler-order": 3 * (5 + 10 * 3 + 4 * 2),
        "pixels-swapped": 1, "position-axes": 3 * 6, "length-unit": 3 * 2, "wrong-carrier": 1,
    }  # fmt: skip
    poses = simulate(Scenario(samples=8, target="pose", layout="eye_in_hand"), 1)
    assert Counter(h.code for h in rare_hypotheses(declared(poses.cell, poses.recording))) == {
        "pairing-shifted": 1, "matrix-transposed": 2, "euler-order": 2 * 43, "position-axes": 2 * 6,
        "length-unit": 2,
    }  # fmt: skip


def test_arms_with_equal_joint_counts_may_be_exchanged():
    """Arms with equal joint counts may be exchanged in either of two sessions, or where they stood still.

    Arms of five and six joints, or of a single session, cannot.
    """
    made = simulate(Scenario(samples=24, arms="halves", joints=True), 1)
    given = declared(made.cell, made.recording)
    hand = replace(given.tracks["hand"], joints=given.tracks["hand"].joints[:, :5])
    for reading, count in ((given, 3), (replace(given, tracks={**given.tracks, "hand": hand}), 0)):
        assert sum(h.code == "robots-swapped" for h in rare_hypotheses(reading)) == count
    still = simulate(Scenario(samples=24, arms="eye_still"), 1)
    assert hypotheses(MADE, "robots-swapped") == hypotheses(still, "robots-swapped") == []


HALVES = simulate(Scenario(samples=24, arms="halves"), 1)


def _wrong_halves(kind):
    """The poses of both arms exchanged in the second half, or the places where they stood still."""
    samples, made = HALVES.recording.samples, []
    for k, sample in enumerate(samples):
        eye, hand = sample.robots["eye"], sample.robots["hand"]
        if kind == "session" and k >= 12:
            eye, hand = hand, eye
        elif kind == "places":  # the hand is at rest in the first half, the eye in the second
            eye, hand = (eye, samples[-1].robots["eye"]) if k < 12 else (samples[0].robots["hand"], hand)
        made.append(replace(sample, robots={"eye": eye, "hand": hand}))
    return replace(HALVES.recording, samples=tuple(made))


@pytest.mark.journey
@pytest.mark.parametrize(("kind", "words"), [
    ("session", "The arms eye and hand are exchanged in samples 12 to 23"),
    ("places", "The places where eye (samples 12 to 23) and hand (samples 0 to 11) stood still are exchanged"),
])  # fmt: skip
def test_exchanged_session_is_named_and_fixed(kind, words):
    """Arms exchanged in one of two sessions with an arm at rest are named, and the fix restores the poses."""
    recording = _wrong_halves(kind)
    found = calibrate(HALVES.cell, recording)
    assert [(each.code, each.what) for each in found.findings if each.severity == "error"] == [
        ("robots-swapped", f"{words}.")
    ]
    (cure,) = find_cures(HALVES.cell, recording, recording, found)
    for old, new, true in zip(recording.samples, cure.change.samples, HALVES.recording.samples, strict=True):
        for robot, state in true.robots.items():
            assert np.array_equal(new.robots[robot].base_from_flange.matrix, state.base_from_flange.matrix)
            as_read = np.array_equal(old.robots[robot].base_from_flange.matrix, state.base_from_flange.matrix)
            assert (new.robots[robot] is old.robots[robot]) == as_read


@pytest.mark.slow
def test_exchanged_places_with_inverted_pose_rival(tmp_path, monkeypatch):
    """Exchanged places are named, though the longer session fits inverted poses of one arm equally well.

    The shorter session does not.
    """
    monkeypatch.chdir(tmp_path)
    for command in ros_sessions(tmp_path, 9).commands[:-1]:
        assert main(shlex.split(command)[1:]) == 0
    cell, recording = read_cell("mycell"), read_recording("mycell")
    states, samples = [sample.robots for sample in recording.samples], []
    for k, sample in enumerate(recording.samples):
        places = {"right": states[-1]["left"]} if k < 13 else {"left": states[0]["right"]}
        samples.append(replace(sample, robots={**sample.robots, **places}))
    found = calibrate(cell, replace(recording, samples=tuple(samples)))
    assert [(each.code, each.what) for each in found.findings if each.severity == "error"] == [(
        "robots-swapped",
        "The places where left (samples 13 to 36) and right (samples 0 to 12) stood still are exchanged.",
    )]  # fmt: skip


@pytest.mark.parametrize(("listed", "read", "count"), [
    ("xyz", "XYZ", 1), ("XYZ", "xyz", 1), ("XYZ", "ZYX", 1), ("ZYX", "XYZ", 1), ("ZYX", "xyz", 1),
])  # fmt: skip
def test_euler_orders_are_undone(listed, read, count):
    """Angles read in another order are undone by exactly one hypothesis, also if the orders are reverses."""
    mixed = read_as(MADE.recording, listed, read)
    back = [h for h in hypotheses(MADE, "euler-order") if h.about == ("hand",)]
    undone = [h for h in back if np.allclose(reread_rotations(h, mixed), rotations(MADE.recording))]
    assert len(undone) == count
    assert all(each.fix.startswith("convert them to rotations as ") for each in undone)


@pytest.mark.parametrize(("listed", "read"), [("", "xyz"), ("", "XYZ"), ("ZYZ", "xyz"), ("xyz", "ZYZ")])
def test_large_angles_read_as_other_lists_are_undone(listed, read):
    """Rotations beyond a quarter turn that were read as other angles are undone.

    A rotation has two lists of angles; each choice is one hypothesis.
    """
    mixed = read_as(MADE.recording, listed, read)
    true, right = rotations(MADE.recording), np.zeros(20, dtype=bool)
    for h in hypotheses(MADE, "euler-order"):
        if h.about == ("hand",):
            right |= np.all(np.isclose(reread_rotations(h, mixed), true), axis=(1, 2))
    assert right.all()


def test_transposed_matrices_are_undone():
    """Transposed rotations are undone, and translations stay."""
    mixed = with_robots(
        MADE.recording, {"hand": lambda poses: SE3(np.swapaxes(poses.rotation, -1, -2), poses.translation)}
    )
    (of_hand,) = (h for h in hypotheses(MADE, "matrix-transposed") if h.about == ("hand",))
    found = of_hand.reread(declared(MADE.cell, mixed)).tracks["hand"].pose
    right = declared(MADE.cell, MADE.recording).tracks["hand"].pose
    np.testing.assert_allclose(found.matrix, right.matrix, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("mixed", "code", "words"), [
    (turned_round(MADE.recording, "hand"), "pairing-shifted", "What hand recorded is in reverse order"),
    (read_as(MADE.recording, "xyz", "XYZ"), "euler-order", "angles about moving axes x, y, z (Staubli)"),
])  # fmt: skip
def test_calibrate_names_rare_mix_ups(mixed, code, words):
    """`calibrate` refuses a rare mix-up with an error that names it; a clean recording gets no such finding."""
    found = calibrate(MADE.cell, mixed)
    assert found.verdict == "refused"
    assert [f.code for f in found.findings if f.severity == "error"] == [code]
    assert words in found.findings[0].message
    assert calibrate(MADE.cell, MADE.recording).verdict == "good"


@pytest.mark.parametrize("robots", [("hand",), ("eye", "hand")])
def test_radians_read_as_degrees_are_undone(robots):
    """Roll, pitch and yaw read as degrees are undone if no flange rotates far from its base's axes.

    Correct arms have no such hypothesis.
    """
    assert hypotheses(MADE, "angle-unit") == []

    def as_degrees(poses):
        return SE3.from_rpy(np.radians(poses.rpy), poses.translation)

    mixed = with_robots(MADE.recording, dict.fromkeys(robots, as_degrees))
    found = [h for h in rare_hypotheses(declared(MADE.cell, mixed)) if h.code == "angle-unit" and h.about == robots]
    assert len(found) == 2
    for robot in robots:
        assert any(
            np.allclose(reread_rotations(each, mixed, robot), rotations(MADE.recording, robot)) for each in found
        )


def test_inverted_stated_transforms_are_undone():
    """A stated base and both stated mounts may be inverted; free transforms have no such hypothesis."""
    known = simulate(Scenario(samples=5, base="fixed", camera_mount="prior", target_mount="fixed"), 1)
    found = hypotheses(known, "transform-inverted")
    assert {h.about[0] for h in found} == set(known.cell.transforms)
    for h in found:
        name = h.about[0]
        reading = h.reread(declared(known.cell, known.recording))
        once = reading.cell
        stated = known.cell.transforms[name].mean
        np.testing.assert_allclose(once.transforms[name].mean.matrix, stated.inverse().matrix, atol=1e-12)
        np.testing.assert_array_equal(reading.problem.unknowns[name].mean.matrix, once.transforms[name].mean.matrix)


def test_exchanged_pixel_axes_are_undone():
    """The hypothesis exchanges u and v of every view."""
    (swap,) = hypotheses(MADE, "pixels-swapped")
    given = declared(MADE.cell, MADE.recording)
    (before,), (once,) = given.problem.groups, swap.reread(given).problem.groups
    np.testing.assert_array_equal(once.measurement.pixels, before.measurement.pixels[..., ::-1])


@pytest.mark.parametrize("listing", ["xyz", "XYZ", "ZYX", "ZYZ", ""])
def test_rotation_has_two_number_triples(listing):
    """Two number triples give one rotation, the usual one first.

    Angles are within half a turn; the second rotation vector is the long way round.
    """
    turns = Rotation.random(9, random_state=0)
    found = _number_triples(turns.as_matrix(), listing)
    assert found.shape == (9, 2, 3)
    np.testing.assert_allclose(found[:, 0], turns.as_euler(listing) if listing else turns.as_rotvec(), atol=1e-12)
    for k in range(2):
        again = Rotation.from_euler(listing, found[:, k]) if listing else Rotation.from_rotvec(found[:, k])
        np.testing.assert_allclose(again.as_matrix(), turns.as_matrix(), atol=1e-9)
    if listing:
        assert np.abs(found).max() <= np.pi
        assert np.all(np.abs(found[:, 0] - found[:, 1]).max(1) > 1.0)
    else:
        np.testing.assert_allclose(np.linalg.norm(found, axis=-1).sum(1), 2 * np.pi)


def test_identity_has_zero_rotation_vector():
    """Both rotation vectors of the identity have zero length."""
    np.testing.assert_array_equal(_number_triples(np.eye(3)[None], ""), 0.0)


@pytest.mark.parametrize("home", [(0.3, -0.2, 0.4), (3.1, 0.2, -3.1)])
def test_nearest_lists_are_chosen_about_home(home):
    """The chosen lists give rotations near one home, also if angles wrap at half a turn, whichever list is first."""
    rng = np.random.default_rng(0)
    near = Rotation.from_rotvec(0.5 * rng.standard_normal((30, 3))) * Rotation.from_euler("xyz", home)
    far = Rotation.random(30, random_state=rng)
    second = rng.random(30) < 0.5
    both = np.stack([near.as_matrix(), far.as_matrix()], axis=1)
    both[second] = both[second, ::-1]
    chosen = _choose_nearest(np.zeros((30, 2, 3)), both)
    assert np.count_nonzero(chosen != second) <= 2  # some of the wrong ones are near by chance


def test_far_rotations_are_reinterpreted_by_rotation_distance():
    """Roll, pitch and yaw read as a rotation vector are undone by near rotations; near number lists would mislead."""
    rng = np.random.default_rng(3)
    turns = Rotation.random(random_state=rng) * Rotation.from_rotvec(0.6 * rng.standard_normal((40, 3)))
    read = Rotation.from_rotvec(turns.as_euler("xyz"))
    back = _reinterpret_rotations("xyz", "", _choose_nearest)(SE3(read.as_matrix(), np.zeros((40, 3))))
    off = (Rotation.from_matrix(back.rotation) * turns.inv()).magnitude()
    assert np.count_nonzero(off > 1e-6) <= 2


def test_shorter_list_has_smaller_sum_of_squares():
    """The shorter list of each rotation has the smaller sum of squares."""
    numbers = np.array([[[1.0, 1, 1], [0, 0, 1.5]], [[0, 0, 1], [1, 1, 1]]])
    np.testing.assert_array_equal(_choose_shorter(numbers, np.zeros((2, 2, 3, 3))), [1, 0])


@pytest.mark.parametrize(("samples", "shifts"), [(9, []), (12, [3]), (20, [3, 4, 5]), (60, [3, 4, 5, 6])])
def test_order_hypotheses_shift_up_to_six_samples(samples, shifts):
    """Streams are shifted by up to six samples both ways, by less than a third of the recording.

    Each hypothesis depends on the order of all samples.
    """
    for stream, who in ((None, "what the cameras saw"), ("hand", "what hand recorded")):
        turned, *others = _order_hypotheses([stream], samples)
        by_name = others[: 2 * (samples > 10)]
        assert all("sorted as text" in each.words for each in by_name)
        shifted = others[len(by_name) :]
        assert turned.words == f"{who} is in reverse order"
        assert turned.about == (() if stream is None else ("hand",))
        words = [f"{who} belongs {by} samples {way}" for by in shifts for way in ("later", "earlier")]
        assert [h.words for h in shifted] == words
        assert all(h.depends_on_order and not h.is_wider for h in (turned, *shifted))


@pytest.mark.parametrize(("turn_rad", "small"), [(0.109, True), (0.110, False)])
def test_angle_unit_needs_small_rotations(turn_rad, small):
    """Rotations read as degrees that may be radians are at most 0.1097 rad: three angles of half a turn each."""
    turns = [[0.0, turn_rad, 0.0]] * 19 + [[0.0, 0.0, 0.0]]
    recording = with_robots(MADE.recording, {"hand": lambda poses: SE3.from_rotvec(turns, poses.translation)})
    reading = declared(MADE.cell, recording)
    assert _largest_rotation_rad(reading.tracks["hand"]) == pytest.approx(turn_rad)
    found = [h.about for h in rare_hypotheses(reading) if h.code == "angle-unit"]
    assert found == ([("hand",)] * 2 if small else [])


def test_free_mean_is_not_stated_transform():
    """The mean of a free transform is only an initial value, so no inversion hypothesis is made of it."""
    known = simulate(Scenario(samples=2, base="fixed", camera_mount="fixed", target_mount="fixed"), 1).cell
    ((name, base),) = known.bases.items()
    cell = replace(known, bases={name: Unknown("free", base.mean)})
    assert {h.about[0] for h in rare_hypotheses(declared(cell, MADE.recording)) if h.code == "transform-inverted"} == {
        known.mount_name("wrist"), known.mount_name("board"),
    }  # fmt: skip


@pytest.mark.parametrize("first", [0, 1])
def test_rows_sorted_as_text_are_reordered(first):
    """Rows sorted as text (1, 10, 11, 12, 2) are restored by the hypothesis that names this order."""
    made = simulate(Scenario(samples=13), 3)
    order = [int(text) - first for text in sorted(map(str, range(first, first + 13)))]
    samples = made.recording.samples
    mixed = tuple(
        replace(s, robots={**s.robots, "hand": samples[k].robots["hand"]}) for s, k in zip(samples, order, strict=True)
    )
    known = rare_hypotheses(declared(made.cell, made.recording))
    words = f"what hand recorded is sorted as text: {'0, 1, 10, 11' if first == 0 else '1, 10, 11, 12'}"
    (hypothesis,) = (each for each in known if each.words == words)
    found = hypothesis.reread(declared(made.cell, replace(made.recording, samples=mixed)))
    expected = [sample.robots["hand"].base_from_flange.matrix for sample in samples]
    np.testing.assert_array_equal(found.tracks["hand"].pose.matrix, expected)


@pytest.mark.parametrize(
    ("words", "read"),
    [
        ("x and y exchanged", [[0, 1, 0], [1, 0, 0], [0, 0, 1]]),
        ("x and z exchanged", [[0, 0, 1], [0, 1, 0], [1, 0, 0]]),
        ("y and z exchanged", [[1, 0, 0], [0, 0, 1], [0, 1, 0]]),
        ("x with the wrong sign", [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        ("y with the wrong sign", [[1, 0, 0], [0, -1, 0], [0, 0, 1]]),
        ("z with the wrong sign", [[1, 0, 0], [0, 1, 0], [0, 0, -1]]),
    ],
)
def test_position_axes_are_undone(words, read):
    """Exchanged axes and wrong signs of positions are undone, and rotations stay."""
    swapped = with_robots(MADE.recording, {"hand": lambda p: SE3(p.rotation, p.translation @ np.array(read))})
    known = [h for h in hypotheses(MADE, "position-axes") if h.about == ("hand",)]
    (hypothesis,) = (each for each in known if words in each.words)
    track = hypothesis.reread(declared(MADE.cell, swapped)).tracks["hand"]
    expected = declared(MADE.cell, MADE.recording).tracks["hand"].pose.matrix
    np.testing.assert_array_equal(track.pose.matrix, expected)


def track(*stand):
    """A track of a robot at these stops; -1 for a sample without its state."""
    stand = np.array(stand)
    return Track(stand >= 0, SE3.identity((len(stand),)), None, stand, True)


@pytest.mark.parametrize(
    ("stand", "runs"),
    [
        ([0] * 4 + list(range(1, 9)), []),
        ([0] * 5 + list(range(1, 9)), [range(5)]),
        (list(range(1, 9)) + [0] * 5, [range(8, 13)]),
        ([0] * 5 + [1] * 5, [range(5), range(5, 10)]),
        ([0] * 12, []),
        ([-1] * 6 + [0] * 6, [range(6, 12)]),
        ([0] * 5 + list(range(1, 56)), []),
        ([0] * 6 + list(range(1, 55)), [range(6)]),
    ],
)
def test_sessions_at_rest_are_runs_of_one_stop(stand, runs):
    """A session at rest is a run of one stop with at least five samples and a tenth of all, but not all.

    Runs contain sample numbers.
    """
    order = 100 + np.arange(len(stand))
    assert [run.tolist() for run in _still_runs(order, track(*stand))] == [[100 + k for k in run] for run in runs]


def test_target_on_world_is_moved_to_arm():
    """A target on the world moved to its arm gives the views and ends of a cell that states that arm."""
    stated_cell = replace(MADE.cell, targets={n: replace(t, on="world") for n, t in MADE.cell.targets.items()})
    read = declared(stated_cell, MADE.recording)
    (hypothesis,) = (h for h in rare_hypotheses(read) if h.code == "wrong-carrier")
    assert hypothesis.words == "board is on hand, not on world"
    found, expected = hypothesis.reread(read).problem, declared(MADE.cell, MADE.recording).problem
    assert found.columns == expected.columns
    np.testing.assert_array_equal(
        found.groups[0].hand.base_from_flange.matrix, expected.groups[0].hand.base_from_flange.matrix
    )


def test_target_is_not_on_carrier_of_its_camera():
    """With two cameras, no target is proposed on an arm that carries a camera which sees it."""
    made = simulate(Scenario(samples=8, layout="two_cameras"), 1)
    assert not hypotheses(made, "wrong-carrier")


def test_inches_read_as_millimetres_are_undone():
    """Poses that are 25.4 times too small are undone."""
    small = with_robots(MADE.recording, {"hand": lambda p: SE3(p.rotation, p.translation / 25.4)})
    found = [h for h in hypotheses(MADE, "length-unit") if h.about == ("hand",) and "millimetres" in h.words]
    (track,) = (h.reread(declared(MADE.cell, small)).tracks["hand"] for h in found)
    expected = declared(MADE.cell, MADE.recording).tracks["hand"].pose.matrix
    np.testing.assert_allclose(track.pose.matrix, expected, atol=1e-12)
