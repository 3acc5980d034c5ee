"""Test that torment has a trial of each kind that can be chosen by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import pytest

from basecal.acquisition.drivers.registry import DRIVERS
from basecal.cli import _VERBS
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.importers.registry import IMPORTERS
from basecal.exchange.motions.writers import PLAN_FORMATS
from basecal.studies.solvers.registry import SOLVERS
from torment.run import TRIALS

_TRIALS = {
    "importers": "tests/torment/foreign.py",
    "exporters": "tests/torment/exports.py",
    "drivers": "tests/torment/others.py, or tests/torment/devices.py if it has a peer",
}
"""Where the trials of kinds are that others add."""
_NAMES: Mapping[str, str] = {
    "images": "image",
    "bag": "import bag",
    "industrial-calibration": "industrial",
    "robot-cal-tools": "industrial",
    "driver simulated": "replies",
    "detect": "command line",
    "simulate": "command line",
    "new": "command line",
    "report": "page",
    "target": "command line",
    "completion": "command line",
    "capture": "capture journal",
    "solver maximum_likelihood": "study, run",
    "solver closed_form": "study, run",
    "solver opencv": "study, run",
    "export": "export json",
}
"""Trials of another name than what they torment."""


@pytest.mark.parametrize(
    ("room", "kinds"),
    [
        ("verbs", _VERBS),
        ("importers", IMPORTERS),
        ("exporters", [f"export {kind}" for kind in EXPORTERS]),
        ("motions", [f"plan --to {kind}" for kind in PLAN_FORMATS]),
        ("drivers", [f"driver {kind}" for kind in DRIVERS]),
        ("solvers", [f"solver {kind}" for kind in SOLVERS]),
    ],
)
def test_every_kind_has_a_trial(room: str, kinds: Iterable[str]) -> None:
    """A new kind without a trial is reported."""
    assert not {kind for kind in kinds if _NAMES.get(kind, kind) not in TRIALS}
