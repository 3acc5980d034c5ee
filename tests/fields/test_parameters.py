"""Tests of the statuses and sigmas that any kind of robot parameters accepts."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from basecal.cell import Parameters
from basecal.fields.values import Sigma


class Two(Parameters):
    sigma_b: Sigma | None = None
    sigma_a: Sigma | None = None


def test_sigmas_match_status():
    """A prior needs all its sigmas and every other status takes none; the error names missing and surplus ones."""
    assert Two().status == "fixed"
    assert Two(status="prior", sigma_a=1.0, sigma_b=2.0).sigma_b == 2.0
    for fields, message in (
        ({"status": "prior", "sigma_a": 1.0}, "status prior takes sigma_a and sigma_b, got sigma_a"),
        ({"status": "prior"}, "takes sigma_a and sigma_b, got none"),
        ({"status": "free", "sigma_a": 1.0}, "status free takes no sigma, got sigma_a"),
        ({"sigma_b": 1.0}, "status fixed takes no sigma, got sigma_b"),
    ):
        with pytest.raises(ValidationError, match=message):
            Two(**fields)
