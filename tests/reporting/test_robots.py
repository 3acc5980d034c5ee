"""Joint offsets, link errors and compliances as text, from a calibration made by hand."""

from __future__ import annotations

import numpy as np

from basecal.cell import Calibration, Cell, Recording, Robot, RobotParameters
from basecal.reporting.page import page
from basecal.reporting.robots import robot_blocks
from basecal.reporting.text import text_report

NAMES = ("pan", "lift", "elbow")


def a_calibration() -> Calibration:
    """Joint 1 known by its prior, 2 by the data, 3 not at all."""
    rad = np.radians([0.0, 0.31, np.nan])
    sigma = np.radians([0.2, 0.02, np.nan])
    seen = np.array([False, True, False])
    compliance = RobotParameters(NAMES, np.array([0.0, 2e-5, np.nan]), np.array([1e-4, 1e-6, np.nan]), seen)
    links = np.zeros((4, 6))
    links[3] = [1e-3, 0, 0, 0, np.radians(0.5), 0]
    return Calibration(
        "good",
        robot_parameters={
            "deflection": {"hand": compliance},
            "joint_offsets": {"hand": RobotParameters(NAMES, rad, sigma, seen)},
            "link_parameters": {"hand": RobotParameters((), links, links, np.ones((4, 6), dtype=bool))},
        },
    )


def test_every_joint_is_told_with_how_it_is_known() -> None:
    """In degrees and urad/Nm with sigmas; what only the prior knows says so, what nothing knows has no number."""
    offsets, links, compliances = (
        [" ".join(line.split()) for line in block] for block in robot_blocks(a_calibration())
    )
    assert offsets == [
        "joint offsets of hand, to be added to its recorded joints",
        "1 pan +0.0000 deg sigma 0.2000 deg prior-dominated",
        "2 lift +0.3100 deg sigma 0.0200 deg",
        "3 elbow unobservable",
    ]
    assert links[-1] == "4 t 1.0000 0.0000 0.0000 mm r 0.0000 0.5000 0.0000 deg"
    assert len(links) == 5
    assert compliances[1:] == [
        "1 pan +0.00 urad/Nm sigma 100.00 urad/Nm prior-dominated",
        "2 lift +20.00 urad/Nm sigma 1.00 urad/Nm",
        "3 elbow unobservable",
    ]


def test_report_and_page_have_them() -> None:
    """The text after the transforms, the page likewise."""
    cell = Cell("eye", {"eye": Robot("eye"), "hand": Robot("hand")})
    for told in (text_report(cell, a_calibration()), _html(cell)):
        assert "joint offsets of hand" in told
        assert "+0.3100 deg" in told


def _html(cell: Cell) -> str:
    return page(cell, Recording(), a_calibration())
