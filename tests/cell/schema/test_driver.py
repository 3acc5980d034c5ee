"""`driver:` of robots and cameras: a name and options, kept as they are."""

from __future__ import annotations

import pytest

from basecal.cell.schema.cell_dict import cell_to_dict
from basecal.cell.schema.cell_file import cell_from_dict
from basecal.errors import DatasetError

DATA = {
    "schema": "basecal/cell/1",
    "reference": "eye",
    "robots": {"eye": {"driver": {"kind": "typed", "notation": "kuka"}}},
    "cameras": {"wrist": {"on": "eye", "mount": {"status": "free"}, "model": "pinhole", "driver": {"kind": "opencv"}}},
}


def test_a_driver_is_read_and_written_back():
    """Its name and its options, whatever they are, come back as they were."""
    cell = cell_from_dict(DATA)
    assert (cell.robots["eye"].driver.kind, cell.robots["eye"].driver.options) == ("typed", {"notation": "kuka"})
    assert cell.cameras["wrist"].driver.options == {}
    assert cell_to_dict(cell) == DATA


@pytest.mark.parametrize("driver", [{}, {"kind": 3}, {"kind": "Typed robot"}, {"notation": "ur"}])
def test_a_driver_has_a_name(driver):
    """One without a name, or with a name that is none, is an error that says what was expected."""
    data = DATA | {"robots": {"eye": {"driver": driver}}}
    with pytest.raises(DatasetError, match=r"robots\.eye\.driver: expected `kind`"):
        cell_from_dict(data)
