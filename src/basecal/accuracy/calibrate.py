"""Calibrate a cell: solve and judge the answer, as a list of stages."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from typing import NamedTuple

from basecal.accuracy.stages import concluding, judging, pose_noise, reading, solving
from basecal.accuracy.stages.case import Case
from basecal.cell import Calibration, Cell, Recording
from basecal.cell.recording_check import check_recording
from basecal.errors import check_type
from basecal.estimation.settings import DEFAULT, LOG, Settings
from basecal.estimation.stages import StageName
from basecal.numerics.threads import limit_threads

_LOG_LEVELS = {"error": logging.ERROR, "warning": logging.WARNING, "info": logging.INFO}


class Stage(NamedTuple):
    """A stage of a calibration: the name under which its time is recorded, and its function.

    A stage without a name records the time of its parts.
    """

    name: StageName | None
    run: Callable[[Case], Case]


READING_STAGES = (
    Stage(None, reading.check_task),
    Stage(None, reading.calibrate_from_scene),
    Stage("clocks", reading.estimate_clocks),
    Stage("start", reading.measure_units),
    Stage("problem", reading.screen_units),
    Stage("problem", reading.pack_problem),
    Stage("problem", reading.check_input),
    Stage(None, reading.calibrate_by_shifts),
)
SOLVING_STAGES = (
    Stage(None, solving.solve_all),
    Stage("conventions", solving.screen_conventions),
    Stage(None, solving.leave_outliers_out),
    Stage(None, pose_noise.shape_pose_noise),
    Stage(None, solving.widen_lenses),
    Stage(None, solving.join_static_scene),
    Stage("noise", solving.integrate_noise),
)
JUDGING_STAGES = (
    Stage(None, solving.refuse_unexplained_poses),
    Stage("stated sigmas", judging.screen_stated_sigmas),
    Stage("robot model", judging.choose_kinematics),
    Stage("systematic errors", judging.find_systematic_error),
    Stage("certificate", judging.certify_solution),
    Stage("cross-validation", judging.predict_held_out_samples),
    Stage("findings", judging.list_findings),
    Stage("findings", judging.cover_effects),
    Stage("findings", concluding.conclude),
    Stage("task", concluding.find_error_at_task),
)


@limit_threads
def calibrate(cell: Cell, recording: Recording, settings: Settings = DEFAULT) -> Calibration:
    """Estimate the transforms of a cell with their covariance and a verdict.

    Args:
        cell: Robots, cameras and targets, and prior knowledge about them.
        recording: The recorded samples.
        settings: Settings of the solver.

    Returns:
        The calibration. If the data are insufficient, its verdict is `refused` and its findings state the reasons.

    Raises:
        InputError: if an argument has the wrong type, the cell contradicts the recording, or no requested transform
            concerns a stated task point.
        NotObservable: if the axis-shift method is requested and the recording has no station, or a mount is not known.
    """
    check_recording(cell, recording)
    check_type("settings", settings, Settings)
    read = _run_stages(READING_STAGES, Case(cell, recording, settings))
    calibration = _run_stages((*SOLVING_STAGES, *JUDGING_STAGES), read).calibration
    assert calibration is not None
    LOG.info("verdict: %s", calibration.verdict)
    for finding in calibration.findings:
        LOG.log(_LOG_LEVELS[finding.severity], "%s: %s", finding.code, finding.message)
    return calibration


def _run_stages(stages: Sequence[Stage], case: Case) -> Case:
    """Run stages until one ends the case, and return the case."""
    for stage in stages:
        if case.is_ended:
            break
        with case.settings.stage(stage.name) if stage.name else nullcontext():
            case = stage.run(case)
    return case
