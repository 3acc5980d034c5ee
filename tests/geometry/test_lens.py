"""Numbers that lenses share."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry.lens import any_nonzero, first_root, invert_map
from basecal.geometry.lenses import pinhole


def test_first_root() -> None:
    """The smallest positive root of a polynomial by rising powers, infinity where there is none."""
    assert first_root(np.array([1.0, -1.5, 0.5])) == pytest.approx(1.0)
    assert first_root(np.array([1.0, 0.0, 1.0])) == np.inf
    assert first_root(np.array([1.0, 1.0])) == np.inf
    assert first_root(np.array([1.0])) == np.inf
    assert first_root(np.array([1.0, -2.0, 0.0])) == pytest.approx(0.5)
    assert first_root(np.array([1.0, -1e-200])) == pytest.approx(1e200)


@pytest.mark.parametrize("number", [0.3, -0.3, np.array([0.0, 0.3])])
def test_any_number_may_be_other_than_zero(number: object) -> None:
    """Of one lens or of a batch."""
    assert any_nonzero([0.0, number])
    assert not any_nonzero([0.0, 0.0 * number])
    assert not any_nonzero([])


def test_images_beyond_a_fold_have_no_direction() -> None:
    """Up to a^2 + b^2 of the limit there is one, on every side; it is the direction whose image it is."""
    barrel = [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    limit = pinhole.fold(barrel)
    assert limit == pytest.approx(1 / 0.9)
    turn = np.linspace(0, 2 * np.pi, 12)
    for share, inside in ((0.0, True), (0.5, True), (0.99, True), (1.01, False), (1.5, False)):
        radius = np.sqrt(limit)
        edge = radius * (1 - 0.3 * limit)
        reach = share * radius * (1 - 0.3 * share**2 * limit) if inside else share * edge
        u, v = reach * np.cos(turn), reach * np.sin(turn)
        with np.errstate(all="ignore"):  # as a camera calls it
            rays, valid = invert_map(lambda a, b: pinhole.project_direction(a, b, barrel), u, v, limit)
        assert (valid == inside).all()
        if inside:
            wanted = share * radius * np.stack([np.cos(turn), np.sin(turn)], -1)
            np.testing.assert_allclose(rays[:, :2], wanted, atol=1e-9)
