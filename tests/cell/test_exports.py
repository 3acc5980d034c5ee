"""A calibration's methods of export."""

from __future__ import annotations

import copy

import pytest

import basecal
from basecal.cell.exports import Exports
from basecal.exchange.exporters.registry import EXPORTERS
from export_example import BASE, CALIBRATION, CELL


def test_every_kind_is_declared():
    """As a method, which `dir` lists; `src/basecal/cell/exports.py` has a line for each, in the registry's order."""
    methods = [f"to_{kind}" for kind in EXPORTERS]
    assert list(Exports.__annotations__) == methods
    assert {*methods, "verdict", "between"} <= {*dir(CALIBRATION)}


def test_a_calibration_exports_itself():
    """By a method for each kind of export, named as the kind is; others are none."""
    for kind in EXPORTERS:
        assert callable(getattr(CALIBRATION, f"to_{kind}"))
    assert CALIBRATION.to_ur(BASE, cell=CELL) == basecal.export(CALIBRATION, "ur", BASE, cell=CELL)
    assert CALIBRATION.to_ros() == basecal.export(CALIBRATION, "ros")
    for name in ("to_sdf", "tour", "ur"):
        with pytest.raises(AttributeError, match=f"a calibration has no '{name}'"):
            getattr(CALIBRATION, name)
    assert copy.deepcopy(CALIBRATION).verdict == "good"
