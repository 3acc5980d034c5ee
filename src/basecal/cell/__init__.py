"""The nouns of a calibration and their files."""

from basecal.cell.calibration import (
    Calibration,
    Certificate,
    ClockOffset,
    Finding,
    Loop,
    Outlier,
    Residuals,
    RobotParameters,
    SampleResidual,
    Validation,
)
from basecal.cell.cell import (
    WORLD,
    Cell,
    CellCamera,
    CellTarget,
    Clock,
    Driver,
    Intrinsics,
    Robot,
    Unknown,
)
from basecal.cell.format.parameters import Parameters
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
    "Clock",
    "ClockOffset",
    "Driver",
    "Finding",
    "Intrinsics",
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
    "RobotParameters",
    "RobotState",
    "Sample",
    "SampleResidual",
    "Target",
    "Unknown",
    "Validation",
]
