# SPDX-License-Identifier: Apache-2.0
"""Planes in clouds: upright ones, thinning, normals, connected pieces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from doorstate.rules.plan_lines import Flags, Floats, strongest_line


@dataclass(frozen=True, eq=False)
class Plane:
    """Points p with normal . p = offset_m; the normal (3,) has length one and points away from the camera."""

    normal: Floats
    offset_m: float

    def distances_m(self, points: Floats) -> Floats:
        """(N,) signed distances of (N, 3) points; positive behind the plane as the camera sees it."""
        distances: Floats = points @ self.normal - self.offset_m
        return distances


def upright_plane(points: Floats, threshold_m: float, *, seed: int = 0) -> tuple[Plane, Flags] | None:
    """The plane parallel to gravity with most of (N, 3) points within a distance, and which points (N,) these are.

    Args:
        points: (N, 3) metres.
        threshold_m: how far a point of the plane may be from it.
        seed: of the pairs of points that are tried.

    Returns:
        None where the points do not allow any.
    """
    found = strongest_line(points[:, :2], threshold_m, seed=seed)
    if found is None:
        return None
    line, on_line = found
    normal = np.append(line.normal, 0.0)
    return Plane(normal, float(line.normal @ line.centre)), on_line


def thin(points: Floats, voxel_m: float) -> Floats:
    """The mean point of every occupied voxel (PCL's VoxelGrid); cut far points off first, voxels are counted."""
    return grid(points, voxel_m)[1] if len(points) else points


def grid(points: Floats, cell_m: float) -> tuple[NDArray[np.int64], Floats]:
    """Number (N,) of the occupied cell that each of (N, D) points lies in, and the mean points (K, D) of the cells."""
    cells = np.floor((points - points.min(axis=0)) / cell_m).astype(np.int64)
    keys = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    _, number, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(number, column) for column in points.T], axis=1)
    return number, sums / counts[:, None]


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
