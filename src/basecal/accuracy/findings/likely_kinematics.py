"""`robot-model`, `deflection` as an info: what arms are likely built otherwise, where the covariance counts it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.accuracy.cross_validation.robot_model_selection import LINK_SIGMA_M, LINK_SIGMA_RAD, suggested_sigma
from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.robot_model import robot_model
from basecal.accuracy.phrases.gravity import gravity_taken
from basecal.cell import Finding
from basecal.geometry import Array

_LIKELY = 10.0  # of twice the log of the evidence, beyond which it is very strong (Kass & Raftery 1995)
_CODES = {"zeros": "robot-model", "links": "robot-model", "sag": "deflection"}


def likely_kinematics(of: Evidence) -> list[Finding]:
    """Zeros, links or compliances that the noise shows far better than stops that err by themselves; see `noise.terms`.

    Nothing where a warning says so already.
    """
    noise = of.solution.noise
    term, sigmas = next(iter(noise.common.items()), ("", {}))
    code = _CODES.get(term)
    if code is None or noise.plain_surprise - noise.surprise < _LIKELY:
        return []
    by_error = of.systematic_error is not None and of.systematic_error.code.startswith(("joint", "deflection"))
    if by_error or (code == "robot-model" and robot_model(of)):  # other findings say it
        return []
    robots = " and ".join(sigmas)
    message = f"{_what(term, sigmas, robots)}: the covariance counts what that does"
    if term == "sag":
        message = f"{message}; {gravity_taken(of.cell, of.solution, tuple(sigmas))}"
    entry = f"to be rid of it write {_entry(term, sigmas)} at {robots}"
    return [Finding(code, "info", tuple(sigmas), f"{message}; {entry}")]


def _what(term: str, sigmas: Mapping[str, Array], robots: str) -> str:
    shift, turn = np.max(list(sigmas.values()), axis=0)
    angle = f"{np.degrees(turn):.2g} deg one sigma"
    if term == "links":
        return f"links of {robots} are likely off, by {1e3 * shift:.2g} mm and {angle}"
    if term == "sag":
        return f"joints of {robots} likely yield to the weight of the links, by {angle}"
    return f"zeros of joints of {robots} are likely off, by {angle}"


def _entry(term: str, sigmas: Mapping[str, Array]) -> str:
    if term == "links":
        return f"`link_parameters: {{status: prior, sigma_rad: {LINK_SIGMA_RAD}, sigma_m: {LINK_SIGMA_M}}}`"
    if term == "sag":
        return "`deflection: {status: free}`"
    sigma_rad = suggested_sigma(np.array([turn for _, turn in sigmas.values()]))
    return f"`joint_offsets: {{status: prior, sigma_rad: {sigma_rad}}}`"
