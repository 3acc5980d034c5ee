"""Tests of the finding `reflection`: other spots beside an LED."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.shared.stages import without_stages

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.reflection import reflection
from basecal.accuracy.stages.solving import screen_conventions
from basecal.cell import CandidateObservation, PixelObservation
from basecal.simulation import Scenario, simulate

SAMPLES = 14

no_conventions = without_stages(screen_conventions)


@pytest.fixture(scope="module")
def made():
    return simulate(Scenario(target="led", camera_mount="fixed", target_mount="fixed", samples=SAMPLES), 2)


def with_spots(made, beside):
    """The recording with other spots at `beside`, by sample [px] from the LED."""
    samples = []
    for sample in made.recording.samples:
        (seen,) = sample.observations
        assert isinstance(seen, PixelObservation)
        if sample.sample in beside:
            spots = np.vstack([seen.pixels, seen.pixels + beside[sample.sample]])
            seen = CandidateObservation(seen.camera, seen.target, spots[::-1], np.full(2, 0.2))
        samples.append(replace(sample, observations=(seen,)))
    return replace(made.recording, samples=tuple(samples))


def find_reflections(made, beside):
    findings = calibrate(made.cell, with_spots(made, beside)).findings
    return [finding for finding in findings if finding.code == "reflection"]


@pytest.mark.journey
def test_spots_beside_led_are_reported(made):
    """Spots beside an LED are reported with their number and images; the LED is distinguished from them."""
    rng = np.random.default_rng(0)
    beside = {k: rng.uniform(40, 90, 2) for k in range(2, 9)}
    (finding,) = find_reflections(made, beside)
    assert finding.severity == "info"
    assert finding.about == tuple(map(str, beside))
    assert f"in 7 of {SAMPLES} images" in finding.message


@pytest.mark.journey
def test_spots_near_led_are_warning(made):
    """Spots two pixels from the LED are ambiguous and a warning; a tenth of the images is tolerated."""
    near = np.array([1.6, 1.2])
    for count, severity in ((1, "info"), (2, "warning")):
        (finding,) = find_reflections(made, dict.fromkeys(range(count), near))
        assert finding.severity == severity
    assert "In 2 images both are near the predicted position" in finding.message


@pytest.mark.journey
def test_single_spots_give_no_finding(made, evidence):
    """Without other spots, or without cameras, there is no finding."""
    assert find_reflections(made, {}) == []
    assert reflection(evidence()) == []


@pytest.mark.journey
@pytest.mark.parametrize(("off_px", "severity"), [((0.5, 0.4), None), ((1.2, 0.9), "warning"), ((2.6, 2.8), "info")])
def test_spots_between_one_and_three_pixels_are_ambiguous(made, off_px, severity):
    """Spots within a pixel are one, beyond three they are distinct; between them they are ambiguous."""
    assert [f.severity for f in find_reflections(made, dict.fromkeys(range(4), np.array(off_px)))] == (
        [severity] if severity else []
    )
