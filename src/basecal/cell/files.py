"""Functions that read and write the files of a cell."""

from basecal.cell.journal.completing import completed_recording_text
from basecal.cell.journal.plan_file import parse_plan, read_plan, write_plan
from basecal.cell.journal.recording_file import (
    append_sample,
    append_samples,
    read_recording,
    read_samples,
    recording_from_text,
    write_recording,
)
from basecal.cell.journal.sample_dict import sample_to_dict
from basecal.cell.results.calibration_dict import calibration_from_dict, calibration_to_dict, finding_to_dict
from basecal.cell.results.calibration_file import (
    input_hashes,
    latest_run,
    read_calibration,
    read_calibration_data,
    run_folder,
    run_names,
    write_calibration,
)
from basecal.cell.results.truth_file import read_truth, write_truth
from basecal.cell.results.verification_file import append_verification, read_verifications
from basecal.cell.schema.cell_dict import cell_to_dict
from basecal.cell.schema.cell_file import cell_from_dict, read_cell, write_cell
from basecal.cell.schema.completing import completed_cell_text

__all__ = [
    "append_sample",
    "append_samples",
    "append_verification",
    "calibration_from_dict",
    "calibration_to_dict",
    "cell_from_dict",
    "cell_to_dict",
    "completed_cell_text",
    "completed_recording_text",
    "finding_to_dict",
    "input_hashes",
    "latest_run",
    "parse_plan",
    "read_calibration",
    "read_calibration_data",
    "read_cell",
    "read_plan",
    "read_recording",
    "read_samples",
    "read_truth",
    "read_verifications",
    "recording_from_text",
    "run_folder",
    "run_names",
    "sample_to_dict",
    "write_calibration",
    "write_cell",
    "write_plan",
    "write_recording",
    "write_truth",
]
