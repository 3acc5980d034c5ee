"""What may be stated of any kind of robot parameters."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from basecal.cell import Parameters
from basecal.fields.values import Sigma


class Two(Parameters):
    sigma_b: Sigma | None = None
    sigma_a: Sigma | None = None


def test_a_prior_has_all_its_sigmas_and_nothing_else_has_one():
    """What is lacking or too much is named."""
    assert Two().status == "fixed"
    assert Two(status="prior", sigma_a=1.0, sigma_b=2.0).sigma_b == 2.0
    for fields, said in (
        ({"status": "prior", "sigma_a": 1.0}, "status prior takes sigma_a and sigma_b, got sigma_a"),
        ({"status": "prior"}, "takes sigma_a and sigma_b, got none"),
        ({"status": "free", "sigma_a": 1.0}, "status free takes no sigma, got sigma_a"),
        ({"sigma_b": 1.0}, "status fixed takes no sigma, got sigma_b"),
    ):
        with pytest.raises(ValidationError, match=said):
            Two(**fields)
