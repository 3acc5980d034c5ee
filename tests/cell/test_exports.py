"""Tests of the export methods of a calibration."""

from __future__ import annotations

import copy

import pytest

import basecal
from basecal.cell.exports import Exports
from basecal.exchange.exporters.registry import EXPORTERS
from export_example import BASE, CALIBRATION, CELL


def test_every_export_kind_is_declared():
    """Each kind is a method that `dir` lists; `src/basecal/cell/exports.py` declares them in the registry's order."""
    methods = [f"to_{kind}" for kind in EXPORTERS]
    assert list(Exports.__annotations__) == methods
    assert {*methods, "verdict", "between"} <= {*dir(CALIBRATION)}


def test_calibration_has_export_method_per_kind():
    """Each kind of export has a method named after it, equal to `basecal.export`; other names raise AttributeError."""
    for kind in EXPORTERS:
        assert callable(getattr(CALIBRATION, f"to_{kind}"))
    assert CALIBRATION.to_ur(BASE, cell=CELL) == basecal.export(CALIBRATION, "ur", BASE, cell=CELL)
    assert CALIBRATION.to_ros() == basecal.export(CALIBRATION, "ros")
    for name in ("to_sdf", "tour", "ur"):
        with pytest.raises(AttributeError, match=f"a calibration has no '{name}'"):
            getattr(CALIBRATION, name)
    assert copy.deepcopy(CALIBRATION).verdict == "good"
