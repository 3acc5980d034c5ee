"""Every effect: each face is there or lacks with a reason, and does what faces do."""

from __future__ import annotations

import importlib
import re
from dataclasses import replace
from string import Formatter
from typing import get_args

import numpy as np
import pytest

from basecal.cell import RobotParameters
from basecal.effects.faces.effect import Face, FoundEffect
from basecal.effects.faces.robot_parameter import Posture, Unobserved
from basecal.effects.registry import (
    BY_PLACE,
    CHANGES_IN_TIME,
    CONTAINED,
    EFFECTS,
    LENS_PARAMETERS,
    RANDOM_EFFECTS,
    ROBOT_PARAMETERS,
    describe_effect,
    largest_sigma,
)
from basecal.geometry import Camera
from basecal.simulation import Scenario
from basecal.simulation.arms import six_axis
from derivatives import check_derivative
from made_views import views_of

ARM = six_axis()
JOINTS = np.random.default_rng(0).uniform(-2, 2, (4, 6))
SIGMAS = {"eye": np.array([5e-4, 1e-3]), "hand": np.array([1e-4, 2e-3])}


@pytest.mark.parametrize("name", EFFECTS)
def test_each_face_is_there_or_lacks_with_a_reason(name):
    """Never both, and a reason is a phrase."""
    effect = EFFECTS[name]
    assert effect.name == name
    missing, twice = set(get_args(Face)) - effect.faces - effect.absent.keys(), effect.faces & effect.absent.keys()
    assert not missing, f"give {name} these faces, or say under `absent` why it lacks them: {sorted(missing)}"
    assert not twice, f"{name} has these faces, and says that it lacks them: {sorted(twice)}"
    assert effect.absent.keys() <= set(get_args(Face))
    assert all(len(reason.split()) >= 4 for reason in effect.absent.values())


@pytest.mark.parametrize("name", EFFECTS)
def test_faces_elsewhere_name_a_module(name):
    """The first word is a module that is there."""
    for where in EFFECTS[name].elsewhere.values():
        importlib.import_module(re.split("[: ]", where)[0])


@pytest.mark.parametrize("name", EFFECTS)
def test_what_is_found_has_words(name):
    """An effect that score tests look for is put into words."""
    assert (EFFECTS[name].candidates is None) == (EFFECTS[name].words is None), "candidates and words go together"


def found_effect(about, size, sigma, is_camera=False, unit="", joint=None):
    """An effect that was found with a size whose sigma is equal in all its directions."""
    covariance = sigma**2 * np.eye(len(size))
    return FoundEffect("", "", about, is_camera, False, None, unit, np.array(size), covariance, np.zeros(6), joint)


@pytest.mark.parametrize(("name", "found", "what"), [
    ("bending", found_effect("eye", [3e-3, 4e-3], 1e-4), "eye bends by 5.00 ± 0.10 mrad per metre of reach."),
    ("clock_drift", found_effect("wrist", [-0.012], 1e-3, True), "The clock of wrist drifts: its images fall behind "
     "the other devices by 12.0 ± 1.0 ms from first to last sample."),
    ("clock_drift", found_effect("eye", [-0.012], 1e-3), "The clock of eye drifts: its poses run ahead of "
     "the other devices by 12.0 ± 1.0 ms from first to last sample."),
    ("clock_offset", found_effect("wrist", [-0.03], 2e-3, True, "s"),
     "Images of wrist lag behind the other devices by 30.0 ± 2.0 ms."),
    ("clock_offset", found_effect("wrist", [0.03], 2e-3, True, "s"),
     "Images of wrist run ahead of the other devices by 30.0 ± 2.0 ms."),
    ("clock_offset", found_effect("eye", [0.5], 0.05),
     "Poses of eye lag behind the other devices by 0.500 ± 0.050 samples."),
    ("deflection", found_effect("eye", [3e-5, 0, 0, 4e-5], 1e-6),
     "Joints of eye yield by 25.00 ± 0.50 urad per Nm of the torque of the links' weight."),
    ("drift", found_effect("eye_base", [2e-3, 0, 0, 0, 0, 0], 1e-4),
     "eye_base drifts by 2.00 ± 0.10 mm from the first sample to the last."),
    ("joint_offsets", found_effect("eye", [np.radians(0.5)], np.radians(0.01), joint=3),
     "Joint 4 of eye is off by 0.500 ± 0.010 deg."),
    ("joint_offsets", found_effect("eye", np.radians([0.1, -0.5, 0.2]), np.radians(0.01)),
     "Several joints of eye are off; the clearest is joint 2, by -0.500 ± 0.010 deg."),
])  # fmt: skip
def test_what_is_found_is_told_with_its_number(name, found, what):
    """Whose it is, by how much, in which unit, and what to do; of clocks and joints also which way."""
    words = EFFECTS[name].words(found)
    assert words.what == what
    assert words.do


def test_faults_have_names_of_their_own():
    """Each is drawn of its size: twice the size is twice the values."""
    faults = [effect.fault for effect in EFFECTS.values() if effect.fault is not None]
    assert len({fault.name for fault in faults}) == len(faults)
    for name, effect in EFFECTS.items():
        assert (effect.fault is not None and effect.fault.draw is not None) == (name in ROBOT_PARAMETERS)
        assert (effect.fault is not None and effect.fault.true_lens is not None) == (name in LENS_PARAMETERS)
    for draw in (fault.draw for fault in faults if fault.draw is not None):
        one, two = (draw(size, 6, np.random.default_rng(0)) for size in (1.0, 2.0))
        np.testing.assert_allclose(two, 2 * one)


@pytest.mark.parametrize("joints", [False, True])
def test_candidates_have_moves_for_all_views(joints):
    """Of each kind (n, b, 6, q), as many as are named."""
    views, found = views_of(Scenario(samples=12, joints=joints)), 0
    for effect in EFFECTS.values():
        for kind in () if effect.candidates is None else effect.candidates(views):
            assert kind.moves[0].shape == (12, len(kind.about), 6, kind.sizes)
            assert len(kind.since) == len(kind.about)
            found += 1
    assert found > 5


LENS = Camera("pinhole", np.array([900.0, 910.0, 640.0, 360.0, -0.1, 0.05, 0.0, 0.0, 0.0]), (1280, 720))


@pytest.mark.parametrize("name", LENS_PARAMETERS)
def test_a_lens_that_is_drawn_is_off_by_its_size(name):
    """In its own parameters alone, and the words give that size in the fault's unit."""
    part, fault = LENS_PARAMETERS[name], EFFECTS[name].fault
    true = fault.true_lens(2 * fault.scale, LENS)
    changed = np.flatnonzero(true.parameters != LENS.parameters)
    assert set(changed) <= set(np.arange(9)[part.indices])
    words = part.words(LENS, true, np.full(9, 1e-3))
    shown = {"focal_length": "-2.0000", "principal_point": "-1.4142", "distortion": "2.0 px"}[name]
    assert shown in words
    assert part.typical_sigmas(LENS).shape == np.arange(9)[part.indices].shape


def test_parts_of_a_lens_are_in_its_order():
    """Every parameter is of one of them."""
    places = np.concatenate([np.arange(9)[part.indices] for part in LENS_PARAMETERS.values()])
    np.testing.assert_array_equal(places, np.arange(9))


@pytest.mark.parametrize("name", RANDOM_EFFECTS)
def test_sizes_are_expected_by_a_source(name):
    """Or assumed; a factor spans them, and the words of the report can be filled in."""
    effect = RANDOM_EFFECTS[name]
    assert {field for _, field, _, _ in Formatter().parse(effect.report) if field} <= effect.figures.keys()
    assert effect.expected.turn[0] > 0
    assert effect.expected.turn[1] > 1
    assert re.search(r"assumed|\d{4}", effect.expected.source)
    assert sum(of is not None for of in (effect.by_joints, effect.by_poses, effect.by_times)) == 1


@pytest.mark.parametrize("name", [name for name, each in RANDOM_EFFECTS.items() if each.likely is not None])
def test_what_the_noise_shows_is_put_into_words(name):
    """With the robots, the size and an entry of cell.yaml."""
    words = RANDOM_EFFECTS[name].likely(SIGMAS)
    assert "eye and hand" in words.what
    assert "0.11 deg" in words.what
    assert f"`{name}: {{status: " in words.do[0]


def flange(kind, values):
    true = JOINTS + kind.shift(ARM, kind.stated(), JOINTS, values)
    return kind.move_chain(ARM, values).forward(true)


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_zero_is_the_robot_as_stated(name):
    """Nothing moves, and what was not looked for is stated as fixed."""
    kind = ROBOT_PARAMETERS[name]
    np.testing.assert_array_equal(flange(kind, kind.zero(6)).matrix, ARM.forward(JOINTS).matrix)
    assert kind.stated().status == "fixed"


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_the_derivative_is_that_of_the_flange(name):
    """To each value, at values of some size."""
    kind = ROBOT_PARAMETERS[name]
    values = 0.1 * kind.scale * np.random.default_rng(1).standard_normal(kind.zero(6).shape)
    true, moved = JOINTS + kind.shift(ARM, kind.stated(), JOINTS, values), kind.move_chain(ARM, values)
    at = Posture(ARM, JOINTS, moved.posture(true))
    before = flange(kind, values).inverse()

    def after(step):
        return (before @ flange(kind, values + kind.scale * step.reshape(values.shape))).log()

    check_derivative(after, kind.scale * kind.derivative(at, kind.stated(), values))


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_what_was_found_is_written_read_and_reported(name):
    """A heading with the robot's name and a line at least; the fields of the calibration give it back."""
    kind = ROBOT_PARAMETERS[name]
    values = np.arange(kind.zero(6).size, dtype=float).reshape(kind.zero(6).shape)
    joints = ARM.joint_names if kind.is_by_joint else ()
    covariance = np.eye(values.size) if kind.is_by_joint else None
    found = RobotParameters(joints, values, np.ones(values.shape), np.ones(values.shape, dtype=bool), covariance)
    np.testing.assert_array_equal(kind.from_dict(kind.to_dict({"arm": found}))["arm"].values, values)
    heading, *lines = kind.report("arm", found)
    assert "arm" in heading
    assert len(lines) == len(values)


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_values_by_joint_say_why_they_are_not_seen(name):
    """Others are left out as a whole."""
    kind = ROBOT_PARAMETERS[name]
    assert (kind.unobserved is not None) == kind.is_by_joint
    if kind.unobserved is not None:
        assert "joint 2 (b)" in kind.unobserved(Unobserved("joint 2 (b)", (1,), 6, "eye_base", True))


def test_effects_are_grouped_by_what_they_depend_on():
    """Fields of place, changes of frames in time, and sizes that every answer contains."""
    assert set(BY_PLACE) == {"length_scale", "bending", "stretch"}
    assert set(CHANGES_IN_TIME) == {"step", "drift"}
    assert set(CONTAINED) == {"mount_bend", "mount_play", "lens_sag"}
    for name in (*BY_PLACE, *CHANGES_IN_TIME, *CONTAINED):
        assert EFFECTS[name].candidates is not None


def test_arms_are_never_built_exactly_as_stated():
    """Offsets and links are certain and drawn on maps; an estimated parameter replaces its own random effect."""
    for name, effect in RANDOM_EFFECTS.items():
        assert effect.is_certain == effect.is_mapped == (name in {"joint_offsets", "link_parameters"}), name
        assert (name in effect.replaced_by) == (name in ROBOT_PARAMETERS)
        assert set(effect.replaced_by) <= ROBOT_PARAMETERS.keys()


def test_sizes_that_no_answer_contains_have_no_largest_sigma():
    """Of the others it is that of the prior: three standard deviations at most."""
    for name, effect in EFFECTS.items():
        largest = largest_sigma(name)
        assert np.isfinite(largest) == (name in CONTAINED)
        if name in CONTAINED:
            assert effect.expected.sigma < largest <= effect.expected.sigma * effect.expected.factor**3


@pytest.mark.parametrize(
    ("name", "usual"),
    [
        ("joint-offsets", np.radians(0.2)),
        ("link-errors", 5e-4),
        ("sag", np.radians(0.1)),
        ("gear-ratio", 5e-3),
        ("clock-offset", 0.2),
        ("mount-bend", 1e-3),
        ("mount-play", 5e-4),
        ("focal-length", 1e-2),
        ("principal-point", 5.0),
        ("distortion", 3.0),
        ("following-error", np.radians(0.01)),
    ],
)
def test_faults_have_usual_sizes(name, usual):
    """In the units of SI, or in pixels."""
    (fault,) = (each.fault for each in EFFECTS.values() if each.fault is not None and each.fault.name == name)
    assert fault.scale * fault.default_size == pytest.approx(usual)


def test_what_is_drawn_of_joints_is_as_large_as_its_fault():
    """Compliances by the load of 50 Nm, from half to one and a half times; links by a sigma per axis, 1 mrad a mm."""
    rng = np.random.default_rng(0)
    compliance = EFFECTS["deflection"].fault.draw(0.05, 2000, rng)
    assert 5e-4 <= compliance.min() < 5.1e-4
    assert 1.49e-3 < compliance.max() <= 1.5e-3
    links = EFFECTS["link_parameters"].fault.draw(0.5, 999, rng)
    assert links.shape == (1000, 6)
    np.testing.assert_allclose(links.std(0), 0.5, rtol=0.1)
    np.testing.assert_allclose(links.mean(0), 0, atol=0.06)


def test_effects_that_the_data_do_not_distinguish_are_named_together():
    """A statement comes first, whatever was found; later ones go on in lower case, and advice is said once."""
    found = found_effect("eye", [3e-3, 4e-3], 1e-4)
    bent, late = (
        replace(found, effect="bending"),
        replace(found_effect("wrist", [0.5], 0.1, True), effect="clock_offset"),
    )
    mount = replace(found_effect("eye_mount", [1e-3, 0, 0, 0, 0, 0], 1e-4), effect="fixed_transform")
    assert describe_effect(bent) == EFFECTS["bending"].words(bent)
    words = describe_effect(replace(bent, alternatives=(late, mount)))
    each = [EFFECTS[one.effect].words(one) for one in (mount, bent, late)]
    assert words.code == each[0].code
    assert words.what == ", or ".join([each[0].what[:-1], each[1].what[:-1], "images" + each[2].what[6:-1]]) + "."
    assert list(words.do) == list(dict.fromkeys(line for one in each for line in one.do))
    assert words.why == "The data do not distinguish these."


@pytest.mark.parametrize(
    ("name", "least", "most", "is_stated"),
    [
        ("mount_bend", 1e-4, 1e-3, False),
        ("mount_play", 2e-5, 5e-4, False),
        ("lens_sag", 1e-4, 1e-3, False),
        ("length_scale", 5e-4, 5e-4, True),
        ("target_size", 5e-4, 5e-4, True),
    ],
)
def test_expected_sizes_are_those_of_their_source(name, least, most, is_stated):
    """A standard deviation of the prior spans no more than the range that the source gives [rad, m, or a share]."""
    expected = EFFECTS[name].expected
    assert expected.is_stated == is_stated == (name not in CONTAINED)
    assert least * 0.999 <= expected.sigma / expected.factor <= expected.sigma * expected.factor <= most * 1.001
    assert (expected.factor > 2) == (least < most)


@pytest.mark.parametrize(("name", "load"), [("joint_offsets", 1.0), ("gear_ratio", np.pi), ("deflection", 100.0)])
def test_free_parameters_are_seen_if_they_turn_joints_by_less_than_a_third_of_a_radian(name, load):
    """A zero by itself, a gear by its share of half a turn, and a joint that bears 100 Nm."""
    assert 0.25 < ROBOT_PARAMETERS[name].largest_sigma * load < 0.35


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("joint_offsets", np.radians(0.5), "+0.5000 deg"),
        ("gear_ratio", 0.005, "+0.5000 %"),
        ("deflection", 5e-6, "+5.00 urad/Nm"),
    ],
)
def test_values_of_joints_are_reported_in_their_unit(name, value, shown):
    """With their sigma in the same one, a line a joint below the heading."""
    found = RobotParameters(("a", "b"), np.array([value, 0.0]), np.array([value, 2 * value]), np.ones(2, dtype=bool))
    heading, first, second = ROBOT_PARAMETERS[name].report("arm", found)
    number, unit = shown.split()
    assert "of arm" in heading
    assert first.split() == ["1", "a", number, unit, "sigma", number[1:], unit]
    assert float(second.split()[5]) == pytest.approx(2 * float(number))


@pytest.mark.parametrize("percent", [0.5, -0.25])
def test_lengths_are_told_in_percent(percent):
    """Poses that are too short or too long, targets that are larger or smaller."""
    found = replace(found_effect("hand", [percent / 100], 1e-4), code="length-scale")
    told = EFFECTS["length_scale"].words(found).what
    assert told == f"Poses of hand are {abs(percent):.3f} ± 0.010 % too {'short' if percent > 0 else 'long'}."
    told = EFFECTS["target_size"].words(found).what
    assert told == f"hand is {abs(percent):.3f} ± 0.010 % {'larger' if percent > 0 else 'smaller'} than stated."


@pytest.mark.parametrize(
    ("name", "least", "most", "over_stop"),
    [
        ("joint_offsets", 1e-4, 7e-3, False),
        ("link_parameters", 1e-4, 7e-3, False),
        ("deflection", 1e-4, 7e-3, False),
        ("smooth_by_place", 2e-4, 5e-3, False),
        ("smooth_in_time", 2e-5, 2e-3, False),
        ("smooth", 0.5, 10.0, True),
    ],
)
def test_what_stops_share_is_as_large_as_arms_err(name, least, most, over_stop):
    """Both ends of a standard deviation either way, in radians or in sigmas of a stop; levers are of an arm's size."""
    prior = RANDOM_EFFECTS[name].expected
    middle, factor = prior.turn
    assert least < middle / factor < middle < middle * factor < most
    assert prior.is_over_stop == over_stop
    lever, spread = prior.lever
    assert lever is None or 0.1 <= lever <= 0.5
    assert 1 < spread <= 3
