"""Stages that build the calibration: clocks, all transforms with their covariance, and the error at the task."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from basecal.accuracy.clocks.correction import clock_findings, clock_offsets, line_times
from basecal.accuracy.covariance.widening import curved_covariance
from basecal.accuracy.held_gauges import held_gauges
from basecal.accuracy.noise_summary import noise_summary
from basecal.accuracy.phrases.null_space import describe_null_space
from basecal.accuracy.phrases.outlier import outlier_entry
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.accuracy.stages.case import Case
from basecal.accuracy.task.task_error import add_task_error
from basecal.accuracy.verdicts import judge_findings, transform_verdicts
from basecal.cell import Calibration


def conclude(case: Case) -> Case:
    """Build the calibration from the results of all previous stages."""
    clocked, step = case.clocked, case.clock_step
    if clocked is None or step is None:
        return replace(case, calibration=_calibration(case))
    case = case.with_findings(clock_findings(clocked, step))
    clocks, lines = clock_offsets(clocked, step), line_times(clocked, step)
    return replace(case, calibration=replace(_calibration(case), clocks=clocks, line_times=lines))


def find_error_at_task(case: Case) -> Case:
    """Add the error at the task, if a task is stated."""
    assert case.calibration is not None
    fitted, as_modelled, final = case.answers
    offsets = None if case.clock_step is None else case.clock_step.offsets
    found = add_task_error(case.cell, case.calibration, case.settings, (fitted, as_modelled, final), offsets)
    return replace(case, calibration=found)


def _calibration(case: Case) -> Calibration:
    assert case.robust is not None
    solution, validated = case.answers[-1], case.evidence.cross_validation
    images = case.evidence.images
    return Calibration(
        verdict=judge_findings(case.findings),
        noise=noise_summary(case.cell, case.recording, solution),
        residuals=case.evidence.residuals,
        condition=solution.observability.condition if np.isfinite(solution.observability.condition) else None,
        unobservable=tuple(map(describe_null_space, solution.observability.null_space)),
        outliers=tuple(outlier_entry(outlier, images) for outlier in case.robust.outliers),
        validation=None if validated is None else validated.summary,
        certificate=case.certificate,
        findings=case.findings,
        settings=case.settings.as_dict(),
        scene=case.scene,
        **_estimates(case),
    )


def _estimates(case: Case) -> dict[str, Any]:
    """Observable estimates as fields of `Calibration`: transforms, lenses and robot parameters, with covariances."""
    solution = case.answers[-1]
    found = solution.transforms if solution.converged else {}
    estimates = {n: e for n, e in found.items() if n not in solution.observability.unobservable}
    lenses = solution.problem.columns.keys() - solution.observability.unobservable if solution.converged else set()
    order = tuple(n for n in estimates if solution.problem.unknowns[n].status != "fixed")
    gauges = held_gauges(solution, order) if solution.converged else ()
    joint = sum((gauge.covariance for gauge in gauges), solution.joint_transform_covariance(list(order)))
    joint = joint + curved_covariance(case.answers[0], order) if solution.converged else joint
    blocks = {name: joint[at : at + 6, at : at + 6] for name, at in zip(order, range(0, len(joint), 6), strict=True)}
    return {
        "transforms": {n: replace(e, covariance=blocks.get(n, e.covariance)) for n, e in estimates.items()},
        "verdicts": transform_verdicts(solution.problem, estimates, case.findings),
        "status": {n: solution.problem.unknowns[n].status for n in estimates},
        "points": frozenset(n for n in solution.problem.point_mounts if n in estimates),
        "cameras": {n: (c, solution.lens_covariance(n)) for n, c in solution.state.cameras.items() if n in lenses},
        "robot_parameters": robot_parameters(solution) if solution.converged else {},
        "order": order,
        "joint_covariance": joint if order else None,
        "gauges": gauges,
    }
