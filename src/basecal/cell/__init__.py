"""The nouns of a calibration and their files."""

from basecal.cell.calibration import (
    Calibration,
    Certificate,
    Finding,
    JointOffsets,
    LinkParameters,
    Loop,
    Outlier,
    Residuals,
    SampleResidual,
    Validation,
)
from basecal.cell.cell import WORLD, Cell, CellCamera, CellTarget, Intrinsics, Parameters, Robot, Unknown
from basecal.cell.recording import (
    CandidateObservation,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    RobotState,
    Sample,
)
from basecal.cell.target import Target

__all__ = [
    "WORLD",
    "Calibration",
    "CandidateObservation",
    "Cell",
    "CellCamera",
    "CellTarget",
    "Certificate",
    "Finding",
    "Intrinsics",
    "JointOffsets",
    "LinkParameters",
    "Loop",
    "Observation",
    "Outlier",
    "Parameters",
    "PixelObservation",
    "PointObservation",
    "PoseObservation",
    "Recording",
    "Residuals",
    "Robot",
    "RobotState",
    "Sample",
    "SampleResidual",
    "Target",
    "Unknown",
    "Validation",
]
