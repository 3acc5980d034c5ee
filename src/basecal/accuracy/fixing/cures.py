"""Cures of findings of a calibration by changes to the files of the cell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from basecal.accuracy.fixing.change import Change, change_carriers, change_of_hypothesis
from basecal.accuracy.fixing.offers import offered_places
from basecal.accuracy.fixing.places import free_lens_entry, free_transform_entry
from basecal.accuracy.input_check.conventions import every_hypothesis
from basecal.accuracy.input_check.hypotheses import ConventionHypothesis
from basecal.accuracy.input_check.hypothesis_fit import fit_hypothesis
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.accuracy.readings.carriers import describe_carriers
from basecal.accuracy.readings.reading import Reading, declared_reading
from basecal.cell import Calibration, Cell, Finding, Recording
from basecal.cell.format.yaml_text import yaml_entry
from basecal.errors import BasecalError, sentence
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import STATED
from basecal.estimation.solve import solve_problem
from basecal.fields.problems import Loc, field_name

_OF_STATED = ("intrinsics", "fixed-contradicted", "prior-contradicted")  # findings about a lens or a transform
_FITTED = 40  # samples of a fit: more than the 16 of `benchmarks.slips`, which tests the cures


@dataclass(frozen=True, eq=False)
class Cure:
    """A fix of a finding.

    Attributes:
        finding: The finding.
        words: Description of the fix, as a sentence.
        change: Changes to the files.
        is_choice: Whether another cure of the finding fits equally well, so that only the user can choose.
    """

    finding: Finding
    words: str
    change: Change
    is_choice: bool = False


def find_cures(cell: Cell, recording: Recording, detections: Recording, calibration: Calibration) -> tuple[Cure, ...]:
    """Cures of the findings of a calibration, in their order.

    Args:
        cell: The cell as written.
        recording: The recording as written.
        detections: The recording with the detections of its images.
        calibration: The calibration of cell and detections.
    """
    grave = [finding for finding in calibration.findings if finding.severity != "info"]
    by_convention = _convention_cures(cell, recording, detections, grave)
    found: list[Cure] = []
    for finding in grave:
        found += by_convention.get(finding, ())
        if finding not in by_convention:
            found += _finding_cures(cell, recording, calibration, finding)
    return tuple(found)


def _convention_cures(
    cell: Cell, recording: Recording, detections: Recording, findings: list[Finding]
) -> dict[Finding, tuple[Cure, ...]]:
    """Cures of findings about a hypothesis of the input, by finding."""
    try:
        problem, _ = build_problem(cell, detections)
        declared = declared_reading(cell, detections, problem)
        known = every_hypothesis(declared, solve_problem(problem, cell, STATED).state, STATED)
    except BasecalError:
        return {}
    found: dict[Finding, tuple[Cure, ...]] = {}
    for finding in findings:
        named = [each for each in known if each.code == finding.code and finding.what.startswith(_claim(each))]
        if named:
            hypothesis = named[0] if len(named) == 1 else min(named, key=lambda each: _misfit(declared, each))
            change = change_of_hypothesis(recording, declared, hypothesis)
            found[finding] = tuple(_hypothesis_cures(finding, hypothesis, change or Change()))
    return found


def _hypothesis_cures(finding: Finding, hypothesis: ConventionHypothesis, change: Change) -> Iterator[Cure]:
    """The cure that undoes a hypothesis, and the one by other carriers, which fits equally well."""
    carriers = hypothesis.carriers
    clause = describe_carriers(carriers) if carriers else ""
    if not change.is_empty:
        words = hypothesis.words.removesuffix(f", or {clause}")
        yield Cure(finding, f"Undo: {words}.", change, is_choice=bool(carriers))
    if carriers:
        yield Cure(finding, f"Write that {clause}.", change_carriers(carriers), is_choice=True)


def _misfit(baseline: Reading, hypothesis: ConventionHypothesis) -> float:
    """Error of the fit of a hypothesis; a claim has several hypotheses if a rotation has two triples of angles."""
    reading = hypothesis.reread(baseline).thin(_FITTED)
    fit = fit_hypothesis(reading.cell, reading.problem, STATED)
    return float("inf") if fit is None else fit.trimmed_rms


def _claim(hypothesis: ConventionHypothesis) -> str:
    """Beginning of a finding about a hypothesis."""
    return sentence(hypothesis.words, hypothesis.about).removesuffix(".")


def _finding_cures(cell: Cell, recording: Recording, calibration: Calibration, finding: Finding) -> Iterator[Cure]:
    """Cures of a finding about samples, a lens or a transform, or with a line to write."""
    if places := offered_places(cell, finding):
        told = ", ".join(yaml_entry(field_name(place), value) for place, value in places.items())
        yield Cure(finding, f"Write {told}.", Change(cell=places))
    for name in finding.about if not places and finding.code in _OF_STATED else ():
        if freed := _freed_entry(cell, name):
            yield Cure(finding, f"Free {'the lens of ' if name in cell.cameras else ''}{name}.", Change(cell=freed))
    if finding.code == "outlier-samples":
        left_out = {sample for sample, _, _ in calibration.outlier_views}
        kept = tuple(sample for sample in recording.samples if sample.sample not in left_out)
        if left_out:
            yield Cure(finding, f"Leave out {list_samples(sorted(left_out))}.", Change(samples=kept))


def _freed_entry(cell: Cell, name: str) -> dict[Loc, Any]:
    """Entry of `cell.yaml` that frees a transform, or the stated lens of a camera; empty if there is no such entry."""
    lens = cell.cameras[name].intrinsics if name in cell.cameras else None
    return free_transform_entry(cell, name) if lens is None or lens.status == "free" else free_lens_entry(cell, name)
