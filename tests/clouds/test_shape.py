# SPDX-License-Identifier: Apache-2.0
"""Shapes of clouds: images are distinguished from stacked clouds."""

from __future__ import annotations

import numpy as np
import pytest

from doorstate._organized import is_image
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.clouds.shape import check_shape, check_single_cloud
from doorstate.errors import CloudContentError
from doorstate.types import Points
from tests.hand_made_clouds import image_of_a_rough_wall


def sampled_from(points: Points, seed: int) -> Points:
    shuffled = np.random.default_rng(seed).permutation(points)
    return prepare_cloud(shuffled, CloudSpec(num_points=512)).points


@pytest.mark.parametrize(
    ("cloud", "hint"),
    [
        (np.zeros((5, 4)), "x, y and z only"),
        (np.zeros((3, 500)), "transpose"),
        (np.zeros((3, 48, 64)), "transpose"),
        (np.zeros((48, 64)), "depth image"),
        (np.zeros(5, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4")]), "fields"),
        (np.zeros(3), None),
        (np.zeros((2, 2, 2, 3)), None),
        (np.array([["a", "b", "c"]]), None),
    ],
)
def test_other_shapes_and_types_are_refused(cloud: np.ndarray, hint: str | None) -> None:
    with pytest.raises(CloudContentError) as caught:
        check_shape(cloud)
    assert caught.value.expected is not None
    assert hint is None if caught.value.hint is None else hint and hint in caught.value.hint


def test_images_and_stacked_clouds() -> None:
    image = image_of_a_rough_wall(60, 80)
    assert check_single_cloud(image) is image
    assert check_single_cloud(image[:1]).shape == (80, 3), "one row is a list of points"
    holed = np.where(np.random.default_rng(0).random((60, 80, 1)) < 0.6, np.float32(np.nan), image)
    assert is_image(holed)
    assert is_image(np.full((60, 80, 3), np.nan)), "too few points to decide"
    stacked = np.stack([sampled_from(image.reshape(-1, 3), seed) for seed in range(4)])
    with pytest.raises(CloudContentError, match=r"\(4, 512, 3\)"):
        check_single_cloud(stacked)


@pytest.mark.parametrize("rows", [slice(None), slice(None, None, 7), slice(100, 3000)])
def test_stacked_clouds_in_pixel_order_are_no_image(rows: slice) -> None:
    flat = image_of_a_rough_wall(60, 80).reshape(-1, 3)[rows]
    for count in (2, 3, 8):
        assert not is_image(np.stack([flat] * count))
