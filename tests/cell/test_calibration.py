"""Tests of a calibration's results, found by name."""

from __future__ import annotations

import numpy as np
import pytest

import basecal
from basecal.cell import Calibration, Cell, CellCamera, Rival, Robot, RobotParameters, Unknown, Validation
from basecal.cell.calibration import Finding, HeldGauge, Loop, Residuals
from basecal.cell.files import calibration_from_dict, calibration_to_dict
from basecal.errors import FrameNotFound, InputError
from basecal.geometry import SE3, PoseEstimate
from export_example import CALIBRATION


def test_transforms_are_found_by_name():
    """The error for an unknown transform lists the known ones."""
    estimate = PoseEstimate.exact(SE3.identity())
    calibration = Calibration("good", {"a_from_b": estimate})
    assert calibration["a_from_b"] is estimate
    with pytest.raises(FrameNotFound, match=r"^no None.*there are: a_from_b"):
        calibration[None]
    with pytest.raises(FrameNotFound, match=r"no 'a_from_c' .*there are: a_from_b"):
        calibration["a_from_c"]
    with pytest.raises(KeyError):
        Calibration("refused")["a_from_b"]


def test_robot_parameters_are_listed_by_kind():
    """Parameters of one robot are listed by kind; a robot that was not calibrated has none."""
    offsets = RobotParameters(("a",), np.zeros(1), np.ones(1), np.ones(1, dtype=bool))
    calibration = Calibration("good", robot_parameters={"joint_offsets": {"eye": offsets}, "deflection": {}})
    assert calibration.parameters_of_robot("eye") == {"joint_offsets": offsets}
    assert calibration.parameters_of_robot("hand") == {}


def test_notebook_shows_html_summary():
    """A notebook shows a calibration as its HTML summary."""
    assert CALIBRATION._repr_html_() == basecal.html_summary(CALIBRATION)


def test_known_transforms_are_fixed_or_estimated():
    """Known transforms are the estimated ones, and the fixed ones of the cell.

    Estimates take precedence, and priors and guesses do not count.
    """
    known, guessed, found = (SE3.from_rotvec([0, 0, 0], [x, 0, 0]) for x in (1.0, 2.0, 3.0))
    cell = Cell(
        "eye",
        {"eye": Robot("eye")},
        cameras={
            "first": CellCamera("first", "eye", Unknown("fixed", known)),
            "second": CellCamera("second", "eye", Unknown("prior", guessed, np.ones(6))),
            "third": CellCamera("third", "eye"),
        },
    )
    calibration = Calibration("good", {"eye_flange_from_third": PoseEstimate.exact(found)})
    assert calibration.known_transforms(cell) == {"eye_flange_from_first": known, "eye_flange_from_third": found}


def test_frame_between_refuses_points():
    """A point has no rotation, so neither end of `frame_between` may be one; the message names its transform."""
    of = {name: PoseEstimate.exact(SE3.identity()) for name in ("arm_flange_from_led", "arm_flange_from_wrist")}
    calibration = Calibration("good", of, points=frozenset({"arm_flange_from_led"}))
    message = "'led' is a point and has no rotation: see arm_flange_from_led in calibration.json"
    for ends in (("led", "wrist"), ("wrist", "led")):
        with pytest.raises(InputError) as caught:
            calibration.frame_between(*ends)
        assert str(caught.value) == message
    with pytest.raises(FrameNotFound, match=r"there are: arm_flange, wrist$"):
        calibration.frame_between("wrist", "lamp")
    assert calibration.frame_between("wrist", "arm_flange").mean.translation.tolist() == [0, 0, 0]


def test_file_holds_millimetres_and_degrees() -> None:
    """Errors are written in mm and deg, those of a failed method as null, and read back the same."""
    rivals = (Rival("basecal", 2e-3, 0.01), Rival("OpenCV TSAI"))
    data = calibration_to_dict(Calibration("good", validation=Validation("k-fold", 5, rivals=rivals)))
    assert data["validation"]["rivals"][0]["target_mm"] == 2.0
    assert data["validation"]["rivals"][1] == {"name": "OpenCV TSAI", "target_mm": None, "target_deg": None}
    read = calibration_from_dict(data).validation.rivals
    assert [each.name for each in read] == ["basecal", "OpenCV TSAI"]
    assert abs(read[0].target_rad - 0.01) < 1e-15


def test_gauge_covariance_selects_block_of_transform():
    """A transform gets its own block of the gauge covariance of each robot that moves it.

    An unknown transform gets none.
    """
    moving, still = np.zeros((12, 12)), np.zeros((12, 12))
    moving[6:, 6:] = np.arange(36.0).reshape(6, 6)
    gauges = HeldGauge("eye", ("joint_offsets",), moving), HeldGauge("hand", ("joint_offsets",), still)
    calibration = Calibration("good", order=("a_from_b", "a_from_c"), gauges=gauges)
    (found,) = calibration.gauge_covariances("a_from_c").items()
    assert found[0] == "eye"
    np.testing.assert_array_equal(found[1], moving[6:, 6:])
    assert calibration.gauge_covariances("a_from_b") == calibration.gauge_covariances("a_from_d") == {}


def test_repr_shows_verdict_and_transforms():
    """The `repr` is one line: the verdict, and each transform with its sigmas."""
    estimate = PoseEstimate(
        SE3(np.eye(3), np.array([1.0, 0.0, -0.25])), np.diag([1e-6] * 3 + [np.radians(0.5) ** 2] * 3)
    )
    text = repr(Calibration("good", {"a_from_b": estimate}))
    assert text == "<good calibration: a_from_b [1000, 0, -250] ± [1, 1, 1] mm, [0, 0, 0] ± [0.5, 0.5, 0.5] deg>"
    assert repr(Calibration("refused")) == "<refused calibration: no transform>"


@pytest.mark.parametrize("place", range(3))
def test_each_transform_has_own_gauge_block(place: int) -> None:
    """A transform's block is six rows and columns at its place in the order."""
    names = ("a_from_b", "a_from_c", "a_from_d")
    whole = np.arange(18.0 * 18).reshape(18, 18) + 1
    calibration = Calibration("good", order=names, gauges=(HeldGauge("eye", ("joint_offsets",), whole),))
    block = calibration.gauge_covariances(names[place])["eye"]
    np.testing.assert_array_equal(block, whole[6 * place : 6 * place + 6, 6 * place : 6 * place + 6])


def test_loops_are_written_in_millimetres_and_degrees() -> None:
    """Loops are written in mm and deg and read back the same; a missing number is read as NaN."""
    loops = (Loop(("eye_base", "wrist", "board", "eye_base"), 4, 2e-3, np.radians(0.5)),)
    data = calibration_to_dict(Calibration("good", residuals=Residuals(loops=loops)))
    (written,) = data["residuals"]["loops"]
    assert (written["rms_mm"], written["rms_deg"]) == (pytest.approx(2.0), pytest.approx(0.5))
    (found,) = calibration_from_dict(data).residuals.loops
    assert (found.rms_m, found.rms_rad) == (pytest.approx(2e-3), pytest.approx(np.radians(0.5)))
    written["rms_mm"] = None
    (found,) = calibration_from_dict(data).residuals.loops
    assert np.isnan(found.rms_m)


def test_message_joins_what_why_and_do() -> None:
    """A finding's message joins `what`, `why` and `do`; missing parts leave no blank."""
    assert Finding("poor-fit", "info", (), "What.", ("Do.", "Do more."), "Why.").message == "What. Why. Do. Do more."
    assert Finding("poor-fit", "info", (), "What.").message == "What."
