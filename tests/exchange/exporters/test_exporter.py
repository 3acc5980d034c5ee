"""Tests of registered exporters, which give texts of a calibration."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from basecal.errors import FrameNotFound, InputError, RefusedCalibration
from basecal.exchange.controller_poses import PoseFormat, read_controller_poses
from basecal.exchange.exporters.exporter import export, pasteable
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.exports.exporter import ExportOption
from basecal.geometry import SE3, PoseEstimate
from export_example import BASE, CALIBRATION, CELL, INVERSE, POINT, all_poses

OF_TRANSFORMS = [kind for kind, each in EXPORTERS.items() if {*each.options} & {"transform", "urdf"} == {"transform"}]


@pytest.mark.parametrize("kind", EXPORTERS)
def test_every_exporter_declares_its_options(kind):
    """Each exporter states its options; only exporters of transforms give text to paste."""
    assert {*get_args(ExportOption)} >= {*EXPORTERS[kind].options}
    assert "transform" in EXPORTERS[kind].options or not EXPORTERS[kind].is_pasted


@pytest.mark.journey
@pytest.mark.parametrize("kind", OF_TRANSFORMS)
def test_exported_files_state_source_and_verdict(kind):
    """A file states the run, the hash, the codes of findings, and the transform's name."""
    doubtful = replace(CALIBRATION, verdict="doubtful")
    text = export(doubtful, kind, BASE, cell=CELL, run="20260102T030405Z")
    for part in ("20260102T030405Z", "sha256:0123456789ab", "DOUBTFUL: poor-fit", BASE):
        assert part in text
    assert "DOUBTFUL" not in export(CALIBRATION, kind, BASE, cell=CELL)


@pytest.mark.parametrize("kind", EXPORTERS)
def test_refused_calibration_is_not_exported(kind):
    """The error states that the refused calibration is not exported, and there is no text to paste."""
    with pytest.raises(RefusedCalibration, match="nothing of it is exported"):
        export(replace(CALIBRATION, verdict="refused"), kind)
    assert pasteable(replace(CALIBRATION, verdict="refused")) == {}


def test_unknown_export_kind_suggests_nearest():
    """The error for an unknown kind suggests the nearest one."""
    with pytest.raises(FrameNotFound, match="did you mean 'kuka'"):
        export(CALIBRATION, "kukka")


def test_unsupported_export_option_is_refused():
    """A kind for transforms refuses a robot."""
    with pytest.raises(InputError, match="ur takes a transform, not a robot"):
        export(CALIBRATION, "ur", robot="hand")


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((None, "ur"), {}, r"^calibration is of type NoneType, expected Calibration$"),
        ((CALIBRATION, None), {}, r"^kind is of type NoneType, expected str$"),
        ((CALIBRATION, "ur", 3), {}, r"^transform is of type int, expected str$"),
        ((CALIBRATION, "urdf_joint"), {"urdf": "arm.urdf"}, r"^urdf is 'arm.urdf', expected a list of paths$"),
        ((CALIBRATION, "urdf_joint"), {"urdf": Path("arm.urdf")}, r"^urdf is 'arm.urdf', expected a list of paths$"),
    ],
)
def test_arguments_of_wrong_type_are_refused(arguments, options, message):
    """A single path in place of a list is not read as a list of its characters."""
    with pytest.raises(InputError, match=message):
        export(*arguments, **options)


def test_every_export_kind_is_documented():
    """docs/exporting.md has a section per kind in the registry's order, each beginning with the registry's words."""
    page = (Path(__file__).parents[3] / "docs" / "exporting.md").read_text(encoding="utf-8")
    sections = re.findall(r"^### `(\w+)`\n\n(.+)\.$", page, re.MULTILINE)
    assert [(kind, line.casefold()) for kind, line in sections] == [
        (kind, each.words.casefold()) for kind, each in EXPORTERS.items()
    ], "docs/exporting.md: a heading ### `KIND` for each in the registry's order, and below it the registry's words"


@pytest.mark.parametrize("kind", ["ur", "kuka", "abb", "staubli", "doosan", "xarm", "matrix"])
def test_exported_controller_poses_are_imported_again(kind, tmp_path):
    """Comments are skipped, and each pose equals the exported one to the written digits."""
    path = tmp_path / "pasted.txt"
    path.write_text(export(CALIBRATION, kind, BASE, cell=CELL), encoding="utf-8")
    rows = read_controller_poses(str(path), "eye", PoseFormat(kind))
    assert rows
    for row in rows:
        np.testing.assert_allclose(row.robots["eye"].base_from_flange.matrix, CALIBRATION[BASE].mean.matrix, atol=2e-6)


@pytest.mark.parametrize("kind", [kind for kind, each in EXPORTERS.items() if each.is_pasted])
def test_zero_has_no_sign(kind):
    """Zeros of either sign, as of a base that is not rotated, are written as zero in every text to paste."""
    signed = PoseEstimate(SE3(np.where(np.eye(3) > 0, 1.0, -0.0), np.array([-0.0, 0.25, -0.0])), 1e-8 * np.eye(6))
    calibration = replace(CALIBRATION, transforms={**CALIBRATION.transforms, BASE: signed})
    for name in (BASE, INVERSE):
        text = export(calibration, kind, name, cell=CELL)
        assert re.findall(r"(?<![\w.])-0(?:\.0*)?(?![\w.])", text) == []


def test_pasteable_texts_equal_exports():
    """Texts are keyed by transform in both directions, then by kind; points have none, and JSON can hold all."""
    texts = pasteable(CALIBRATION, CELL, "20260102T030405Z")
    assert set(texts) == set(all_poses())
    assert POINT not in texts
    for kind, text in texts[INVERSE].items():
        assert text == export(CALIBRATION, kind, INVERSE, cell=CELL, run="20260102T030405Z")
    in_programs = {"ur", "kuka", "abb", "fanuc"}
    in_files = {"ros", "ros2", "matrix", "json", "csv", "opencv", "mujoco"}
    assert in_programs | in_files <= texts[BASE].keys()
    assert json.loads(json.dumps(texts)) == texts
