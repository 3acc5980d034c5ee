"""What the local page draws."""

from __future__ import annotations

import xml.etree.ElementTree as tree

import numpy as np

from basecal.acquisition.watching import Sigma, Snapshot
from basecal.reporting.live.drawings import picture_drawing, progress_figure


def test_the_error_is_drawn_beside_its_tolerance():
    """Else the sigma of the base; one point is no line."""
    sigmas = tuple(Sigma(k, 2e-3 / k, 1e-3) for k in range(1, 6))
    assert progress_figure(Snapshot(sigmas=sigmas[:1])) is None
    assert "2.0 mm with 1, 0.40 mm with 5 samples." in progress_figure(Snapshot(sigmas=sigmas)).caption
    task = progress_figure(Snapshot(sigmas=sigmas, errors=((4, 1e-3), (5, 8e-4)), tolerance_m=5e-4))
    assert "1.0 mm with 4, 0.80 mm with 5 samples. Dashed: the tolerance, 0.5 mm." in task.caption
    assert task.svg.count('class="level"') == 1


def test_points_stand_on_the_picture():
    """A dot each, in the pixels of the drawing."""
    root = tree.fromstring(picture_drawing("data:,", (1280, 960), np.array([[99.5, 199.5], [3.5, 4.5]]), "wrist"))
    assert root.get("viewBox") == "0 0 400 300"
    assert root.find("path").get("d") == "M31.2 62.5h0M1.2 1.6h0"
