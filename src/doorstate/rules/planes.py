# SPDX-License-Identifier: Apache-2.0
"""Planes in clouds, with scikit-learn and scipy: thinning, normals, robust fits, connected pieces, angles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.linear_model import RANSACRegressor

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Plane:
    """Points p with normal . p = offset_m; the normal (3,) has length one and points away from the camera."""

    normal: Floats
    offset_m: float

    def distances_m(self, points: Floats) -> Floats:
        """(N,) signed distances of (N, 3) points; positive behind the plane as the camera sees it."""
        distances: Floats = points @ self.normal - self.offset_m
        return distances

    @property
    def heading_rad(self) -> float:
        """Direction of the normal in plan view."""
        return math.atan2(self.normal[1], self.normal[0])


class _Surface(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Plane through points for scikit-learn's RANSAC: predicts signed distances, whose targets are zero.

    With `vertical` the plane contains the direction of gravity: a line in plan view.
    """

    def __init__(self, vertical: bool = False) -> None:
        self.vertical = vertical

    def fit(self, X: Floats, y: Floats) -> _Surface:
        columns = 2 if self.vertical else 3
        centre = X[:, :columns].mean(axis=0)
        *_, axes = np.linalg.svd(X[:, :columns] - centre, full_matrices=False)
        normal = np.zeros(3)
        normal[:columns] = axes[-1] if len(axes) == columns else _across(axes[0])
        self.normal_ = normal
        self.offset_ = float(centre @ normal[:columns])
        return self

    def predict(self, X: Floats) -> Floats:
        distances: Floats = X @ self.normal_ - self.offset_
        return distances

    def score(self, X: Floats, y: Floats) -> float:
        return -float(np.abs(self.predict(X)).mean())


def fit_plane(
    points: Floats, threshold_m: float, *, vertical: bool = False, trials: int = 100, seed: int = 0
) -> tuple[Plane, Flags] | None:
    """The plane with most points within a distance (RANSAC, then least squares on those).

    Args:
        points: (N, 3) metres.
        threshold_m: how far a point of the plane may be from it.
        vertical: look for planes parallel to gravity only.
        trials: random samples that are tried.
        seed: of these samples.

    Returns:
        The plane and which points (N,) lie on it; None where the points do not allow any.
    """
    fewest = 2 if vertical else 3
    if len(points) < fewest:
        return None
    search = RANSACRegressor(
        _Surface(vertical),
        min_samples=fewest,
        residual_threshold=threshold_m,
        max_trials=trials,
        random_state=seed,
    )
    try:
        search.fit(points, np.zeros(len(points)))
    except ValueError:  # no sample with any consensus
        return None
    surface = search.estimator_
    sign = 1.0 if surface.offset_ >= 0 else -1.0
    plane = Plane(sign * surface.normal_, sign * surface.offset_)
    return plane, np.abs(plane.distances_m(points)) <= threshold_m


def thin(points: Floats, voxel_m: float) -> Floats:
    """The mean point of every occupied voxel (PCL's VoxelGrid); cut far points off first, voxels are counted."""
    if len(points) == 0:
        return points
    cells = np.floor((points - points.min(axis=0)) / voxel_m).astype(np.int64)
    keys = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    _, voxel, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(voxel, column, len(counts)) for column in points.T], axis=1)
    means: Floats = sums / counts[:, None]
    return means


def normals(points: Floats, neighbours: int) -> tuple[Floats, Floats]:
    """(N, 3) unit normals towards the camera from nearest neighbours, and curvature (N,), 0 to 1/3 (Rusu 2009)."""
    _, indices = cKDTree(points).query(points, k=min(neighbours, len(points)))
    near = points[indices.reshape(len(points), -1)]  # (N, K, 3)
    near = near - near.mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
    normal = vectors[:, :, 0]
    normal = np.where((normal * points).sum(axis=1, keepdims=True) > 0, -normal, normal)
    return normal, values[:, 0] / np.maximum(values.sum(axis=1), 1e-12)


def pieces(points: Floats, reach_m: float) -> NDArray[np.int64]:
    """Number (N,) of the connected piece of every point; points within reach are connected. The largest piece is 0."""
    graph = cKDTree(points).sparse_distance_matrix(cKDTree(points), reach_m, output_type="coo_matrix")
    count, label = connected_components(graph, directed=False)
    order = np.argsort(-np.bincount(label, minlength=count), kind="stable")
    rank = np.empty(count, dtype=np.int64)
    rank[order] = np.arange(count)
    ranked: NDArray[np.int64] = rank[label]
    return ranked


def angle_deg(one: Floats, other: Floats) -> float:
    """Angle between two directions regardless of their signs, 0 to 90 degrees."""
    return math.degrees(math.acos(min(1.0, abs(float(one @ other)))))


def _across(direction: Floats) -> Floats:
    return np.array([-direction[1], direction[0]]) if len(direction) == 2 else np.roll(direction, 1)
