"""Tests of the text of a report, with calibrations built directly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import (
    Calibration,
    Cell,
    CellCamera,
    CellTarget,
    ErrorMap,
    Finding,
    Outlier,
    Recording,
    Residuals,
    Robot,
    RobotParameters,
    SampleResidual,
    Validation,
)
from basecal.cell.calibration import Certificate, ClockOffset, LineTime, Loop, Rival
from basecal.cell.work_error import BudgetEntry, LocalFit
from basecal.errors import InputError
from basecal.geometry import SE3, Camera, PoseEstimate
from basecal.reporting.page import page
from basecal.reporting.statement.verdict import headline
from basecal.reporting.text import (
    certificate_lines,
    clock_sentences,
    estimate_rows,
    fit_sentences,
    frame_names,
    local_rows,
    noise_sentences,
    outlier_sentences,
    rival_lines,
    robot_blocks,
    task_rows,
    task_sentence,
    text_report,
)

BASE = "eye_base_from_hand_base"


def a_cell(**frames: dict[str, str]) -> Cell:
    robots = {name: Robot(name, frames=frames.get(name, {})) for name in ("eye", "hand")}
    return Cell(
        "eye", robots, cameras={"wrist": CellCamera("wrist", "eye")}, targets={"led": CellTarget("led", "hand")}
    )


def a_calibration() -> Calibration:
    sigmas = np.array([3e-4, 4e-4, 0.0, 3e-3, 0.0, 4e-3])
    base = PoseEstimate(SE3.from_rpy([0.0, 0.0, np.pi / 2], [1.25, -0.5, 0.0]), np.diag(sigmas**2))
    point = PoseEstimate(SE3(np.eye(3), np.array([0.0, 0.0, 0.1])), np.diag([1e-6, 1e-6, 1e-6, 0, 0, 0]))
    return Calibration(
        "good",
        transforms={BASE: base, "hand_flange_from_led": point},
        status={BASE: "free", "hand_flange_from_led": "free"},
        points=frozenset({"hand_flange_from_led"}),
        cameras={"wrist": (Camera("pinhole", np.array([900.0, 901.0, 640.0, 360.0])), np.diag([4.0, 4.0, 1.0, 1.0]))},
        noise={
            "pixel_px": 0.21,
            "robots": {"eye": {"sigma_t_m": [3e-4, 1e-4, 3e-4], "sigma_r_rad": [5e-4, 5e-4, 5e-4]}},
        },
        residuals=Residuals(
            0.2, 0.1, 4e-4, np.radians(0.05), (SampleResidual(3, "wrist", "led", 0.4, 4e-4, np.radians(0.05)),)
        ),
    )


def test_verdict_comes_first() -> None:
    """The first line has the verdict and the accuracy of the requested transform, from the traces of its covariance."""
    first = text_report(a_cell(), a_calibration()).splitlines()[0]
    assert first == f"GOOD: {BASE} to 0.50 mm and 0.29 deg (1 sigma, 3-D norm)."


def test_text_contains_numbers_of_the_calibration() -> None:
    """The text has translation in mm, angles in deg, sigmas per axis, lens, residuals and noise."""
    text = " ".join(text_report(a_cell(), a_calibration()).split())
    for part in (
        "t 1250.00 -500.00 0.00 mm sigma 0.30 0.40 0.00 mm",
        "rpy 0.00 0.00 90.00 deg sigma 0.17 0.00 0.23 deg",
        "fx 900.0 sigma 2.0 px",
        "reprojection error 0.20 px rms per coordinate, median 0.10 px",
        "pose consistency error 0.40 mm and 0.050 deg rms over 1 view",
        "worst view: sample 3 by wrist, 0.40 px rms",
        "measurement noise, 1 sigma per axis: 0.21 px",
        "pose noise of robot eye, 1 sigma per axis: 0.30 0.10 0.30 mm, 0.50 mrad",
    ):
        assert part in text


def test_only_requested_transform_has_snippets() -> None:
    """The base has its URDF and ROS 2 lines; the mount of a point has neither them nor angles."""
    text = text_report(a_cell(), a_calibration())
    assert text.count("<origin xyz=") == text.count("static_transform_publisher") == 1
    led = text[text.index("hand_flange_from_led") :].split("\n\n")[0]
    assert "a point" in led
    assert "rpy" not in led


def test_refusal_states_its_reason() -> None:
    """A refused calibration states the message of the error first, and lists its findings by severity."""
    why = Finding("too-few-samples", "error", ("recording",), "1 sample, at least 3 are needed: record more.")
    aside = Finding("dropped-sample", "info", ("7",), "sample 7 was cut short.")
    text = text_report(a_cell(), Calibration("refused", findings=(aside, why)))
    assert text.splitlines()[0] == f"REFUSED: {why.message}"
    assert text.index("error: too-few-samples [recording]") < text.index("info: dropped-sample [7]")


def test_doubtful_verdict_states_number_and_reason() -> None:
    """A doubtful verdict states the accuracy together with the warning."""
    warning = Finding("intrinsics", "warning", ("wrist",), "the lens moved far from its prior.")
    doubtful = replace(a_calibration(), verdict="doubtful", findings=(warning,))
    assert str(headline(a_cell(), doubtful)) == (
        f"DOUBTFUL: {BASE} to 0.50 mm and 0.29 deg (1 sigma, 3-D norm), but: {warning.message}"
    )


@pytest.mark.parametrize(
    ("frames", "expected"),
    [
        ({}, ("eye_base", "hand_base")),
        ({"eye": {"base": "left_link"}, "hand": {"base": "right_link"}}, ("left_link", "right_link")),
        ({"eye": {"base": "left_link"}}, ("left_link", "hand_base")),
        ({"eye": {"base": "base_link"}, "hand": {"base": "base_link"}}, ("eye_base", "hand_base")),
    ],
)
def test_robot_frame_names_are_used_if_unambiguous(
    frames: dict[str, dict[str, str]], expected: tuple[str, str]
) -> None:
    """The frame names of robots are used if they distinguish parent and child."""
    assert frame_names(a_cell(**frames), BASE) == expected


def test_fixed_transforms_have_no_sigma() -> None:
    """A given transform is printed without sigmas."""
    fixed = replace(a_calibration(), status={BASE: "free", "hand_flange_from_led": "fixed"})
    block = text_report(a_cell(), fixed).split("hand_flange_from_led")[1].split("\n\n")[0]
    assert "sigma" not in block


def test_good_verdict_states_cross_validation_error() -> None:
    """The verdict states the cross-validation error: at the target, or in pixels if there is no pose."""
    at_target = Validation("k-fold", 5, 0.25, 4.1e-4, np.radians(0.052), 1.0)
    good = replace(a_calibration(), validation=at_target)
    assert str(headline(a_cell(), good)) == (
        f"GOOD: {BASE} to 0.50 mm and 0.29 deg (1 sigma, 3-D norm); "
        "cross-validation error, rms: 0.41 mm and 0.052 deg at the target."
    )
    in_pixels = replace(good, validation=Validation("k-fold", 5, 0.25))
    assert str(headline(a_cell(), in_pixels)).endswith("; cross-validation error, rms: 0.25 px.")


def test_verdict_states_cause_before_consequences() -> None:
    """Of several findings the verdict gives the cause, and counts the other findings that matter."""
    follows = Finding("poor-fit", "warning", (), "residuals are large: check units.")
    cause = Finding("outlier-samples", "warning", ("3",), "sample 3 is off: leave it out.")
    aside = Finding("dropped-sample", "info", ("7",), "sample 7 was cut short.")
    doubtful = replace(a_calibration(), verdict="doubtful", findings=(aside, follows, cause))
    assert str(headline(a_cell(), doubtful)).endswith(", but: sample 3 is off: leave it out (and 1 more finding)")
    error = Finding("unobservable-direction", "error", (), "the data do not see any turn of hand_base: move it")
    lost = Finding("not-converged", "error", (), "the iteration ended away from an optimum")
    refused = Calibration("refused", findings=(lost, follows, error))
    assert str(headline(a_cell(), refused)) == f"REFUSED: {error.message} (and 2 more findings)"


def test_text_lists_validation_and_outliers() -> None:
    """The text states held-out errors, the change of the answer in sigmas (the root of its square) and all outliers."""
    left_out = (
        Outlier(3, "wrist", "led", (4, 5), "8 px off", "images/wrist/IMG_4.png"),
        Outlier(7, "wrist", "led", (), "the arm was 12 sigmas off"),
    )
    validation = Validation("k-fold", 5, 0.25, 4.1e-4, np.radians(0.052), 6.25)
    text = text_report(a_cell(), replace(a_calibration(), validation=validation, outliers=left_out))
    for part in (
        "cross-validation error (k-fold, 5 folds), rms: 0.41 mm and 0.052 deg at the target, 0.25 px",
        "fold spread over predicted sigma: 2.50",
        "outlier: sample 3 (IMG_4.png), led by wrist, points 4, 5: 8 px off",
        "outlier: sample 7, led by wrist, the whole view: the arm was 12 sigmas off",
    ):
        assert part in text


def test_worst_view_is_not_an_excluded_view() -> None:
    """An excluded view is neither the worst nor counted; a view without a loop is not counted either."""
    errors = (3, 90.0, 1e-3), (4, 0.7, 1e-3), (5, 0.3, 1e-3), (6, 0.2, None)
    views = tuple(SampleResidual(number, "wrist", "led", rms, loop_m, loop_m) for number, rms, loop_m in errors)
    left_out = (Outlier(3, "wrist", "led", (), "bumped"), Outlier(4, "wrist", "led", (2,), "8 px off"))
    calibration = replace(a_calibration(), residuals=Residuals(0.2, 0.1, 4e-4, 1e-3, views), outliers=left_out)
    text = text_report(a_cell(), calibration)
    assert "worst view: sample 4 by wrist, 0.70 px rms" in text
    assert "rms over 2 views" in text


def test_workspace_errors_are_those_of_the_map() -> None:
    """The text states the smallest and the largest length [mm] of the error map, and its largest angle."""
    errors = ErrorMap(np.zeros((2, 3)), np.array([1e-3, 2.34e-3]), np.radians([0.5, 0.25]))
    text = text_report(a_cell(), replace(a_calibration(), error_map=errors))
    assert "errors of one flange to another are expected below 1.0 to 2.3 mm and 0.50 deg" in " ".join(text.split())


def test_estimate_rows_have_sigmas() -> None:
    """Rows of an estimate have sigmas unless it is fixed; a point has no rotation."""
    estimate = PoseEstimate(SE3.identity(), np.diag([1e-6] * 3 + [1e-4] * 3))
    assert [(row.unit, row.sigmas[0]) for row in estimate_rows(estimate)] == [("mm", "1.0"), ("deg", "0.57")]
    assert [row.unit for row in estimate_rows(estimate, True)] == ["mm"]
    assert [list(row.sigmas) for row in estimate_rows(estimate, False, True)] == [[], []]


def test_missing_validation_is_not_mentioned() -> None:
    """The text does not mention cross-validation or outliers if there are none."""
    text = text_report(a_cell(), a_calibration())
    assert "cross-validation" not in text
    assert "outlier" not in text


def test_swapped_arguments_are_refused() -> None:
    with pytest.raises(InputError, match=r"^cell is of type Calibration, expected Cell$"):
        text_report(a_calibration(), a_cell())  # type: ignore[arg-type]


JOINTS = ("pan", "lift", "elbow")


def with_robots() -> Calibration:
    """Calibration with joint 1 known by its prior, 2 by the data, 3 unknown."""
    rad = np.radians([0.0, 0.31, np.nan])
    sigma = np.radians([0.2, 0.02, np.nan])
    seen = np.array([False, True, False])
    compliance = RobotParameters(JOINTS, np.array([0.0, 2e-5, np.nan]), np.array([1e-4, 1e-6, np.nan]), seen)
    links = np.zeros((4, 6))
    links[3] = [1e-3, 0, 0, 0, np.radians(0.5), 0]
    return Calibration(
        "good",
        robot_parameters={
            "deflection": {"hand": compliance},
            "joint_offsets": {"hand": RobotParameters(JOINTS, rad, sigma, seen)},
            "link_parameters": {"hand": RobotParameters((), links, links, np.ones((4, 6), dtype=bool))},
        },
    )


def test_joint_parameters_state_their_observability() -> None:
    """Joint parameters are in degrees and urad/Nm with sigmas.

    A value that only the prior determines is marked, and an unobservable one has no number.
    """
    offsets, links, compliances = ([" ".join(line.split()) for line in block] for block in robot_blocks(with_robots()))
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


def test_report_and_page_contain_joint_parameters() -> None:
    """The text and the page have the joint offsets; the text states them after the transforms."""
    cell = Cell("eye", {"eye": Robot("eye"), "hand": Robot("hand")})
    for text in (text_report(cell, with_robots()), page(cell, Recording(), with_robots())):
        assert "joint offsets of hand" in text
        assert "+0.3100 deg" in text


def rows(**fields: object) -> list[str]:
    """Lines of the report of a calibration with other fields, with single spaces."""
    return [" ".join(line.split()) for line in text_report(a_cell(), replace(a_calibration(), **fields)).splitlines()]


def test_transform_states_status_and_quaternion() -> None:
    """A fixed transform is not called estimated, and only a point has no quaternion."""
    lines = rows(status={BASE: "fixed", "hand_flange_from_led": "free"})
    assert f"fixed transform {BASE} (fixed): good" in lines
    assert "estimated transform hand_flange_from_led (free, a point): good" in lines
    assert [line for line in lines if line.startswith("q_xyzw")] == [
        "q_xyzw 0.000000000 0.000000000 0.707106781 0.707106781"
    ]


def test_snippets_end_the_block_of_a_transform() -> None:
    """URDF and then ROS 2 are the last lines of the block of a transform."""
    block = text_report(a_cell(), a_calibration()).split("\n\n")[1].splitlines()
    assert block[0].startswith(f"estimated transform {BASE}")
    assert [line.split(":")[0].strip() for line in block[-2:]] == ["URDF", "ROS 2"]


def test_outlier_ids_are_cut_after_ten() -> None:
    """Ten points are all listed; the list of eleven ends with dots."""
    ten, eleven = (Outlier(3, "wrist", "led", tuple(range(count)), "8 px off") for count in (10, 11))
    assert list(outlier_sentences(replace(a_calibration(), outliers=(ten, eleven)))) == [
        "sample 3, led by wrist, points 0, 1, 2, 3, 4, 5, 6, 7, 8, 9: 8 px off",
        "sample 3, led by wrist, points 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, ...: 8 px off",
    ]


def test_loops_are_listed_only_if_several() -> None:
    """Each loop has its path, error and views; a single loop is the rms of all views and is not listed."""
    loops = (Loop(("eye", "wrist", "led"), 7, 1e-3, np.radians(0.1)), Loop(("hand", "led"), 1, 2e-3, np.radians(0.2)))
    calibration = replace(a_calibration(), residuals=Residuals(loops=loops))
    assert list(fit_sentences(calibration)) == [
        "pose consistency error of eye - wrist - led: 1.0 mm and 0.10 deg over 7 views",
        "pose consistency error of hand - led: 2.0 mm and 0.20 deg over 1 view",
    ]
    assert list(fit_sentences(replace(calibration, residuals=Residuals(loops=loops[:1])))) == []


def test_certificate_states_gap_or_reason() -> None:
    proven, unproven = Certificate(2e-9, True), Certificate(None, False, "a dual did not converge")
    lines = [list(certificate_lines(replace(a_calibration(), certificate=each))) for each in (proven, unproven, None)]
    assert lines == [
        ["certificate: global optimum proven; relative duality gap of the rotations 2e-09"],
        ["certificate: not proven: a dual did not converge"],
        [],
    ]


def test_methods_are_compared_by_held_out_errors() -> None:
    """Held-out errors of methods are in mm and deg; a method that lacks one of them failed."""
    rivals = (
        Rival("tsai", 1.5e-3, np.radians(0.25)),
        Rival("no-angle", 1e-3, None),
        Rival("no-length", None, 1e-3),
        Rival("none"),
    )
    assert [" ".join(line.split()) for line in rival_lines(Validation("k-fold", 5, rivals=rivals))] == [
        "tsai 1.500 mm 0.2500 deg, held out",
        "no-angle fails",
        "no-length fails",
        "none fails",
    ]


def test_clock_offsets_and_line_times_have_units() -> None:
    """Clock offsets are in ms and line times in us, with their sigmas; fixed ones have none."""
    calibration = replace(
        a_calibration(),
        clocks={"wrist": ClockOffset(12.5e-3, 0.25e-3), "eye": ClockOffset(-1e-3, 0.0)},
        line_times={"wrist": LineTime(15e-6, 0.5e-6), "top": LineTime(20e-6, 0.0)},
        noise={"clocks": {"wrist": {"jitter_s": 1.5e-3}}},
    )
    assert list(clock_sentences(calibration)) == [
        "clock of wrist: +12.500 ms to be added to its stamps, sigma 0.250 ms",
        "clock of eye: -1.000 ms to be added to its stamps",
        "stamps of wrist jitter by 1.50 ms (1 sigma)",
        "rolling shutter of wrist: 15.000 us a row, sigma 0.500 us",
        "rolling shutter of top: 20.000 us a row",
    ]


def test_cameras_with_different_noise_are_listed() -> None:
    """A single camera without a factor has the overall pixel noise.

    Two cameras are listed, and a factor is always stated.
    """

    def noise(**cameras: dict[str, float]) -> list[str]:
        return list(noise_sentences(replace(a_calibration(), noise={"pixel_px": 0.2, "cameras": cameras})))

    assert noise(wrist={"pixel_px": 0.2}) == ["measurement noise, 1 sigma per axis: 0.20 px"]
    assert noise(wrist={"pixel_px": 0.2}, top={"pixel_px": 0.4})[1:] == [
        "pixel noise of wrist: 0.20 px",
        "pixel noise of top: 0.40 px",
    ]
    assert noise(wrist={"pixel_px": 0.2, "factor": 1.5})[1:] == [
        "pixel noise of wrist: 0.20 px, 1.5 times the sigma stated by its detector"
    ]


def test_missing_pose_sigma_is_omitted() -> None:
    """A sigma that is None, and entries that are no sigma, are omitted."""
    sigmas = {"sigma_t_m": [1e-3] * 3, "sigma_r_rad": None, "stops": 12}
    calibration = replace(a_calibration(), noise={"robots": {"eye": sigmas}})
    assert list(noise_sentences(calibration)) == ["pose noise of robot eye, 1 sigma per axis: 1.0 mm"]


def test_task_error_is_root_sum_of_squares() -> None:
    """Sources of 3 and 4 mm give 5 mm. The sentence has the three largest sources, the rows have all."""
    budget = tuple(
        BudgetEntry(name, rms, share, halved)
        for name, rms, share, halved in (
            ("noise of eye", 4e-3, 0.64, 3.6e-3),
            ("noise of hand", 3e-3, 0.36, 4.3e-3),
            ("pixels", 1e-6, 1e-3, 5e-3),
            ("joints", 1e-7, 1e-4, 5e-3),
        )
    )
    first, *others = task_rows(replace(a_calibration(), budget=budget))
    assert first == (
        "error at the task 5.0 mm rms; shares of its variance: noise of eye 64 %, noise of hand 36 %, pixels 0 %"
    )
    assert len(others) == 4
    assert " ".join(others[0].split()) == "4.0 mm 64.0 % noise of eye; total 3.6 mm if halved"
    assert task_sentence(a_calibration()) == ""


def test_local_calibration_is_compared_with_global() -> None:
    """The better of the local and the global calibration is recommended; the global one if a fit failed."""
    part = LocalFit(np.array([0.1, -0.2, 0.5]), (1, 2, 3), 2e-3, 1e-3, 0.012, True, {})
    place = "about 0.10 -0.20 0.50 m (3 samples): "
    errors = (
        "held-out 1.0 mm by a local calibration, 2.0 mm by the global; p = 0.012 for such a difference by noise alone"
    )
    failed = f"{place}the local calibration failed; use the global one"
    parts = (part, replace(part, is_better=False), replace(part, local_m=None), replace(part, global_m=None))
    assert list(local_rows(replace(a_calibration(), local=parts))) == [
        f"{place}{errors}; use the local one there",
        f"{place}{errors}; use the global one",
        failed,
        failed,
    ]


def test_task_box_with_few_samples_is_reported() -> None:
    """A task box with fewer than 10 samples has a line. Without a box or without local fits there is none."""
    boxed = replace(a_calibration(), local=(), settings={"task_box": [0, 0, 0, 1, 1, 1]})
    (line,) = local_rows(boxed)
    assert line.startswith("in the box: fewer than 10 samples")
    assert list(local_rows(replace(boxed, settings={}))) == []
    assert list(local_rows(replace(boxed, local=None))) == []


def test_findings_list_problem_cause_and_steps() -> None:
    """A finding lists the problem, then the cause, then the steps. Its subjects are in brackets, if they are known."""
    finding = Finding("poor-fit", "warning", ("eye", "wrist"), "Residuals are large.", ("Check units.",), "An error.")
    bare = Finding("overfit", "info", (), "Few samples.")
    assert rows(findings=(bare, finding))[-6:] == [
        "warning: poor-fit [eye, wrist]",
        "Residuals are large.",
        "An error.",
        "- Check units.",
        "info: overfit",
        "Few samples.",
    ]
