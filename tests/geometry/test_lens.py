"""Tests of numerical functions shared by all lenses."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry import Array
from basecal.geometry.lens import Image, any_nonzero, first_root, invert_map
from basecal.geometry.lenses import pinhole


def test_first_root_of_a_polynomial() -> None:
    """The smallest positive root of a polynomial with ascending powers, or infinity without one."""
    assert first_root(np.array([1.0, -1.5, 0.5])) == pytest.approx(1.0)
    assert first_root(np.array([1.0, 0.0, 1.0])) == np.inf
    assert first_root(np.array([1.0, 1.0])) == np.inf
    assert first_root(np.array([1.0])) == np.inf
    assert first_root(np.array([1.0, -2.0, 0.0])) == pytest.approx(0.5)
    assert first_root(np.array([1.0, -1e-200])) == pytest.approx(1e200)


@pytest.mark.parametrize("number", [0.3, -0.3, np.array([0.0, 0.3])])
def test_any_nonzero_detects_nonzero_numbers(number: object) -> None:
    """Values of one lens or of a batch are accepted."""
    assert any_nonzero([0.0, number])
    assert not any_nonzero([0.0, 0.0 * number])
    assert not any_nonzero([])


def test_images_beyond_a_fold_are_invalid() -> None:
    """Images up to a^2 + b^2 of the limit have a direction on every side, and it projects to the image."""
    barrel = [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    limit = pinhole.fold(barrel)
    assert limit == pytest.approx(1 / 0.9)
    turn = np.linspace(0, 2 * np.pi, 12)
    for share, inside in ((0.0, True), (0.5, True), (0.99, True), (1.01, False), (1.5, False)):
        radius = np.sqrt(limit)
        edge = radius * (1 - 0.3 * limit)
        reach = share * radius * (1 - 0.3 * share**2 * limit) if inside else share * edge
        u, v = reach * np.cos(turn), reach * np.sin(turn)
        with np.errstate(all="ignore"):  # as in a camera's call
            rays, valid = invert_map(lambda a, b: pinhole.project_direction(a, b, barrel), u, v, limit)
        assert (valid == inside).all()
        if inside:
            wanted = share * radius * np.stack([np.cos(turn), np.sin(turn)], -1)
            np.testing.assert_allclose(rays[:, :2], wanted, atol=1e-9)


@pytest.mark.parametrize("slope", [0.3, 0.01])
def test_inversion_of_flat_maps_is_exact(slope: float) -> None:
    """The direction projects to the requested image, however small the determinant is."""
    wanted = np.linspace(0.0, 0.9, 7)

    def flat(a: Array, b: Array) -> Image:
        """A map with a small slope and a slight curvature."""
        zero = np.zeros_like(a)
        return Image(slope * (a + 0.2 * a**3), slope * b, slope * (1 + 0.6 * a * a), zero, zero, slope + zero)

    image = flat(wanted, 0.5 * wanted)
    rays, valid = invert_map(flat, image.u, image.v, 9.0)
    assert valid.all()
    np.testing.assert_allclose(rays[:, 0], wanted, atol=3e-12 / slope)
    np.testing.assert_allclose(rays[:, 1:], np.stack([0.5 * wanted, np.ones(7)], -1), atol=3e-12 / slope)


def test_mirrored_maps_are_invalid() -> None:
    """A mirrored map has no direction, nor has one rotated by 180 deg, though its determinant is positive."""
    at = np.linspace(-0.2, 0.2, 5)
    for sign_u, sign_v, is_valid in ((1, 1, True), (-1, 1, False), (1, -1, False), (-1, -1, False)):

        def mapped(a: Array, b: Array, sign_u: int = sign_u, sign_v: int = sign_v) -> Image:
            """A map that changes the signs of both coordinates."""
            zero = np.zeros_like(a)
            return Image(sign_u * a, sign_v * b, zero + sign_u, zero, zero, zero + sign_v)

        assert (invert_map(mapped, at, 0.5 * at, 1.0)[1] == is_valid).all()
