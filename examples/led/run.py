"""A single light on one arm, seen by a camera on the other: from rendered images to the base, beside the truth.

    python examples/led/run.py [FOLDER]

Each sample has an image with the light on and one with it off. Both mounts are unknown: the camera's on its flange and
the light's on the other.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import basecal
from basecal.simulation.images import render_recording

BASE = "eye_base_from_hand_base"


def main(folder: Path, samples: int = 40) -> float:
    """Calibrate a simulated cell from its images; the base's error in its own squared sigmas, 6 on average."""
    made = basecal.simulate(basecal.Scenario(samples=samples, target="led", state_pixel_noise=False), seed=2)
    images = render_recording(made, folder, seed=2)
    recording = basecal.detect(made.cell, images)
    calibration = basecal.calibrate(made.cell, recording)
    print(basecal.text_report(made.cell, calibration))
    estimate = calibration[BASE]
    error = (estimate.mean.inverse() @ made.truth[BASE]).log()
    length, angle = 1e3 * np.linalg.norm(error[:3]), np.degrees(np.linalg.norm(error[3:]))
    print(f"\n{BASE}: true error {length:.3f} mm, {angle:.4f} deg")
    return float(error @ np.linalg.solve(estimate.covariance, error))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(scratch))
