"""Tests of `quick_look` and `preview_samples`: a few samples show how a recording was read."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.rewriting import inverted, scaled, shifted, with_robots

from basecal.accuracy.input_screening import quick_look as module
from basecal.accuracy.input_screening.quick_look import QuickLook, preview_samples, quick_look
from basecal.cell import Finding, Recording, RobotState, Sample
from basecal.cell.cell import Intrinsics
from basecal.estimation.outliers.left_out import LeftOut
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from stream_cells import streamed


@cache
def made():
    return simulate(Scenario(samples=60), 4)


def codes(recording, is_whole=False):
    return [(f.code, f.severity, f.about) for f in quick_look(made().cell, recording, is_whole).findings]


def test_preview_takes_three_runs_of_samples():
    """The preview takes three runs of six samples, with the first and the last, and robots two samples beside.

    Few samples are all taken.
    """
    taken = preview_samples(made().recording).samples
    assert [s.sample for s in taken if s.observations] == [*range(6), *range(27, 33), *range(54, 60)]
    assert [s.sample for s in taken if s.robots] == [*range(8), *range(25, 35), *range(52, 60)]
    few = Recording(made().recording.samples[:18])
    assert preview_samples(few) is few


@pytest.mark.journey
def test_correct_cell_has_no_finding():
    """A correct cell has no finding, and its error is that of the pixels."""
    look = quick_look(made().cell, preview_samples(made().recording))
    assert (look.views, look.findings, look.undetermined) == (18, (), "")
    assert look.error is not None
    number, unit = look.error.split()
    assert unit == "px"
    assert 0.1 < float(number) < 1.0


@pytest.mark.journey
def test_inverted_poses_are_named():
    """The robot with inverted poses is named."""
    wrong = with_robots(made().recording, {"hand": inverted})
    assert codes(preview_samples(wrong)) == [("robot-pose-inverted", "error", ("hand",))]


@pytest.mark.journey
def test_single_bad_row_is_named():
    """A single bad row is named, all others agree, and no convention is doubted."""
    samples = list(made().recording.samples[:12])
    state = samples[3].robots["hand"]
    far = RobotState(SE3(state.base_from_flange.rotation, state.base_from_flange.translation + 0.3))
    samples[3] = replace(samples[3], robots={**samples[3].robots, "hand": far})
    look = quick_look(made().cell, Recording(tuple(samples)))
    (finding,) = look.findings
    assert (finding.code, finding.severity, finding.about) == ("outlier-samples", "warning", ("3",))
    assert finding.what == "Sample 3 disagrees with all others."
    assert look.error is not None


@pytest.mark.journey
def test_late_images_are_named():
    """Images paired two samples late are named, as the robot states beside the views are taken, too."""
    found = codes(preview_samples(shifted(made().recording, None, -2)))
    assert {code for code, _, _ in found} == {"pairing-shifted"}


def test_units_are_reported_before_solve():
    """Robot poses in millimetres, a thousand times any reach, are reported before the solve."""
    assert codes(with_robots(made().recording, dict.fromkeys(("eye", "hand"), scaled(1e3)))) == [
        ("length-unit", "error", ("eye", "hand"))
    ]


def test_views_count_samples_with_view():
    """Only samples with a view are counted, not neighbours taken for robot states, if a unit error ends the check."""
    wrong = with_robots(made().recording, dict.fromkeys(("eye", "hand"), scaled(1e3)))
    assert quick_look(made().cell, preview_samples(wrong)).views == 18


def test_insufficient_data_is_explained():
    """The message explains why few views, arms without rotation, or poses without views decide nothing."""
    assert quick_look(made().cell, Recording(made().recording.samples[:4])).undetermined.startswith(
        "5 with the robots' poses"
    )
    still = simulate(Scenario(samples=10, target="pose", arms="hand_still"), 4)
    assert "rotate every arm about two axes" in quick_look(still.cell, still.recording).undetermined
    assert quick_look(made().cell, Recording()).views == 0
    board = replace(made().cell.targets["board"], on="eye")
    both_on_one = quick_look(replace(made().cell, targets={"board": board}), made().recording)
    assert (both_on_one.views, bool(both_on_one.undetermined)) == (0, True)


def test_streams_are_previewed():
    """Clocks of streams are estimated first, and all robot lines are kept."""
    made = streamed()
    few = preview_samples(made.recording)
    stamps = [s.stamp_s for s in made.recording.samples if s.observations]
    kept = [s.stamp_s for s in few.samples if s.observations]
    assert len(kept) == 40
    assert (kept[0], kept[-1]) == (stamps[0], stamps[-1])
    assert np.diff(kept).max() < 2.5 * np.diff(stamps).max()
    look = quick_look(made.cell, few)
    assert look.findings == ()
    assert look.error is not None
    assert look.error.endswith("mm/m (mrad)")


def test_streams_with_unknown_lens_are_not_solved():
    """Streams with an unknown lens are not solved, so that an import is faster than a calibration."""
    made = streamed()
    cameras = {n: replace(c, intrinsics=Intrinsics("free")) for n, c in made.cell.cameras.items()}
    look = quick_look(replace(made.cell, cameras=cameras), made.recording)
    assert "basecal calibrate determines" in look.undetermined
    assert look.views == 0


HOPELESS = Finding("poor-fit", "error", (), "Nothing explains it.")


def run_quick_look(
    monkeypatch,
    is_whole=None,
    found_conventions=(),
    hopeless_finding=False,
    fit="good",
    is_plausible=True,
    unobservable=(),
):
    """A quick look at a correct recording with replaced checks and fits."""
    fit = SimpleNamespace(error_in_words=lambda: "0.2 px") if fit == "good" else None
    plain = SimpleNamespace(problem=None, state=None, observability=SimpleNamespace(unobservable=set(unobservable)))
    for name, value in {
        "solve_problem": lambda *_: plain,
        "with_noise": lambda *_: plain,
        "has_plausible_noise": lambda *_: True,
        "check_conventions": lambda *_: found_conventions,
        "is_hopeless": lambda *_: hopeless_finding,
        "hopeless_finding": lambda *_: HOPELESS,
        "solve_robustly": lambda *_: SimpleNamespace(outliers=()),
        "fit_hypothesis": lambda *_: fit,
        "is_plausible": lambda *_: is_plausible,
    }.items():
        monkeypatch.setattr(module, name, value)
    given = made().cell, Recording(made().recording.samples[:6])
    return quick_look(*given) if is_whole is None else quick_look(*given, is_whole)


def test_doubts_are_reported_unless_more_data_follow(monkeypatch):
    """Warnings of a whole recording and errors of any part are reported, infos never."""
    each = {s: Finding("code", s, (), "") for s in ("error", "warning", "info")}
    for is_whole, severities in ((True, ["error", "warning"]), (None, ["error", "warning"]), (False, ["error"])):
        found = run_quick_look(monkeypatch, is_whole, tuple(each.values()))
        assert [f.severity for f in found.findings] == severities
        assert (found.views, found.error, found.undetermined) == (6, None, "")
    assert run_quick_look(monkeypatch, found_conventions=(each["info"],)).error == "0.2 px"
    assert run_quick_look(monkeypatch, False, (each["warning"],)).findings == ()


def test_undetermined_result_states_reason(monkeypatch):
    """The message states the reason: unexplained views, no fit, an open transform, or a fit that predicts badly."""
    assert run_quick_look(monkeypatch, hopeless_finding=True).findings == (HOPELESS,)
    assert (
        run_quick_look(monkeypatch, fit=None).undetermined
        == "the requested transforms are not determined; rotate every arm about two axes or more"
    )
    name = made().cell.requested_transforms[0]
    assert run_quick_look(monkeypatch, unobservable=[name]).undetermined.startswith(
        "as declared the views fit with an error of 0.2 px, but the requested"
    )
    assert run_quick_look(monkeypatch, unobservable=["another"]).error == "0.2 px"
    bad = run_quick_look(monkeypatch, is_plausible=False)
    assert bad.undetermined == "held-out views have an error of 0.2 px, and no other convention reduces it"
    assert bad.error is None


def test_open_joint_offsets_explain_open_base(monkeypatch):
    """Open joint offsets are stated as the reason for an undetermined base, whatever the motion."""
    robots = {n: replace(r, parameters={"joint_offsets": None}) for n, r in made().cell.robots.items()}
    description = module._describe_ambiguity(replace(made().cell, robots=robots), None)
    assert description == "the requested transforms are not determined without the priors of its robots"


@pytest.mark.parametrize(("outliers", "count", "kept"), [(0, 9, 0), (1, 9, 1), (2, 9, 0), (2, 10, 2), (3, 10, 0)])
def test_few_samples_may_disagree(monkeypatch, outliers, count, kept):
    """At most two of ten samples may disagree.

    Left-out points do not make a sample an outlier, and each outlier counts once.
    """
    left_out = [SimpleNamespace(sample=k, ids=()) for k in range(outliers) for _ in range(2)]
    left_out += [SimpleNamespace(sample=k, ids=(1,)) for k in range(count)]
    monkeypatch.setattr(module, "build_problem", lambda *given: (SimpleNamespace(samples=np.arange(count)), ()))
    monkeypatch.setattr(module, "solve_robustly", lambda *given: SimpleNamespace(outliers=left_out))
    assert list(module._find_outliers(None, None)) == list(range(kept))


UNEXPLAINED, OTHER = (Finding(code, "error", (), "No.") for code in (module._UNEXPLAINED, "other"))


@pytest.mark.parametrize(
    ("first", "outliers", "again", "codes"),
    [
        (QuickLook(20, error="1 mm"), [3], QuickLook(19, error="1 mm"), ["first"]),
        (QuickLook(20, (OTHER,)), [3], QuickLook(19, error="1 mm"), ["first"]),
        (QuickLook(3, (UNEXPLAINED,)), [1], QuickLook(2, error="1 mm"), ["first"]),
        (QuickLook(20, (UNEXPLAINED,)), [], QuickLook(20, error="1 mm"), ["first"]),
        (QuickLook(20, (UNEXPLAINED,)), [3], QuickLook(19, undetermined="nothing"), ["first"]),
        (QuickLook(20, (UNEXPLAINED,)), [3, 5], QuickLook(18, error="1 mm"), ["outlier-samples"]),
        (QuickLook(20, (UNEXPLAINED,)), [3], QuickLook(19, (OTHER,)), ["other", "outlier-samples"]),
        (QuickLook(20, undetermined="nothing"), [3], QuickLook(19, error="1 mm"), ["outlier-samples"]),
    ],
)
def test_samples_are_checked_again_without_outliers(monkeypatch, first, outliers, again, codes):
    """Samples are checked again without a few outliers if nothing else is wrong.

    Enough must remain, and the rest be conclusive.
    """
    judged = []
    looks = iter([first, again])
    monkeypatch.setattr(
        module, "_check_samples", lambda cell, recording, is_whole: judged.append(recording.samples) or next(looks)
    )
    left_out = {k: LeftOut(k, "wrist", "board", (), 9.0, 0.01, 0.02) for k in outliers}
    monkeypatch.setattr(module, "_find_outliers", lambda cell, recording: left_out)
    recording = Recording(tuple(map(Sample, range(20))))
    found = module._check_robustly(None, recording, True)
    if codes == ["first"]:
        assert found is first
    else:
        assert [each.code for each in found.findings] == codes
        assert [sample.sample for sample in judged[1]] == [k for k in range(20) if k not in outliers]
        last = found.findings[-1]
        numbers = " and ".join(map(str, outliers))
        verb = "disagrees" if len(outliers) == 1 else "disagree"
        assert last.what.endswith(f"{verb} with all others.")
        assert last.about == tuple(map(str, outliers))
        assert last.why.startswith(f"At sample {numbers.split()[0]}, ")


@pytest.mark.parametrize(("count", "is_whole", "named"), [(4, True, 0), (5, True, 2), (5, False, 0), (4, False, 0)])
def test_unknown_units_are_error_of_whole_recording(monkeypatch, count, is_whole, named):
    """Unknown units are an error of a whole recording with at least five samples.

    Else they explain why no result follows.
    """
    unseen = [Finding("length-unit", "error", (name,), f"{name} is of no unit.") for name in ("a", "b")]
    monkeypatch.setattr(module, "estimate_units", lambda cell, samples: ({}, unseen))
    look = quick_look(made().cell, Recording(made().recording.samples[:count]), is_whole)
    assert (look.views, look.error, look.undetermined) == (count, None, "a is of no unit.")
    assert look.findings == tuple(unseen)[:named]


def test_recording_is_whole_by_default(monkeypatch):
    """A recording is treated as whole by default, also for unknown units."""
    unseen = [Finding("length-unit", "error", (), "No unit.")]
    monkeypatch.setattr(module, "estimate_units", lambda cell, samples: ({}, unseen))
    assert quick_look(made().cell, Recording(made().recording.samples[:6])).findings == tuple(unseen)
