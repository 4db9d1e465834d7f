# SPDX-License-Identifier: Apache-2.0
"""Farthest point order against a plain double loop; fpsample, torch-quickfps and NumPy give the same indices."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from doorstate.clouds.device_sampling import device_sampler, farthest_points
from doorstate.clouds.preparation import CloudSpec, prepare_cloud
from doorstate.clouds.samplers import NUMPY, Sampler, find_fpsample, find_torch_quickfps
from doorstate.clouds.sampling import farthest_point_indices
from doorstate.io.camera import Intrinsics
from doorstate.io.depth import depth_to_points
from doorstate.simulation.frames import replay
from doorstate.simulation.presets import PRESETS, draw_rows
from doorstate.types import Indices, Points

GAZEBO = Path(__file__).resolve().parents[1] / "fixtures" / "gazebo"
COMPILED: dict[str, Callable[[], Sampler | None]] = {
    "fpsample": find_fpsample,
    "torch-quickfps": find_torch_quickfps,
    "torch": lambda: device_sampler(torch.device("cpu")),
    "cuda": lambda: device_sampler(torch.device("cuda")) if torch.cuda.is_available() else None,
}


def compiled_sampler(library: str) -> Sampler:
    return COMPILED[library]() or pytest.skip(f"{library} is not installed")


@pytest.fixture(scope="module", params=["numpy", *COMPILED])
def sampler(request: pytest.FixtureRequest) -> Sampler:
    return NUMPY if request.param == "numpy" else compiled_sampler(request.param)


@pytest.fixture(scope="module", params=list(COMPILED))
def compiled(request: pytest.FixtureRequest) -> Sampler:
    return compiled_sampler(request.param)


def plain_order(points: Points, count: int) -> list[int]:
    """Plain double loop in float32, starting with the point farthest from below and behind the cloud."""
    lowest = points.min(axis=0)
    anchor = lowest - np.float32(np.linalg.norm(points.max(axis=0) - lowest) + 1.0)
    nearest = [squared(point, anchor) for point in points]
    chosen = [int(np.argmax(nearest))]
    nearest = [np.float32(np.inf)] * len(points)
    while len(chosen) < count:
        for index, point in enumerate(points):
            nearest[index] = min(nearest[index], squared(point, points[chosen[-1]]))
        chosen.append(int(np.argmax(nearest)))
    return chosen


def squared(one: Points, other: Points) -> np.float32:
    x, y, z = one - other
    return x * x + y * y + z * z


def distances_to_earlier(points: NDArray[np.floating], order: Indices) -> tuple[list[float], list[float]]:
    """Return the squared distance of each chosen point to the points before it, and the largest of all points then."""
    nearest = np.full(len(points), np.inf, points.dtype)
    own, largest = [], []
    for before, index in itertools.pairwise(order):
        away = points - points[before]
        x, y, z = away.T
        nearest = np.minimum(nearest, x * x + y * y + z * z)
        own.append(float(nearest[index]))
        largest.append(float(nearest.max()))
    return own, largest


def random_cloud(seed: int, count: int) -> Points:
    return np.random.default_rng(seed).normal(size=(count, 3)).astype(np.float32)


def gazebo_cloud(number: int) -> Points:
    camera = json.loads((GAZEBO / "scenes.json").read_text(encoding="utf-8"))[number]["intrinsics"]
    with np.load(GAZEBO / "depth.npz") as stored:
        depth = stored["depth"][number]
    intrinsics = Intrinsics.from_hfov(camera["width"], camera["height"], math.radians(camera["hfov_deg"]))
    points = depth_to_points(depth, intrinsics).reshape(-1, 3)
    return points[np.isfinite(points).all(axis=1)]


def simulated_cloud(index: int, count: int) -> Points:
    return prepare_cloud(
        replay(draw_rows(PRESETS["ogurob"], 0, index)[1]).points, CloudSpec(num_points=count)
    ).points


@pytest.mark.parametrize(("seed", "count"), [(0, 1), (1, 2), (2, 3), (3, 40), (4, 200)])
def test_equals_the_double_loop(sampler: Sampler, seed: int, count: int) -> None:
    points = random_cloud(seed, count)
    assert farthest_point_indices(points, min(count, 60), sampler).tolist() == plain_order(
        points, min(count, 60)
    )


def test_a_tree_of_several_leaves_changes_nothing(sampler: Sampler) -> None:
    points = random_cloud(5, 9000)
    order = farthest_point_indices(points, 400, sampler)
    own, largest = distances_to_earlier(points, order)
    assert own == largest
    assert order[0] == plain_order(points, 1)[0]


def test_an_order_computed_by_hand() -> None:
    line = np.zeros((4, 3), np.float32)
    line[:, 0] = [0, 1, 2, 3]
    # 1 and 2 are equally far from both ends: without a tree the lower row goes first.
    assert NUMPY.choose(line, 4, 0).tolist() == [0, 3, 1, 2]
    line[:, 0] = [0, 1, 0, 1]
    assert NUMPY.choose(line, 4, 0).tolist() == [0, 1, 0, 0]


def test_starts_at_the_point_farthest_from_below_and_behind(sampler: Sampler) -> None:
    points = np.array([[0, 0, 0], [5, 0, 0], [4, 4, 4], [0, 6, 0]], np.float32)
    assert farthest_point_indices(points, 1, sampler).tolist() == [2]


@st.composite
def clouds(draw: st.DrawFn) -> Points:
    """Random clouds, on a coarse lattice (ties), with repeated points, in one place, or tiny."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.sampled_from([1, 2, 3, 4, 5, 17, 300, 2047, 5000]))
    kind = draw(st.sampled_from(["random", "lattice", "plane", "repeated", "one place", "off centre"]))
    points = rng.normal(size=(count, 3))
    if kind == "lattice":
        points = rng.integers(0, 5, (count, 3))
    elif kind == "plane":
        points = rng.integers(-20, 20, (count, 3)) * [0.1, 0.1, 0.0]
    elif kind == "repeated":
        points = points[rng.integers(0, max(1, count // 3), count)]
    elif kind == "one place":
        points[:] = points[0]
    elif kind == "off centre":
        points = points * [1, 1e-3, 50] + [1000, 0, -5]
    return points.astype(np.float32)


@given(points=clouds())
@settings(max_examples=60)
def test_all_implementations_give_the_same_indices(compiled: Sampler, points: Points) -> None:
    count = min(len(points), 150)
    expected = farthest_point_indices(points, count, NUMPY)
    np.testing.assert_array_equal(farthest_point_indices(points, count, compiled), expected)


def test_all_implementations_split_their_trees_alike_where_points_lie_on_the_mean(compiled: Sampler) -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        points = rng.integers(0, 4, (int(rng.integers(8, 33)), 3)).astype(np.float32)
        points[0] = -1  # lowest on every axis, as the anchor is
        height = int(rng.integers(1, 4))
        np.testing.assert_array_equal(compiled(points, 8, height), NUMPY(points, 8, height))


def test_all_implementations_split_their_trees_alike_where_float32_sums_drift(compiled: Sampler) -> None:
    rng = np.random.default_rng(0)
    points = rng.integers(0, 4, (20_000, 3)).astype(np.float32)
    points[:, 0] = 0.1  # the running sum of these is not their number times 0.1
    points[0], points[1] = (-20, -1, -1), (20.2, 4, 4)
    np.testing.assert_array_equal(compiled(points, 18, 1), NUMPY(points, 18, 1))


@pytest.mark.parametrize("number", [4, 17])
def test_all_implementations_give_the_same_indices_of_a_whole_frame(compiled: Sampler, number: int) -> None:
    points = gazebo_cloud(number)
    assert len(points) > 150_000
    expected = farthest_point_indices(points, 400, NUMPY)
    np.testing.assert_array_equal(farthest_point_indices(points, 400, compiled), expected)


@given(points=clouds())
@settings(max_examples=40)
def test_each_point_is_the_farthest_that_is_left(points: Points) -> None:
    order = farthest_point_indices(points, min(len(points), 100))
    own, largest = distances_to_earlier(points, order)
    assert own == largest
    assert own == sorted(own, reverse=True)
    distinct = len(np.unique(points, axis=0))
    assert len(np.unique(points[order], axis=0)) == min(distinct, len(order))
    assert len(np.unique(order)) == min(distinct, len(order))


@pytest.mark.parametrize(("length", "prefix"), [(2048, 1024), (2048, 512), (1024, 256)])
def test_the_first_points_of_a_sampled_cloud_are_its_sample(length: int, prefix: int) -> None:
    for index in (0, 700):
        points = simulated_cloud(index, 2048)[:length]
        own, largest = distances_to_earlier(points, np.arange(prefix))
        assert own == largest
        # Sampling again may only break the ties of a level scene differently.
        assert (farthest_point_indices(points, prefix) == np.arange(prefix)).mean() > 0.99
    points = random_cloud(6, 5000)[farthest_point_indices(random_cloud(6, 5000), length)]
    np.testing.assert_array_equal(farthest_point_indices(points, prefix), np.arange(prefix))


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_the_order_of_the_file_does_not_matter(sampler: Sampler, seed: int) -> None:
    points = random_cloud(seed, 3000)
    shuffle = np.random.default_rng(seed).permutation(len(points))
    shuffled = farthest_point_indices(points[shuffle], 100, sampler)
    np.testing.assert_array_equal(shuffle[shuffled], farthest_point_indices(points, 100, sampler))


@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(0.2, 5.0), mirror=st.booleans())
@settings(max_examples=25)
def test_the_order_survives_turning_mirroring_and_scaling(seed: int, scale: float, mirror: bool) -> None:
    points = random_cloud(seed, 500)
    points = points[farthest_point_indices(points, 200)].astype(np.float64)
    changed = Rotation.random(rng=np.random.default_rng(seed)).apply(points) * scale
    if mirror:
        changed[:, 1] *= -1
    own, largest = distances_to_earlier(changed, np.arange(200))
    np.testing.assert_allclose(own, largest, rtol=1e-5)


@pytest.mark.parametrize(
    ("points", "count", "message"),
    [
        (np.zeros((5, 2)), 1, r"must be \(N, 3\), not \(5, 2\)"),
        (np.zeros(3), 1, r"must be \(N, 3\)"),
        (np.zeros((2, 5, 3)), 1, r"must be \(N, 3\)"),
        (np.zeros((5, 3)), 6, "cannot choose 6 of 5 points"),
        (np.zeros((5, 3)), 0, "cannot choose 0 of 5 points"),
        (np.zeros((0, 3)), 1, "cannot choose 1 of 0 points"),
        (np.array([[0, 0, np.nan], [0, 0, 0]]), 1, "must be finite"),
        (np.array([[0, 0, np.inf], [0, 0, 0]]), 1, "must be finite"),
    ],
)
def test_impossible_arguments_are_refused(points: NDArray[np.float64], count: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        farthest_point_indices(points.astype(np.float32), count)


def test_clouds_that_are_sampled_together_are_sampled_alone() -> None:
    clouds = [random_cloud(seed, 200).round(1) for seed in range(3)]
    points = torch.from_numpy(np.stack(clouds))
    together = farthest_points(points, 30)
    for cloud, chosen in zip(points, together, strict=True):
        assert torch.equal(farthest_points(cloud[None], 30)[0], chosen)
        assert chosen[0] == 0
    assert farthest_points(points.to("meta"), 30).shape == (3, 30), "nothing waits for values"
