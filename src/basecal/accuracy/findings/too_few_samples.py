"""`too-few-samples`: the views are too few to check each other."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Input
from basecal.accuracy.phrases.robot_motion import describe_poor_motions
from basecal.cell import Finding
from basecal.errors import count_text
from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import Array

_SEARCHED = ("dropped-sample", "few-images")  # codes of searches that found no target


def too_few_samples(inputs: Input) -> list[Finding]:
    """An error if no view can be checked: without the place of most equations, there are fewer than unknowns."""
    problem = inputs.problem
    count = len(problem.samples)
    if count == 0 and inputs.image_count and not any(each.code in _SEARCHED for each in inputs.findings):
        return [_search_advice(inputs.image_count)]
    if count < 2:
        found = "no sample has" if count == 0 else "only one sample has"
        return [_finding(f"{found} a view of a target and the pose of every robot that it depends on")]
    equations = np.concatenate([_equations_by_place(group) for group in problem.groups])
    # Scalar unknowns without a prior: of transforms and lenses, of the robots' kinematics, and units of poses.
    free = [n for n in problem.columns if n in problem.unknowns and problem.unknowns[n].status == "free"]
    unknowns = len(problem.column_indices(free)) + inputs.unit_count
    models = problem.models.values()
    unknowns += sum(width for m in models for name, width in m.widths.items() if m.sigmas[name] is None)
    if equations.sum() - equations.max() >= unknowns:
        return []
    views = sum(len(group) for group in problem.groups)
    places = "one place" if len(equations) == 1 else f"{len(equations)} places"
    many = f"{count} samples" + (f" at {places}" if len(equations) < views else "")
    counts = f"{many} give {int(equations.sum())} equations for {unknowns} unknowns"
    found = f"{counts}: too few to check each sample by the others"
    return [_finding(found, describe_poor_motions(problem))]


def _search_advice(image_count: int) -> Finding:
    what = f"No target was searched in the {count_text(image_count, 'image')} of the recording."
    do = ("Call `recording = basecal.detect(cell, recording)` before `calibrate`.",)
    return Finding("too-few-samples", "error", (), what, do)


def _equations_by_place(group: ViewGroup) -> Array:
    """Equations of each place of a group's views, (k,): a second view from the same place only shows noise."""
    places = np.stack([group.eye.stop_number, group.hand.stop_number], axis=1)
    of_place = np.unique(places, axis=0, return_inverse=True)[1].ravel()
    equations = np.zeros(int(of_place.max(initial=-1)) + 1)
    np.maximum.at(equations, of_place, group.measurement.equations())
    return equations


def _finding(problem: str, sentence: str = "") -> Finding:
    do = ("Record at least 10 samples with every arm in different orientations (20 for a single LED).",)
    return Finding(
        "too-few-samples",
        "error",
        (),
        f"{problem[0].upper()}{problem[1:]}.",
        do,
        f"So far {sentence}." if sentence else "",
    )
