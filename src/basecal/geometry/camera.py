"""Camera model: projection of points to pixels, and its inverse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from basecal.errors import InputError
from basecal.geometry.array import Array, BoolArray, ReadOnlyArrays, read_only, to_back, to_front, with_last_axis
from basecal.geometry.lens import Lens, Number, Projection
from basecal.geometry.lenses.registry import find_lens, term_counts


@dataclass(frozen=True, eq=False)
class Camera(ReadOnlyArrays):
    """Lens and image size of a camera; x right, y down, z forward; the centre of the top-left pixel is (0, 0).

    Attributes:
        model: Name of a lens model, such as `pinhole` (Brown-Conrady) or `fisheye` (Kannala-Brandt).
        parameters: (..., 4 + k) fx, fy, cx, cy [px] and k distortion terms of the model. Leading axes are a batch of
            lenses, aligned with the leading axes of projected points.
        size_px: Width and height [px]; None if not known.

    Raises:
        InputError: if the model is not known, a parameter is not finite, or a focal length or the size is not positive.
            It is also raised if the number of distortion terms does not suit the model.
    """

    model: str
    parameters: Array
    size_px: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", read_only(self.parameters, (None,), "camera parameters"))
        terms = term_counts(self.model)
        if self.parameters.shape[-1] - 4 not in terms:
            expected = f"expected fx, fy, cx, cy and {' or '.join(map(str, terms))} distortion terms"
            raise InputError(f"camera parameters have shape {self.parameters.shape}, {expected}")
        if not np.all(np.isfinite(self.parameters)):
            raise InputError("camera parameters hold NaN or infinity")
        if not np.all(self.parameters[..., :2] > 0):
            fx, fy = self.parameters[..., :2].reshape(-1, 2).min(0)
            raise InputError(f"the focal lengths are {fx:g} and {fy:g} px, expected both above 0")
        if self.size_px is not None and not (len(self.size_px) == 2 and min(self.size_px) > 0):
            raise InputError(f"size_px is {self.size_px}, expected a positive width and height")

    @property
    def _lens(self) -> Lens:
        return find_lens(self.model, self.parameters.shape[-1] - 4)

    @property
    def focal(self) -> Array:
        """Focal lengths fx and fy, (..., 2) [px]."""
        return self.parameters[..., :2]

    @property
    def center(self) -> Array:
        """Principal point cx and cy, (..., 2) [px]."""
        return self.parameters[..., 2:4]

    @property
    def matrix(self) -> Array:
        """Camera matrix of a single lens, (3, 3) [px]."""
        (fx, fy), (cx, cy) = self.focal, self.center
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    @property
    def distortion(self) -> Array:
        """Distortion terms in the order of the model, (..., k)."""
        return self.parameters[..., 4:]

    @property
    def term_sigmas(self) -> Array:
        """Typical distortion terms of real lenses, (k,): 1 sigma about zero, infinite if not known."""
        sigmas, count = self._lens.TERM_SIGMAS, self.distortion.shape[-1]
        return np.array(sigmas[:count]) if count <= len(sigmas) else np.full(count, np.inf)

    def __getitem__(self, index: Any) -> Camera:
        """Select lenses of the batch."""
        selected = object.__new__(Camera)  # parts of checked parameters need no check
        selected.__dict__.update(model=self.model, parameters=self.parameters[index], size_px=self.size_px)
        return selected

    def with_parameters(self, parameters: ArrayLike) -> Camera:
        """Return a camera of the same model and size with other `parameters`, (..., 4 + k).

        Raises:
            InputError: see `Camera`.
        """
        return Camera(self.model, read_only(parameters, name="parameters"), self.size_px)

    def project(self, points_in_camera: Array) -> Array:
        """Project points to pixels.

        Args:
            points_in_camera: (..., 3) [m].

        Returns:
            (..., 2) [px]; NaN if z <= 0, for a fisheye only on the axis. Pixels beyond the fold of the lens are
            finite but not those of a real lens: see `sees`.

        Raises:
            InputError: if the last axis is not 3.

        Source: geometry/lenses; docs/mathematics.md (2.3)-(2.6).
        """
        points = with_last_axis(points_in_camera, 3, "points_in_camera")
        with np.errstate(all="ignore"):
            parameters = _broadcast_parameters(self.parameters, points)
            return _pixels(*self._lens.project(points, parameters[4:]), parameters)

    def project_with_derivatives(
        self, points_in_camera: Array, intrinsics: bool = False
    ) -> tuple[Array, Array, Array | None]:
        """Project points to pixels, with derivatives.

        Args:
            points_in_camera: (..., 3) [m].
            intrinsics: Whether to return the derivative with respect to the parameters too.

        Returns:
            Pixels, (..., 2) [px], as `project`.
            Derivative with respect to the point, (..., 2, 3) [px/m].
            Derivative with respect to `parameters`, (..., 2, 4 + k), or None.

        Raises:
            InputError: if the last axis is not 3.
        """
        pixels, image = self.image(points_in_camera, intrinsics)
        by_parameters = None if image.by_terms is None else _parameter_derivative(image.u, image.v, image.by_terms)
        return pixels, image.by_points, by_parameters

    def image(self, points_in_camera: Array, with_terms: bool) -> tuple[Array, Projection]:
        """Project points to pixels, (..., 2) [px], as `project`, and to the plane at unit distance.

        The projection includes the derivatives of the pixels, also by the distortion terms if `with_terms`. The
        derivatives by fx and fy are u and v, by cx and cy 1.

        Raises:
            InputError: if the last axis is not 3.
        """
        points = with_last_axis(points_in_camera, 3, "points_in_camera")
        parameters = _broadcast_parameters(self.parameters, points)
        with np.errstate(all="ignore"):
            image = self._lens.project_with_derivatives(
                points, (parameters[0], parameters[1]), parameters[4:], with_terms
            )
            return _pixels(image.u, image.v, parameters), image

    def undistort(self, pixels: Array) -> tuple[Array, BoolArray]:
        """Back-project pixels of a single lens to directions.

        Args:
            pixels: (..., 2) [px].

        Returns:
            Unit directions in the camera's axes, (..., 3); NaN if not valid.
            Valid, (...,): whether the pixel is inside the fold, the radius up to which the lens polynomial increases.

        Raises:
            InputError: if the last axis is not 2.
        """
        plane = (with_last_axis(pixels, 2, "pixels") - self.center) / self.focal
        with np.errstate(all="ignore"):
            rays, valid = self._lens.unproject(plane[..., 0], plane[..., 1], self.distortion.tolist())
            unit = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return np.where(valid[..., None], unit, np.nan), valid

    def sees(self, points_in_camera: Array) -> BoolArray:
        """Whether points, (..., 3) [m], are inside the fold of the lens and, if its size is known, the image, (...,).

        Raises:
            InputError: if the last axis is not 3.
        """
        points = with_last_axis(points_in_camera, 3, "points_in_camera")
        with np.errstate(all="ignore"):
            seen = self._lens.domain_mask(points, self.distortion.tolist())
        if self.size_px is None:
            return seen
        pixels = self.project(points)
        inside: BoolArray = seen & np.all((pixels >= -0.5) & (pixels < np.array(self.size_px) - 0.5), axis=-1)
        return inside


def _broadcast_parameters(parameters: Array, points: Array) -> list[Number]:
    """Parameters that broadcast against values (...,) of points (..., 3): numbers, or arrays over the lenses."""
    if parameters.ndim == 1:
        numbers: list[Number] = parameters.tolist()
        return numbers
    trailing = (1,) * (points.ndim - parameters.ndim)
    return [each.reshape(each.shape + trailing) for each in to_front(parameters, -1)]


def _pixels(u: Array, v: Array, parameters: list[Number]) -> Array:
    fx, fy, cx, cy = parameters[:4]
    out = np.empty((2, *u.shape))
    np.add(fx * u, cx, out=out[0, ...])
    np.add(fy * v, cy, out=out[1, ...])
    return to_back(out)


def _parameter_derivative(u: Array, v: Array, term_derivative: Array) -> Array:
    """Derivative of the pixels with respect to fx, fy, cx, cy and the distortion terms, (..., 2, 4 + k)."""
    out = to_back(np.empty((2, 4 + term_derivative.shape[-1], *u.shape)), 2)
    for row, coordinate in enumerate((u, v)):
        out[..., row, row], out[..., row, 1 - row] = coordinate, 0.0
        out[..., row, 2 + row], out[..., row, 3 - row] = 1.0, 0.0
    out[..., 4:] = term_derivative
    return out
