"""Tests that apply to every registered effect: each aspect is implemented or declared absent with a reason."""

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
def test_each_aspect_is_implemented_or_declared_absent(name):
    """No aspect is both implemented and declared absent, and a reason for absence is a phrase."""
    effect = EFFECTS[name]
    assert effect.name == name
    missing, twice = set(get_args(Face)) - effect.faces - effect.absent.keys(), effect.faces & effect.absent.keys()
    assert not missing, f"give {name} these faces, or say under `absent` why it lacks them: {sorted(missing)}"
    assert not twice, f"{name} has these faces, and says that it lacks them: {sorted(twice)}"
    assert effect.absent.keys() <= set(get_args(Face))
    assert all(len(reason.split()) >= 4 for reason in effect.absent.values())


@pytest.mark.parametrize("name", EFFECTS)
def test_aspects_elsewhere_name_existing_module(name):
    """The first word of each reference is an importable module."""
    for where in EFFECTS[name].elsewhere.values():
        importlib.import_module(re.split("[: ]", where)[0])


@pytest.mark.parametrize("name", EFFECTS)
def test_detectable_effects_have_messages(name):
    """Every effect with score-test candidates has a message, and no other has."""
    assert (EFFECTS[name].candidates is None) == (EFFECTS[name].words is None), "candidates and words go together"


def found_effect(about, size, sigma, is_camera=False, unit="", joint=None):
    """Return a detected effect whose size has equal sigma in all its directions."""
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
def test_effect_message_states_size(name, found, what):
    """The message states the device, size, unit and fix; those of clocks and joints also state the direction."""
    words = EFFECTS[name].words(found)
    assert words.what == what
    assert words.do


def test_simulated_faults_have_unique_names():
    """A fault is drawn in proportion to its size: twice the size gives twice the values."""
    faults = [effect.fault for effect in EFFECTS.values() if effect.fault is not None]
    assert len({fault.name for fault in faults}) == len(faults)
    for name, effect in EFFECTS.items():
        assert (effect.fault is not None and effect.fault.draw is not None) == (name in ROBOT_PARAMETERS)
        assert (effect.fault is not None and effect.fault.true_lens is not None) == (name in LENS_PARAMETERS)
    for draw in (fault.draw for fault in faults if fault.draw is not None):
        one, two = (draw(size, 6, np.random.default_rng(0)) for size in (1.0, 2.0))
        np.testing.assert_allclose(two, 2 * one)


@pytest.mark.parametrize("joints", [False, True])
def test_candidates_move_all_views(joints):
    """Each kind of candidate has moves of shape (n, b, 6, q), with b as many as are named."""
    views, found = views_of(Scenario(samples=12, joints=joints)), 0
    for effect in EFFECTS.values():
        for kind in () if effect.candidates is None else effect.candidates(views):
            assert kind.moves[0].shape == (12, len(kind.about), 6, kind.sizes)
            assert len(kind.since) == len(kind.about)
            found += 1
    assert found > 5


LENS = Camera("pinhole", np.array([900.0, 910.0, 640.0, 360.0, -0.1, 0.05, 0.0, 0.0, 0.0]), (1280, 720))


@pytest.mark.parametrize("name", LENS_PARAMETERS)
def test_drawn_lens_error_has_requested_size(name):
    """Only the part's own parameters change, and the message gives the size in the fault's unit."""
    part, fault = LENS_PARAMETERS[name], EFFECTS[name].fault
    true = fault.true_lens(2 * fault.scale, LENS)
    changed = np.flatnonzero(true.parameters != LENS.parameters)
    assert set(changed) <= set(np.arange(9)[part.indices])
    words = part.words(LENS, true, np.full(9, 1e-3))
    shown = {"focal_length": "-2.0000", "principal_point": "-1.4142", "distortion": "2.0 px"}[name]
    assert shown in words
    assert part.typical_sigmas(LENS).shape == np.arange(9)[part.indices].shape


def test_lens_parts_cover_all_parameters():
    """The parts are in the lens's order and include every parameter once."""
    places = np.concatenate([np.arange(9)[part.indices] for part in LENS_PARAMETERS.values()])
    np.testing.assert_array_equal(places, np.arange(9))


@pytest.mark.parametrize("name", RANDOM_EFFECTS)
def test_random_effects_have_documented_expected_sizes(name):
    """Expected sizes have a source or are marked as assumed, with a factor for their range.

    The report's fields can be filled in.
    """
    effect = RANDOM_EFFECTS[name]
    assert {field for _, field, _, _ in Formatter().parse(effect.report) if field} <= effect.figures.keys()
    assert effect.expected.turn[0] > 0
    assert effect.expected.turn[1] > 1
    assert re.search(r"assumed|\d{4}", effect.expected.source)
    assert sum(of is not None for of in (effect.by_joints, effect.by_poses, effect.by_times)) == 1


@pytest.mark.parametrize("name", [name for name, each in RANDOM_EFFECTS.items() if each.likely is not None])
def test_likely_random_effect_has_message(name):
    """The message names the robots, the size and an entry of cell.yaml."""
    words = RANDOM_EFFECTS[name].likely(SIGMAS)
    assert "eye and hand" in words.what
    assert "0.11 deg" in words.what
    assert f"`{name}: {{status: " in words.do[0]


def flange(kind, values):
    true = JOINTS + kind.shift(ARM, kind.stated(), JOINTS, values)
    return kind.move_chain(ARM, values).forward(true)


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_zero_parameters_leave_robot_unchanged(name):
    """No flange moves for zero values, and unstated parameters are fixed."""
    kind = ROBOT_PARAMETERS[name]
    np.testing.assert_array_equal(flange(kind, kind.zero(6)).matrix, ARM.forward(JOINTS).matrix)
    assert kind.stated().status == "fixed"


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_parameter_derivative_matches_flange_motion(name):
    """The derivative to each value equals the numerical one at nonzero values."""
    kind = ROBOT_PARAMETERS[name]
    values = 0.1 * kind.scale * np.random.default_rng(1).standard_normal(kind.zero(6).shape)
    true, moved = JOINTS + kind.shift(ARM, kind.stated(), JOINTS, values), kind.move_chain(ARM, values)
    at = Posture(ARM, JOINTS, moved.posture(true))
    before = flange(kind, values).inverse()

    def after(step):
        return (before @ flange(kind, values + kind.scale * step.reshape(values.shape))).log()

    check_derivative(after, kind.scale * kind.derivative(at, kind.stated(), values))


@pytest.mark.parametrize("name", ROBOT_PARAMETERS)
def test_robot_parameters_round_trip_and_report(name):
    """The report has a heading with the robot's name and a line per value.

    The calibration's fields give the values back.
    """
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
def test_unobservable_joint_values_are_explained(name):
    """Parameters by joint explain unobservable joints; others are left out as a whole."""
    kind = ROBOT_PARAMETERS[name]
    assert (kind.unobserved is not None) == kind.is_by_joint
    if kind.unobserved is not None:
        assert "joint 2 (b)" in kind.unobserved(Unobserved("joint 2 (b)", (1,), 6, "eye_base", True))


def test_effects_are_grouped_by_dependence():
    """The groups are fields of position, changes of frames in time, and sizes that every covariance includes."""
    assert set(BY_PLACE) == {"length_scale", "bending", "stretch"}
    assert set(CHANGES_IN_TIME) == {"step", "drift"}
    assert set(CONTAINED) == {"mount_bend", "mount_play", "lens_sag"}
    for name in (*BY_PLACE, *CHANGES_IN_TIME, *CONTAINED):
        assert EFFECTS[name].candidates is not None


def test_joint_offsets_and_links_are_always_modelled():
    """Offsets and links are certain and drawn on maps; an estimated parameter replaces its own random effect."""
    for name, effect in RANDOM_EFFECTS.items():
        assert effect.is_certain == effect.is_mapped == (name in {"joint_offsets", "link_parameters"}), name
        assert (name in effect.replaced_by) == (name in ROBOT_PARAMETERS)
        assert set(effect.replaced_by) <= ROBOT_PARAMETERS.keys()


def test_only_contained_effects_have_largest_sigma():
    """The largest sigma of a contained effect is that of the prior, at most three standard deviations."""
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
    """Default sizes of faults are in SI units or in pixels."""
    (fault,) = (each.fault for each in EFFECTS.values() if each.fault is not None and each.fault.name == name)
    assert fault.scale * fault.default_size == pytest.approx(usual)


def test_drawn_joint_faults_have_requested_size():
    """Compliances are drawn by the load of 50 Nm from half to 1.5 times the size.

    Links have a sigma per axis with 1 mrad per mm.
    """
    rng = np.random.default_rng(0)
    compliance = EFFECTS["deflection"].fault.draw(0.05, 2000, rng)
    assert 5e-4 <= compliance.min() < 5.1e-4
    assert 1.49e-3 < compliance.max() <= 1.5e-3
    links = EFFECTS["link_parameters"].fault.draw(0.5, 999, rng)
    assert links.shape == (1000, 6)
    np.testing.assert_allclose(links.std(0), 0.5, rtol=0.1)
    np.testing.assert_allclose(links.mean(0), 0, atol=0.06)


def test_indistinguishable_effects_are_reported_together():
    """A fixed transform comes first whatever was detected.

    Later ones continue in lower case, and advice is not repeated.
    """
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
def test_expected_sizes_match_their_source(name, least, most, is_stated):
    """One standard deviation of the prior spans at most the range of the source [rad, m, or a share]."""
    expected = EFFECTS[name].expected
    assert expected.is_stated == is_stated == (name not in CONTAINED)
    assert least * 0.999 <= expected.sigma / expected.factor <= expected.sigma * expected.factor <= most * 1.001
    assert (expected.factor > 2) == (least < most)


@pytest.mark.parametrize(("name", "load"), [("joint_offsets", 1.0), ("gear_ratio", np.pi), ("deflection", 100.0)])
def test_free_parameters_are_observable_below_third_radian(name, load):
    """Free parameters count as observable if their sigma rotates a joint by less than a third of a radian.

    The load is 1 for an offset (its zero), half a turn for a gear ratio, and 100 Nm for a compliance.
    """
    assert 0.25 < ROBOT_PARAMETERS[name].largest_sigma * load < 0.35


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("joint_offsets", np.radians(0.5), "+0.5000 deg"),
        ("gear_ratio", 0.005, "+0.5000 %"),
        ("deflection", 5e-6, "+5.00 urad/Nm"),
    ],
)
def test_joint_values_are_reported_in_their_unit(name, value, shown):
    """Each joint has a line below the heading with its value and sigma in the same unit."""
    found = RobotParameters(("a", "b"), np.array([value, 0.0]), np.array([value, 2 * value]), np.ones(2, dtype=bool))
    heading, first, second = ROBOT_PARAMETERS[name].report("arm", found)
    number, unit = shown.split()
    assert "of arm" in heading
    assert first.split() == ["1", "a", number, unit, "sigma", number[1:], unit]
    assert float(second.split()[5]) == pytest.approx(2 * float(number))


@pytest.mark.parametrize("percent", [0.5, -0.25])
def test_length_errors_are_reported_in_percent(percent):
    """The message says poses are too short or too long, and targets larger or smaller."""
    found = replace(found_effect("hand", [percent / 100], 1e-4), code="length-scale")
    message = EFFECTS["length_scale"].words(found).what
    assert message == f"Poses of hand are {abs(percent):.3f} ± 0.010 % too {'short' if percent > 0 else 'long'}."
    message = EFFECTS["target_size"].words(found).what
    assert message == f"hand is {abs(percent):.3f} ± 0.010 % {'larger' if percent > 0 else 'smaller'} than stated."


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
def test_shared_error_sizes_match_typical_arms(name, least, most, over_stop):
    """The range within one standard deviation is plausible in radians or in sigmas of a stop.

    Levers have the size of an arm.
    """
    prior = RANDOM_EFFECTS[name].expected
    middle, factor = prior.turn
    assert least < middle / factor < middle < middle * factor < most
    assert prior.is_over_stop == over_stop
    lever, spread = prior.lever
    assert lever is None or 0.1 <= lever <= 0.5
    assert 1 < spread <= 3
