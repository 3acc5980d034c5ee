"""`basecal verify`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from basecal.cli.detect import detected_recording
from basecal.cli.next_step import capture_command, has_drivers
from basecal.cli.page import add_stored_scene, find_run
from basecal.cli.terminal import finding_line, print_json, progress_bar, quote_path, say_next, say_verdict
from basecal.errors import DatasetError, UsageError, count_text

if TYPE_CHECKING:
    from basecal.accuracy.drift.verify import Verification
    from basecal.cell import Cell, Recording, Sample


def verify(
    cell: Path,
    samples: Path | None = None,
    /,
    *,
    against: Path | None = None,
    recalibrate: bool = False,
    history: bool = False,
    json: bool = False,
) -> int:
    """Check with one or a few new samples whether a cell is unchanged.

    Reports whether anything moved, what moved (a base, a camera, a target, a joint
    offset) and by how much, with sigma. Also reports the smallest detectable
    shift. SAMPLES is a file of lines as in recording/samples.jsonl, with its
    images in the recording's folder. It may also be a folder with imported poses
    and images of the same robots and cameras. After a calibration with --scene,
    images are compared with the stored points of the scene. The result is
    appended to the cell's verifications.jsonl, which --history reports.

    Exit code: 0 if nothing moved; 1 if something moved or if that cannot be
    determined, so that a scheduled check can raise an alarm. If nothing moved,
    one check in two hundred reports a motion by chance.

    For example:

        basecal verify mycell today.jsonl
        basecal verify mycell today
        basecal verify mycell today.jsonl --json
        basecal verify mycell today.jsonl --recalibrate
        basecal verify mycell today.jsonl --against mycell/runs/20260102T030405Z
        basecal verify mycell --history

    Args:
        cell: Folder of the cell.
        samples: New samples, one JSON object per line; or the folder of a cell with the imported samples.
        against: Folder of the run to verify; the latest by default.
        recalibrate: If nothing moved, add the new samples to the recording, and calibrate from all of them.
        history: Report all verifications and drifts; with SAMPLES after verifying them.
        json: Print one JSON object instead of text.
    """
    from basecal.cell.files import finding_to_dict, read_cell
    from basecal.reporting.drift_text import verification_dict, verification_text

    if samples is None and (recalibrate or against is not None or not history):
        raise UsageError("give the new samples: basecal verify CELL NEW.jsonl, or --history alone")
    described = read_cell(cell)
    if samples is None:
        data, text, code = {}, [], 0
    else:
        run, new = find_run(cell) if against is None else against, _new_samples(cell, described, samples)
        repeats = _calibrated_samples(cell, described, run, new)
        verification = _verify(cell, described, run, new)
        found = [finding_to_dict(each) for each in new.findings]
        data = {**verification_dict(verification), "findings": found, "calibrated_samples": repeats}
        text = [verification_text(verification), *_repeats_lines(repeats, new), *map(finding_line, new.findings)]
        code = int(verification.moved is not False)
        if recalibrate:
            data["recalibration"], code = _recalibrate(cell, described, run, new, verification, repeats)
            text.append(_recalibration_words(data["recalibration"]))
    if history:
        history_data, words = _history(cell)
        data, text = {**data, **history_data}, [*text, words]
    if json:
        print_json(data)
    else:
        moved = None if samples is None else verification.moved
        say_verdict("\n".join(text), "doubtful" if moved is None else "refused" if moved else "good")
        if moved or not history:
            say_next(_next_command(described, cell, moved))
    return code


def _next_command(cell: Cell, folder: Path, has_moved: bool | None) -> str:
    if has_moved and has_drivers(cell):
        return f"check what was bumped or loosened, then record again: {capture_command(cell, folder)}"
    if has_moved:
        return "check what was bumped or loosened, record again, and import that into a new folder"
    return f"all verifications so far: basecal verify {quote_path(folder)} --history"


def _new_samples(folder: Path, cell: Cell, samples: Path) -> Recording:
    """Read the new samples, and detect targets in their images.

    Raises:
        DatasetError: if the samples cannot be read, or an image is missing.
    """
    from basecal.cell.files import read_samples

    is_cell = samples.is_dir()
    journal = samples / "recording" / "samples.jsonl" if is_cell else samples
    base_folder = samples if is_cell else folder
    recording = read_samples(journal, base_folder, cell)
    for sample in recording.samples:
        _require_images(sample, base_folder, journal)
    if cell.targets and any(sample.images for sample in recording.samples):
        from basecal.vision.detect import detect

        with progress_bar("detecting") as step:
            recording = detect(cell, recording, progress=step)
    return recording


def _require_images(sample: Sample, base_folder: Path, journal: Path) -> None:
    """Check that the images of a sample exist for cameras without observations.

    Raises:
        DatasetError: if an image is missing.
    """
    observed_cameras = {observation.camera for observation in sample.observations}
    for camera, image in sample.images.items():
        if camera not in observed_cameras and not (base_folder / image).is_file():
            message = f"the image of {camera!r} is missing, looked for at {base_folder / image}"
            raise DatasetError(journal, f"sample {sample.sample}: {message}; put it there, or correct its path")


def _calibrated_samples(folder: Path, cell: Cell, run: Path, new: Recording) -> list[int]:
    """Numbers of the samples that the run was calibrated from, which agree with it in any case."""
    from basecal.cell.files import input_hashes, read_calibration
    from basecal.cell.journal.recording_file import FILE, FOLDER

    journal = f"{FOLDER}/{FILE}"
    if read_calibration(run).inputs.get(journal) != input_hashes(folder, cell).get(journal):
        return []
    known = {_measured_values(sample) for sample in detected_recording(folder, cell).samples}
    return [sample.sample for sample in new.samples if _measured_values(sample) in known]


def _repeats_lines(repeats: list[int], new: Recording) -> list[str]:
    if not repeats:
        return []
    count = f"{len(repeats)} of {count_text(len(new.samples), 'sample')}"
    return [f"warning: {count} are those of the calibration, from sample {repeats[0]} on, and agree in any case"]


def _measured_values(sample: Sample) -> str:
    """All measured values of a sample, in all digits, without its number and the names of its files."""
    from json import dumps

    from basecal.cell.files import sample_to_dict

    return dumps(sample_to_dict(replace(sample, sample=0, images={}, background={}), ""))


def _verify(folder: Path, cell: Cell, run: Path, new: Recording) -> Verification:
    """Verify a run with new samples, and append the result to the cell's verifications."""
    from datetime import UTC, datetime

    from basecal.accuracy.drift.history import record_verification
    from basecal.accuracy.drift.verify import verify as verified
    from basecal.cell.files import append_verification, read_calibration
    from basecal.cell.results.fingerprint_file import read_fingerprint

    calibration = read_calibration(run)
    cell, new = add_stored_scene(cell, new, calibration, read_fingerprint(run))
    verification = verified(cell, calibration, new)
    name = (run if run.is_dir() else run.parent).resolve().name
    append_verification(folder, record_verification(verification, datetime.now(UTC), name))
    return verification


def _recalibrate(
    folder: Path, cell: Cell, run: Path, new: Recording, verification: Verification, repeats: list[int]
) -> tuple[dict[str, Any] | None, int]:
    """Calibrate from old and new samples with the settings of the verified run; its result and exit code.

    Samples of the calibration are not added again. The result is None if something moved or if that is not determined.
    """
    from basecal.cell.files import append_samples, read_calibration, read_recording
    from basecal.cli.calibrate import exit_code, recalibrate_folder
    from basecal.exchange.importing.cell_files import place_files
    from basecal.reporting.statement.verdict import verdict_word

    if verification.moved is not False:
        return None, 1
    first = max((sample.sample for sample in read_recording(folder, cell).samples), default=-1) + 1
    used = [sample for sample in new.samples if sample.sample not in (*verification.outliers, *repeats)]
    kept = [sample for sample in used if sample.observations or sample.sample in verification.samples]
    files: dict[str, Path] = {}
    added = [_renumber_sample(sample, first + k, new.folder or folder, files) for k, sample in enumerate(kept)]
    with place_files(files, folder):
        append_samples(folder, added)
    calibrated = recalibrate_folder(folder, cell, read_calibration(run))
    word = verdict_word(calibrated.calibration).lower()
    result = {"run": calibrated.run.name, "verdict": word, "added": [sample.sample for sample in added]}
    return result, exit_code(calibrated.calibration)


def _renumber_sample(sample: Sample, number: int, base_folder: str | Path, files: dict[str, Path]) -> Sample:
    """The sample with another number; images of a sample without observations are added to `files` by path."""
    from basecal.exchange.importing.cell_files import numbered_path

    images = {} if sample.observations else {c: numbered_path(path, number) for c, path in sample.images.items()}
    files.update((images[camera], Path(base_folder) / sample.images[camera]) for camera in images)
    return replace(sample, sample=number, images=images, background={})


def _recalibration_words(result: dict[str, Any] | None) -> str:
    if result is None:
        return "not calibrated again: samples from before and after something moved are of two cells"
    count = count_text(len(result["added"]), "new sample")
    return f"calibrated again with {count}, {result['verdict']}: run {result['run']}"


def _history(cell: Path) -> tuple[dict[str, Any], str]:
    """All verifications of a cell, as data and as text."""
    from basecal.accuracy.drift.history import drifts
    from basecal.cell.files import read_verifications
    from basecal.reporting.drift_text import history_dict, history_text

    past = read_verifications(cell)
    trends = drifts(past)
    return history_dict(past, trends), history_text(past, trends).replace(" CELL ", f" {quote_path(cell)} ")
