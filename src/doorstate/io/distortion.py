# SPDX-License-Identifier: Apache-2.0
"""Lens distortion of images that are not rectified: from pixels to the rays of a pinhole.

Models and the order of their coefficients are those of OpenCV and ROS: `plumb_bob` (k1 k2 p1 p2 k3),
`rational_polynomial` (k1 k2 p1 p2 k3 k4 k5 k6) and `equidistant` (k1 k2 k3 k4), the fisheye of Kannala and Brandt
(2006). The inverse is found by Newton's method to the last bits, not by a fixed number of steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from doorstate.errors import CameraError

Array = NDArray[np.float64]

# Names of ROS, Kalibr, OpenCV and RealSense.
_MODELS = {
    "plumb_bob": "plumb_bob",
    "radtan": "plumb_bob",
    "brown_conrady": "plumb_bob",
    "rational_polynomial": "rational_polynomial",
    "equidistant": "equidistant",
    "fisheye": "equidistant",
    "kannala_brandt4": "equidistant",
}
_COEFFICIENTS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}
_STEPS = 20  # each doubles the number of right digits
_TOLERANCE = 1e-9  # of a ray, a millionth of a pixel
_NEGLIGIBLE = 1e-12
_LARGEST = 1e6  # of a coefficient; those of lenses are below 100


@dataclass(frozen=True)
class Distortion:
    """Distortion of a lens.

    Args:
        model: `plumb_bob`, `rational_polynomial` or `equidistant`.
        coefficients: as many as the model has.
    """

    model: str
    coefficients: tuple[float, ...]

    def apply(self, rays: Array) -> Array:
        """Return the distorted image coordinates (..., 2) of rays (..., 2) at unit depth."""
        if self.model == "equidistant":
            radius = np.linalg.norm(rays, axis=-1, keepdims=True)
            ratio = np.divide(
                _fisheye_radius(np.arctan(radius), self.coefficients),
                radius,
                out=np.ones_like(radius),
                where=radius > 0,
            )
            distorted: Array = rays * ratio
            return distorted
        return _polynomial(rays, self.coefficients)[0]

    def undo(self, distorted: Array) -> Array:
        """Return the rays (..., 2) at unit depth of distorted image coordinates (..., 2).

        NaN where no ray reaches a pixel: beyond 90 degrees, or where the model folds.
        """
        with np.errstate(all="ignore"):
            if self.model == "equidistant":
                return _undo_fisheye(distorted, self.coefficients)
            return _undo_polynomial(distorted, self.coefficients)


def parse_distortion(model: str, coefficients: Sequence[float]) -> Distortion | None:
    """Return the distortion of a camera; None if all coefficients are 0.

    Args:
        model: name in ROS, Kalibr, OpenCV or RealSense; empty: that of OpenCV with this number of coefficients.
        coefficients: as stored; missing ones are 0.

    Raises:
        CameraError: another model, or coefficients that it does not have.
    """
    if not all(abs(coefficient) <= _LARGEST for coefficient in coefficients):  # also for NaN
        raise CameraError("distortion coefficients are impossible", expected=f"at most {_LARGEST:g}")
    if not any(coefficients):
        return None
    name = model.rpartition(".")[2].lower()
    if not name:
        name = "plumb_bob" if len(coefficients) <= 5 else "rational_polynomial"
    if name not in _MODELS:
        raise CameraError(
            f"distortion of the model {model!r} cannot be undone",
            expected=f"{', '.join(_COEFFICIENTS)}, or a rectified image",
        )
    standard = _MODELS[name]
    if standard == "plumb_bob" and len(coefficients) > 5:
        standard = "rational_polynomial"
    count = _COEFFICIENTS[standard]
    if any(coefficients[count:]):
        raise CameraError(
            f"distortion with {len(coefficients)} coefficients (thin prism, tilt) cannot be undone",
            expected=f"at most {count} of {standard}, or a rectified image",
        )
    padded = (*coefficients[:count], *(0.0 for _ in range(count - len(coefficients))))
    return Distortion(standard, tuple(float(number) for number in padded))


def _polynomial(rays: Array, coefficients: Sequence[float]) -> tuple[Array, Array]:
    """Return distorted coordinates (..., 2) and their derivatives (..., 2, 2) of plumb_bob or rational_polynomial."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*coefficients, 0.0, 0.0, 0.0)[:8]
    x, y = rays[..., 0], rays[..., 1]
    square = x * x + y * y
    above = 1 + square * (k1 + square * (k2 + square * k3))
    below = 1 + square * (k4 + square * (k5 + square * k6))
    scale = above / below
    slope = (
        k1 + square * (2 * k2 + 3 * square * k3) - scale * (k4 + square * (2 * k5 + 3 * square * k6))
    ) / below  # of the scale, by the square of the radius
    distorted = np.stack(
        (
            x * scale + 2 * p1 * x * y + p2 * (square + 2 * x * x),
            y * scale + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
        ),
        axis=-1,
    )
    mixed = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
    along_x = scale + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
    along_y = scale + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
    return distorted, np.stack((np.stack((along_x, mixed), -1), np.stack((mixed, along_y), -1)), -2)


def _undo_polynomial(distorted: Array, coefficients: Sequence[float]) -> Array:
    rays = distorted.copy()
    for _ in range(_STEPS):
        found, derivatives = _polynomial(rays, coefficients)
        error = found - distorted
        if not (np.abs(error) > _TOLERANCE).any():
            break
        (along_x, mixed), (_, along_y) = np.moveaxis(derivatives, (-2, -1), (0, 1))
        determinant = along_x * along_y - mixed * mixed
        step = np.stack(
            (
                along_y * error[..., 0] - mixed * error[..., 1],
                along_x * error[..., 1] - mixed * error[..., 0],
            ),
            axis=-1,
        )
        rays = rays - step / determinant[..., None]
    exact = (np.abs(_polynomial(rays, coefficients)[0] - distorted) <= _TOLERANCE).all(axis=-1)
    seen = exact & ((rays**2).sum(axis=-1) < _fold_of_polynomial(coefficients))
    return np.where(seen[..., None], rays, np.nan)


def _fold_of_polynomial(coefficients: Sequence[float]) -> float:
    """Return the square of the radius at which r scale(r^2) stops to grow; beyond, the model means nothing."""
    k1, k2, _, _, k3, k4, k5, k6 = (*coefficients, 0.0, 0.0, 0.0)[:8]
    above, below = Polynomial((1, k1, k2, k3)), Polynomial((1, k4, k5, k6))
    square = Polynomial((0, 1))
    slope = above * below + 2 * square * (above.deriv() * below - above * below.deriv())
    return min(_first_root(slope), _first_root(below))


def _first_root(polynomial: Polynomial) -> float:
    """Return the smallest positive real root, or infinity."""
    roots = polynomial.trim(_NEGLIGIBLE).roots()
    real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
    return float(real.min()) if len(real) else math.inf


def _fisheye_radius(angle: Array, coefficients: Sequence[float]) -> Array:
    k1, k2, k3, k4 = coefficients
    square = angle * angle
    return angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))


def _undo_fisheye(distorted: Array, coefficients: Sequence[float]) -> Array:
    k1, k2, k3, k4 = coefficients
    radius = np.linalg.norm(distorted, axis=-1)
    slope_of_square = Polynomial((1, 3 * k1, 5 * k2, 7 * k3, 9 * k4))
    angle = radius.copy()
    for _ in range(_STEPS):
        error = _fisheye_radius(angle, coefficients) - radius
        if not (np.abs(error) > _TOLERANCE).any():
            break
        angle = angle - error / slope_of_square(angle * angle)
    exact = np.abs(_fisheye_radius(angle, coefficients) - radius) <= _TOLERANCE
    largest = min(math.sqrt(_first_root(slope_of_square)), math.pi / 2)
    seen = exact & (angle >= 0) & (angle < largest)
    ratio = np.where(radius > 0, np.tan(angle) / radius, 1.0)
    return np.where(seen[..., None], distorted * ratio[..., None], np.nan)
