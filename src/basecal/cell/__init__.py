"""The nouns of a calibration and their files."""

from basecal.cell.calibration import (
    Calibration,
    Certificate,
    ClockOffset,
    Finding,
    LineTime,
    Loop,
    Outlier,
    Residuals,
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
    KeepOut,
    Robot,
    RollingShutter,
    Unknown,
)
from basecal.cell.recording import (
    CandidateObservation,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    RobotState,
    Sample,
    TrackObservation,
)
from basecal.cell.results.verification_file import MeasuredShift, PastVerification
from basecal.cell.rival import Rival
from basecal.cell.target import Target
from basecal.cell.work_error import BudgetEntry, ErrorMap, LocalFit, MeetingError, Tolerance
from basecal.effects.faces.robot_parameter import RobotParameters
from basecal.fields.parameters import Parameters

__all__ = [
    "WORLD",
    "BudgetEntry",
    "Calibration",
    "CandidateObservation",
    "Cell",
    "CellCamera",
    "CellTarget",
    "Certificate",
    "Clock",
    "ClockOffset",
    "Driver",
    "ErrorMap",
    "Finding",
    "Intrinsics",
    "KeepOut",
    "LineTime",
    "LocalFit",
    "Loop",
    "MeasuredShift",
    "MeetingError",
    "Observation",
    "Outlier",
    "Parameters",
    "PastVerification",
    "PixelObservation",
    "PointObservation",
    "PoseObservation",
    "Recording",
    "Residuals",
    "Rival",
    "Robot",
    "RobotParameters",
    "RobotState",
    "RollingShutter",
    "Sample",
    "SampleResidual",
    "Target",
    "Tolerance",
    "TrackObservation",
    "Unknown",
    "Validation",
]
