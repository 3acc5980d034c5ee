"""Tests of the validation of scenarios."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.simulation.scenario import Scenario
from shared.study_defaults import documented_defaults

CHOICES = ("target", "arms", "layout", "lens", "base", "camera_mount", "target_mount", "intrinsics")
PARAMETERS = ("joint_offsets", "link_parameters", "deflection")


@pytest.mark.parametrize("name", [*CHOICES, *PARAMETERS])
def test_unknown_choice_is_refused(name):
    """The error names the field, its value, and the possible values including the default."""
    with pytest.raises(InputError, match=rf"^{name} is 'unheard-of', expected one of: .*{getattr(Scenario(), name)}"):
        Scenario(**{name: "unheard-of"})


@pytest.mark.parametrize("counts", [{"samples": 0}, {"stations": 0}, {"robots": 1}])
def test_counts_have_a_minimum(counts):
    """A count below the minimum is an error, the minimum is not."""
    ((name, count),) = counts.items()
    for value in (count, count + 1.5):
        with pytest.raises(InputError, match=rf"^{name} is {value}, expected a whole number >= {count + 1}$"):
            Scenario(**{name: value})
    Scenario(**{name: count + 1})


@pytest.mark.parametrize("distances", [(1, 0.5), (0.0, 0.5), (0.5, float("nan")), (0.5, float("inf"))])
def test_distances_must_increase(distances):
    """Distances must be positive and not decreasing; both may be equal."""
    with pytest.raises(InputError, match=r"^distance_m is .*, expected the least and then the greatest distance > 0$"):
        Scenario(distance_m=distances)
    assert Scenario(distance_m=(0.5, 0.5)).distance_m == (0.5, 0.5)


@pytest.mark.parametrize("pair", [1e-3, (1e-3,), "x"])
@pytest.mark.parametrize("name", ["robot_noise", "pose_noise", "link_error", "distance_m"])
def test_pairs_require_two_numbers(name, pair):
    """Sigmas of translation and rotation, and ranges, require two numbers."""
    with pytest.raises(InputError, match=rf"^{name} is .*, expected two numbers$"):
        Scenario(**{name: pair})


@pytest.mark.parametrize("value", [-1e-9, float("nan")])
@pytest.mark.parametrize(
    "name",
    ["pixel_px", "correlated_px", "point_m", "joint_offset_rad", "compliance", "spread_rad", "position_m"],
)
def test_negative_or_nan_sigma_is_refused(name, value):
    """Sigmas and spreads must be numbers and not negative; zero is allowed."""
    with pytest.raises(InputError, match="must be numbers >= 0"):
        Scenario(**{name: value})
    assert getattr(Scenario(**{name: 0.0}), name) == 0


@pytest.mark.parametrize("name", ["robot_noise", "pose_noise", "link_error"])
@pytest.mark.parametrize("place", [0, 1])
def test_negative_sigma_in_pair_is_refused(name, place):
    """Neither the sigma of translation nor that of rotation may be negative."""
    pair = np.full(2, 1e-3)
    pair[place] = -1e-3
    with pytest.raises(InputError, match="must be numbers >= 0"):
        Scenario(**{name: tuple(pair)})


def test_defaults_match_documentation():
    """The defaults of a scenario are the documented ones of a study, for all fields that both have."""
    stated = {name: value for name, value in documented_defaults().items() if hasattr(Scenario(), name)}
    assert len(stated) > 12
    del stated["distance_m"]  # a study states its mean
    assert {name: getattr(Scenario(), name) for name in stated} == stated
