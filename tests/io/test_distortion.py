# SPDX-License-Identifier: Apache-2.0
"""Distortion and its inverse; coefficients are those of real lenses, and wider."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from doorstate.errors import CameraError
from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.io.distortion import Distortion, parse_distortion

GRID = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 25), np.linspace(-0.45, 0.45, 19)), axis=-1)
COLOUR = (-0.36, 0.15, 0.0005, -0.0002, 0.0)
AZURE = (0.62, -2.9, 0.0007, -0.0001, 1.68, 0.5, -2.7, 1.6)  # rational, as of an Azure Kinect's colour camera
FISHEYE = (-0.01, 0.02, -0.015, 0.003)

SMALL = st.floats(-0.1, 0.1)
TANGENTIAL = st.floats(-0.002, 0.002)
MODELS = st.one_of(
    st.builds(
        lambda *k: Distortion("plumb_bob", k), st.floats(-0.2, 0.2), SMALL, TANGENTIAL, TANGENTIAL, SMALL
    ),
    st.builds(
        lambda *k: Distortion("rational_polynomial", k),
        *(SMALL, SMALL, TANGENTIAL, TANGENTIAL, SMALL, SMALL, SMALL, SMALL),
    ),
    st.builds(lambda *k: Distortion("equidistant", k), SMALL, SMALL, SMALL, SMALL),
)


def plain(model: str, k: tuple[float, ...], x: float, y: float) -> tuple[float, float]:
    """Return distorted coordinates as the formulas of OpenCV's calib3d documentation give them."""
    r2 = x * x + y * y
    if model == "equidistant":
        theta = math.atan(math.sqrt(r2))
        theta_d = theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8)
        scale = theta_d / math.sqrt(r2) if r2 else 1.0
        return x * scale, y * scale
    k1, k2, p1, p2, k3, k4, k5, k6 = (*k, 0.0, 0.0, 0.0)[:8]
    scale = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    return (
        x * scale + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * scale + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


@given(MODELS)
@settings(max_examples=60)
def test_rays_come_back_through_the_lens(lens: Distortion) -> None:
    distorted = np.array(
        [[plain(lens.model, lens.coefficients, *ray) for ray in row] for row in GRID.tolist()]
    )
    np.testing.assert_allclose(lens.apply(GRID), distorted, atol=1e-12)
    np.testing.assert_allclose(lens.undo(distorted), GRID, atol=1e-7)


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [("plumb_bob", COLOUR), ("rational_polynomial", AZURE), ("equidistant", FISHEYE)],
)
def test_a_wall_is_flat_and_its_door_has_its_width(model: str, coefficients: tuple[float, ...]) -> None:
    lens = Distortion(model, coefficients)
    camera = Intrinsics(64, 48, 55.0, 55.0, 32.5, 23.0, lens)
    points = depth_to_points(np.full((48, 64), 2.0), camera)
    assert (points[..., 0] == 2).all()
    # The corners of a door frame, 0.9 m apart, are imaged through the lens.
    corners = np.array([[-0.45, 0.3], [0.45, 0.3]]) / 2.0
    pixels = lens.apply(corners) * 55.0 + (32.5, 23.0)
    nearest = points[pixels[:, 1].round().astype(int), pixels[:, 0].round().astype(int), 1:]
    pixel_m = 2.0 / 55.0
    np.testing.assert_allclose(nearest, -corners * 2.0, atol=pixel_m)
    ignored = depth_to_points(np.full((48, 64), 2.0), Intrinsics(64, 48, 55.0, 55.0, 32.5, 23.0))
    assert np.abs(points - ignored)[0, 0].max() > pixel_m / 4


def test_pixels_that_no_ray_reaches_are_not_measured() -> None:
    folded = Distortion("plumb_bob", (-0.5, 0.0, 0.0, 0.0, 0.0))  # grows up to a radius of 0.82
    assert np.isnan(folded.undo(np.array([[0.6, 0.0], [3.0, 0.0], [np.nan, 0.0]]))).all()
    np.testing.assert_allclose(folded.undo(np.array([[0.5, 0.0]])), [[0.6180339887, 0.0]], atol=1e-9)
    fisheye = Distortion("equidistant", (0.0, 0.0, 0.0, 0.0))
    assert np.isnan(fisheye.undo(np.array([[1.6, 0.0]]))).all()  # behind the camera
    points = depth_to_points(np.ones((3, 9)), Intrinsics(9, 3, 2.0, 2.0, 4.0, 1.0, fisheye))
    assert np.isnan(points[1, 0]).all()
    assert np.isfinite(points[1, 1:8]).all()


def test_names_of_other_tools_and_zeros() -> None:
    assert parse_distortion("plumb_bob", [0, 0, 0, 0, 0]) is None
    assert parse_distortion("none", []) is None
    assert parse_distortion("radtan", [0.1, 0.2, 0, 0]) == Distortion("plumb_bob", (0.1, 0.2, 0, 0, 0))
    assert parse_distortion("distortion.brown_conrady", [0.1]) == Distortion("plumb_bob", (0.1, 0, 0, 0, 0))
    assert parse_distortion("", COLOUR) == Distortion("plumb_bob", COLOUR)
    assert parse_distortion("", [*AZURE, 0, 0, 0, 0]) == Distortion("rational_polynomial", AZURE)
    assert parse_distortion("plumb_bob", AZURE) == Distortion("rational_polynomial", AZURE)


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("distortion.inverse_brown_conrady", [0.1, 0, 0, 0, 0]),
        ("fov", [0.9]),
        ("rational_polynomial", [*AZURE, 0.1, 0, 0, 0]),
        ("equidistant", [0.1, 0, 0, 0, 0.2]),
        ("plumb_bob", [math.nan]),
    ],
)
def test_what_cannot_be_undone_is_refused(model: str, coefficients: list[float]) -> None:
    with pytest.raises(CameraError):
        parse_distortion(model, coefficients)
