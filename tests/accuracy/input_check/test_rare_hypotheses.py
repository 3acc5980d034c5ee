"""Rare mix-ups are each undone by their hypothesis, and named where nothing usual explains the data."""

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


def reread(hypothesis, recording, robot="hand"):
    """Rotations of a robot as a hypothesis has them."""
    return hypothesis.reread(declared(MADE.cell, recording)).tracks[robot].pose.rotation


def read_as(recording, listed, read):
    """The hand's rotations listed in one way and read in another."""

    def of(poses):
        turned = Rotation.from_matrix(poses.rotation)
        numbers = turned.as_euler(listed) if listed else turned.as_rotvec()
        return SE3((Rotation.from_euler(read, numbers) if read else Rotation.from_rotvec(numbers)).as_matrix(),
                   poses.translation)  # fmt: skip

    return with_robots(recording, {"hand": of})


def test_how_many_there_are():
    """Of each stream the reverse order, two by name and shifts by 3 to 5 both ways; of each subset of arms 43 lists,
    and inches for millimetres and for metres; of the target the world instead of an arm.
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


def test_arms_of_as_many_joints_may_be_exchanged_in_a_session():
    """In each of two sessions, or where they stood still; arms of five and six joints, or of one session, cannot."""
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
        elif kind == "places":  # the hand stands still in the first half, the eye in the second
            eye, hand = (eye, samples[-1].robots["eye"]) if k < 12 else (samples[0].robots["hand"], hand)
        made.append(replace(sample, robots={"eye": eye, "hand": hand}))
    return replace(HALVES.recording, samples=tuple(made))


@pytest.mark.parametrize(("kind", "words"), [
    ("session", "The arms eye and hand are exchanged in samples 12 to 23"),
    ("places", "The places where eye (samples 12 to 23) and hand (samples 0 to 11) stood still are exchanged"),
])  # fmt: skip
def test_arms_exchanged_in_one_session_are_named_and_fixed(kind, words):
    """Of two in which an arm stood still; the fix brings back the poses as they were."""
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
def test_places_exchanged_where_one_session_fits_inverted_poses(tmp_path, monkeypatch):
    """A draw whose longer session fits inverted poses of one arm as well, and whose shorter one does not."""
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
def test_angles_read_in_another_order_are_undone(listed, read, count):
    """By the one hypothesis that says so, also where each order is the other one backwards."""
    mixed = read_as(MADE.recording, listed, read)
    back = [h for h in hypotheses(MADE, "euler-order") if h.about == ("hand",)]
    undone = [h for h in back if np.allclose(reread(h, mixed), rotations(MADE.recording))]
    assert len(undone) == count
    assert all(each.fix.startswith("convert them to rotations as ") for each in undone)


@pytest.mark.parametrize(("listed", "read"), [("", "xyz"), ("", "XYZ"), ("ZYZ", "xyz"), ("xyz", "ZYZ")])
def test_numbers_beyond_a_quarter_turn_read_as_angles_are_undone(listed, read):
    """Of the two lists of angles that give a rotation either may be meant: each is the choice of a hypothesis."""
    mixed = read_as(MADE.recording, listed, read)
    true, right = rotations(MADE.recording), np.zeros(20, dtype=bool)
    for h in hypotheses(MADE, "euler-order"):
        if h.about == ("hand",):
            right |= np.all(np.isclose(reread(h, mixed), true), axis=(1, 2))
    assert right.all()


def test_transposed_matrices_are_undone():
    """Rotations alone; the places stay."""
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
def test_calibrate_names_them(mixed, code, words):
    """Refused, by an error that says what is so; a clean recording knows nothing of it."""
    found = calibrate(MADE.cell, mixed)
    assert found.verdict == "refused"
    assert [f.code for f in found.findings if f.severity == "error"] == [code]
    assert words in found.findings[0].message
    assert calibrate(MADE.cell, MADE.recording).verdict == "good"


@pytest.mark.parametrize("robots", [("hand",), ("eye", "hand")])
def test_radians_read_as_degrees_are_undone(robots):
    """Rolls, pitches and yaws, where no flange turns far from its base's axes; of arms in order there are none."""
    assert hypotheses(MADE, "angle-unit") == []

    def as_degrees(poses):
        return SE3.from_rpy(np.radians(poses.rpy), poses.translation)

    mixed = with_robots(MADE.recording, dict.fromkeys(robots, as_degrees))
    found = [h for h in rare_hypotheses(declared(MADE.cell, mixed)) if h.code == "angle-unit" and h.about == robots]
    assert len(found) == 2
    for robot in robots:
        assert any(np.allclose(reread(each, mixed, robot), rotations(MADE.recording, robot)) for each in found)


def test_what_is_stated_inverted_is_undone():
    """A base and both mounts, where they are stated; nothing is said of what is free."""
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


def test_pixels_are_exchanged():
    """Of every view, and twice is as it was."""
    (swap,) = hypotheses(MADE, "pixels-swapped")
    given = declared(MADE.cell, MADE.recording)
    (before,), (once,) = given.problem.groups, swap.reread(given).problem.groups
    np.testing.assert_array_equal(once.measurement.pixels, before.measurement.pixels[..., ::-1])


@pytest.mark.parametrize("listing", ["xyz", "XYZ", "ZYX", "ZYZ", ""])
def test_two_lists_of_numbers_give_one_rotation(listing):
    """The usual one first; of angles within half a turn, of a rotation vector the other is the long way round."""
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


def test_no_turn_has_a_vector():
    """Of no length, both ways."""
    np.testing.assert_array_equal(_number_triples(np.eye(3)[None], ""), 0.0)


@pytest.mark.parametrize("home", [(0.3, -0.2, 0.4), (3.1, 0.2, -3.1)])
def test_lists_are_chosen_whose_rotations_lie_together(home):
    """About a home, also where angles go round at half a turn, whatever the first of them is."""
    rng = np.random.default_rng(0)
    near = Rotation.from_rotvec(0.5 * rng.standard_normal((30, 3))) * Rotation.from_euler("xyz", home)
    far = Rotation.random(30, random_state=rng)
    second = rng.random(30) < 0.5
    both = np.stack([near.as_matrix(), far.as_matrix()], axis=1)
    both[second] = both[second, ::-1]
    chosen = _choose_nearest(np.zeros((30, 2, 3)), both)
    assert np.count_nonzero(chosen != second) <= 2  # some of the others are near by chance


def test_rotations_that_turn_far_about_their_home_are_relisted():
    """Roll, pitch and yaw read as a rotation vector: lists that are near mislead, rotations that are near do not."""
    rng = np.random.default_rng(3)
    turns = Rotation.random(random_state=rng) * Rotation.from_rotvec(0.6 * rng.standard_normal((40, 3)))
    read = Rotation.from_rotvec(turns.as_euler("xyz"))
    back = _reinterpret_rotations("xyz", "", _choose_nearest)(SE3(read.as_matrix(), np.zeros((40, 3))))
    off = (Rotation.from_matrix(back.rotation) * turns.inv()).magnitude()
    assert np.count_nonzero(off > 1e-6) <= 2


def test_the_shorter_list_has_the_lesser_sum_of_squares():
    """Of each rotation by itself."""
    numbers = np.array([[[1.0, 1, 1], [0, 0, 1.5]], [[0, 0, 1], [1, 1, 1]]])
    np.testing.assert_array_equal(_choose_shorter(numbers, np.zeros((2, 2, 3, 3))), [1, 0])


@pytest.mark.parametrize(("samples", "shifts"), [(9, []), (12, [3]), (20, [3, 4, 5]), (60, [3, 4, 5, 6])])
def test_streams_are_shifted_by_up_to_six_samples(samples, shifts):
    """Both ways, by less than a third of the recording; each goes by the order of all samples."""
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
def test_angles_that_may_be_radians_are_below_two_pi_degrees(turn_rad, small):
    """Three angles of half a turn each, read as degrees, are no longer than that: 0.1097 rad."""
    turns = [[0.0, turn_rad, 0.0]] * 19 + [[0.0, 0.0, 0.0]]
    recording = with_robots(MADE.recording, {"hand": lambda poses: SE3.from_rotvec(turns, poses.translation)})
    reading = declared(MADE.cell, recording)
    assert _largest_rotation_rad(reading.tracks["hand"]) == pytest.approx(turn_rad)
    found = [h.about for h in rare_hypotheses(reading) if h.code == "angle-unit"]
    assert found == ([("hand",)] * 2 if small else [])


def test_a_mean_of_what_is_free_is_not_stated():
    """A value to start from may be anything."""
    known = simulate(Scenario(samples=2, base="fixed", camera_mount="fixed", target_mount="fixed"), 1).cell
    ((name, base),) = known.bases.items()
    cell = replace(known, bases={name: Unknown("free", base.mean)})
    assert {h.about[0] for h in rare_hypotheses(declared(cell, MADE.recording)) if h.code == "transform-inverted"} == {
        known.mount_name("wrist"), known.mount_name("board"),
    }  # fmt: skip


@pytest.mark.parametrize("first", [0, 1])
def test_rows_sorted_as_text_are_put_in_order(first):
    """By the hypothesis that names that order: 1, 10, 11, 12, 2."""
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
def test_axes_of_positions_are_put_right(words, read):
    """Exchanged axes and wrong signs are undone, rotations stay."""
    swapped = with_robots(MADE.recording, {"hand": lambda p: SE3(p.rotation, p.translation @ np.array(read))})
    known = [h for h in hypotheses(MADE, "position-axes") if h.about == ("hand",)]
    (hypothesis,) = (each for each in known if words in each.words)
    track = hypothesis.reread(declared(MADE.cell, swapped)).tracks["hand"]
    expected = declared(MADE.cell, MADE.recording).tracks["hand"].pose.matrix
    np.testing.assert_array_equal(track.pose.matrix, expected)


def track(*stand):
    """A robot at these stops; -1 for a sample without its state."""
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
    """They have five samples and a tenth of all at least, and not all of them; their numbers are the samples'."""
    order = 100 + np.arange(len(stand))
    assert [run.tolist() for run in _still_runs(order, track(*stand))] == [[100 + k for k in run] for run in runs]


def test_a_target_on_the_world_is_put_on_its_arm():
    """The reading with the arm that carries it has the same views and ends as the cell that states that arm."""
    told = replace(MADE.cell, targets={n: replace(t, on="world") for n, t in MADE.cell.targets.items()})
    read = declared(told, MADE.recording)
    (hypothesis,) = (h for h in rare_hypotheses(read) if h.code == "wrong-carrier")
    assert hypothesis.words == "board is on hand, not on world"
    found, expected = hypothesis.reread(read).problem, declared(MADE.cell, MADE.recording).problem
    assert found.columns == expected.columns
    np.testing.assert_array_equal(
        found.groups[0].hand.base_from_flange.matrix, expected.groups[0].hand.base_from_flange.matrix
    )


def test_a_target_is_on_no_carrier_of_a_camera_that_sees_it():
    """Of two cameras, neither of the arms that carry them is proposed."""
    made = simulate(Scenario(samples=8, layout="two_cameras"), 1)
    assert not hypotheses(made, "wrong-carrier")


def test_inches_that_were_read_as_millimetres():
    """Poses that are 25.4 times too small are undone."""
    small = with_robots(MADE.recording, {"hand": lambda p: SE3(p.rotation, p.translation / 25.4)})
    found = [h for h in hypotheses(MADE, "length-unit") if h.about == ("hand",) and "millimetres" in h.words]
    (track,) = (h.reread(declared(MADE.cell, small)).tracks["hand"] for h in found)
    expected = declared(MADE.cell, MADE.recording).tracks["hand"].pose.matrix
    np.testing.assert_allclose(track.pose.matrix, expected, atol=1e-12)
