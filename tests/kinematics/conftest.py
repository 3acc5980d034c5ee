from pathlib import Path

import pytest

from basecal.kinematics import read_chain

FOLDER = Path(__file__).parents[1] / "data" / "urdf"
ARMS = {"six_axis": ("base_link", "tool0"), "seven_axis": ("pedestal", "hand")}


@pytest.fixture
def folder():
    return FOLDER


@pytest.fixture(params=ARMS)
def arm(request):
    """File, base link and flange link of a synthetic arm."""
    return FOLDER / f"{request.param}.urdf", *ARMS[request.param]


@pytest.fixture
def chain(arm):
    return read_chain(*arm)
