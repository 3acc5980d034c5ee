"""A calibration to export, with a base, a mount, a fixed transform and a point; `frames` name them otherwise."""

from __future__ import annotations

import numpy as np

from basecal.cell import Calibration, Cell, CellCamera, CellTarget, Finding, Robot, Unknown
from basecal.exchange.exports.choice import chosen_transforms
from basecal.exchange.exports.exporter import ExportRequest, provenance
from basecal.geometry import SE3, PoseEstimate

BASE = "eye_base_from_hand_base"
INVERSE = "hand_base_from_eye_base"
MOUNT = "eye_flange_from_wrist"
FIXED = "hand_flange_from_board"
POINT = "hand_flange_from_led"
POSE = SE3.from_rpy([0.3, -0.7, 2.9], [0.81234567891, -0.4, 0.05])
# Smallest sigmas: 0.2 mm, 0.3 mrad
SIGMAS = np.array([2e-4, 3e-4, 5e-4, 3e-4, 5e-4, 8e-4])
_SPREAD = np.random.default_rng(5).standard_normal((6, 6))
CORRELATED = np.diag(SIGMAS) @ np.corrcoef(_SPREAD) @ np.diag(SIGMAS)
ESTIMATE = PoseEstimate(POSE, CORRELATED)
FINDINGS = (
    Finding("poor-fit", "warning", (), "It does not fit."),
    Finding("better-optimum", "info", (), "Another start fits better."),
)
CALIBRATION = Calibration(
    "good",
    transforms={
        BASE: ESTIMATE,
        MOUNT: PoseEstimate(SE3.from_rpy([3.1, 0.01, 1.5], [0.01, 0.02, 0.1]), CORRELATED),
        FIXED: PoseEstimate.exact(SE3.from_rotvec([0.1, 0.2, 0.3], [0.1, 0.2, 0.3])),
        POINT: PoseEstimate(SE3.from_rpy([0, 0, 0], [0, 0, 0.1]), np.diag([1e-8, 1e-8, 1e-8, 0, 0, 0])),
    },
    status={BASE: "free", MOUNT: "prior", FIXED: "fixed", POINT: "free"},
    points=frozenset({POINT}),
    inputs={"recording/samples.jsonl": "sha256:" + "0123456789abcdef" * 4},
    findings=FINDINGS,
)
CELL = Cell(
    "eye",
    robots={
        "eye": Robot("eye", frames={"base": "left base's", "flange": "left_tool0"}),
        "hand": Robot("hand", frames={"base": "right_base"}),
    },
    bases={"hand": Unknown()},
    cameras={"wrist": CellCamera("wrist", "eye")},
    targets={
        "board": CellTarget("board", "hand", Unknown("fixed", SE3.identity())),
        "led": CellTarget("led", "hand"),
    },
)


def wanted(name: str | None = None, calibration: Calibration = CALIBRATION, cell: Cell | None = CELL) -> ExportRequest:
    """Arguments of an exporter for one transform, or for all transforms if `name` is None."""
    return ExportRequest(
        chosen_transforms(calibration, cell, name), provenance(calibration, "20260102T030405Z"), calibration, cell
    )


def all_poses() -> list[str]:
    """Names of transforms that can be exported: both directions of each that is not a point."""
    names = [name for name in CALIBRATION.transforms if name != POINT]
    return names + ["_from_".join(reversed(name.split("_from_"))) for name in names]
