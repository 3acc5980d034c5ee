"""Tests of simulated recordings of an LED shifted in front of a still camera."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry import SE3, Camera
from basecal.simulation.shifts import shift_directions, simulate_shifts

LENS = Camera("pinhole", np.array([900.0, 905.0, 639.5, 359.5]), (1280, 720))
EYE_FROM_HAND = SE3.from_rotvec([0.1, -0.2, 2.0], [0.9, 0.3, 0.1])
EYE_FROM_CAMERA = SE3.stack([SE3.from_rotvec([0.0, 0.1 * k, 0.0], [0.2, 0.1, 0.3]) for k in range(2)])


def record_shifts(**options):
    camera_from_led = SE3.from_rotvec([0.3, 0.2, 0.1], [0.05, -0.04, 0.8])
    light = EYE_FROM_HAND.inverse() @ EYE_FROM_CAMERA @ camera_from_led
    return simulate_shifts(EYE_FROM_HAND, EYE_FROM_CAMERA, light, LENS, 0.05, **options)


@pytest.mark.parametrize(("two_sided", "count"), [(False, 4), (True, 7)])
def test_shift_directions_are_the_axes(two_sided, count):
    """The origin is followed by a shift along each axis, in one or both directions."""
    directions = shift_directions(two_sided)
    assert directions.shape == (count, 3)
    assert not directions[0].any()
    np.testing.assert_array_equal(directions[1:4], np.eye(3))
    np.testing.assert_array_equal(directions[4:], -np.eye(3)[: count - 4])


def test_led_shifts_along_its_own_axes():
    """At both stations the flange shifts by 0.05 m without rotation, and pixels are those of the true transforms."""
    simulated = record_shifts()
    samples = simulated.recording.samples
    assert len(samples) == 8
    for k, sample in enumerate(samples):
        first = samples[4 * (k // 4)].robots["hand"].base_from_flange
        hand, eye = (sample.robots[name].base_from_flange for name in ("hand", "eye"))
        moved = first.inverse() @ hand
        np.testing.assert_allclose(moved.translation, 0.05 * shift_directions(False)[k % 4], atol=1e-12)
        np.testing.assert_allclose(moved.rotation, np.eye(3), atol=1e-12)
        np.testing.assert_array_equal(eye.matrix, EYE_FROM_CAMERA[k // 4].matrix)
        led_in_camera = (eye.inverse() @ EYE_FROM_HAND @ hand).translation
        np.testing.assert_allclose(sample.observations[0].pixels[0], LENS.project(led_in_camera), atol=1e-9)


def test_only_the_base_is_free():
    """Mounts are fixed to the identity, and only the base is free. The truth and the true robot poses are kept."""
    simulated = record_shifts()
    assert simulated.cell.bases["hand"].status == "free"
    assert simulated.cell.cameras["camera"].mount.status == simulated.cell.targets["light"].mount.status == "fixed"
    assert simulated.truth["eye_base_from_hand_base"] is EYE_FROM_HAND
    np.testing.assert_array_equal(simulated.truth["hand_flange_from_light"].matrix, np.eye(4))
    assert len(simulated.true_base_from_flange["hand"]) == 8


def test_pixel_noise_has_sigma_and_seed():
    """The cell states the noise if there is any, and one seed gives the same pixels again."""
    exact, noisy, again = (
        record_shifts(is_two_sided=True),
        *(record_shifts(is_two_sided=True, pixel_px=0.5, seed=3) for _ in range(2)),
    )
    assert exact.cell.pixel_px is None
    assert noisy.cell.pixel_px == 0.5
    off = [
        a.observations[0].pixels - b.observations[0].pixels
        for a, b in zip(noisy.recording.samples, exact.recording.samples, strict=True)
    ]
    assert np.std(off) == pytest.approx(0.5, rel=0.5)
    for a, b in zip(noisy.recording.samples, again.recording.samples, strict=True):
        np.testing.assert_array_equal(a.observations[0].pixels, b.observations[0].pixels)
