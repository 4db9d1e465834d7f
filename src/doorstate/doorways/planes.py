# SPDX-License-Identifier: Apache-2.0
"""Upright planes in clouds, and voxels, normals and connected components of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from doorstate.doorways.plan_lines import Flags, Floats, strongest_line


@dataclass(frozen=True, eq=False)
class Plane:
    """Points p with normal . p = offset_m; the unit normal (3,) points away from the camera."""

    normal: Floats
    offset_m: float

    def distances_m(self, points: Floats) -> Floats:
        """Return (N,) signed distances of (N, 3) points; positive behind the plane as the camera sees it."""
        distances: Floats = points @ self.normal - self.offset_m
        return distances


def upright_plane(points: Floats, threshold_m: float, *, seed: int = 0) -> tuple[Plane, Flags] | None:
    """Return the plane parallel to gravity with most points within a distance, and a mask (N,) of these points.

    Args:
        points: (N, 3) metres.
        threshold_m: largest distance of a point of the plane.
        seed: seed of the random pairs of points that propose planes.

    Returns:
        None for points without any such plane.
    """
    fit = strongest_line(points[:, :2], threshold_m, seed=seed)
    if fit is None:
        return None
    line, on_line = fit
    normal = np.append(line.normal, 0.0)
    return Plane(normal, float(line.normal @ line.centre)), on_line


def voxel_downsample(points: Floats, voxel_m: float) -> Floats:
    """Return the mean point of every occupied voxel (PCL's VoxelGrid); remove far points first, voxels are counted."""
    return grid(points, voxel_m)[1] if len(points) else points


def grid(points: Floats, cell_m: float) -> tuple[NDArray[np.int64], Floats]:
    """Return the number (N,) of the cell of each of (N, D) points, and the mean points (K, D) of the cells."""
    cells = np.floor((points - points.min(axis=0)) / cell_m).astype(np.int64)
    keys = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    _, number, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(number, column) for column in points.T], axis=1)
    return number, sums / counts[:, None]


def normals(points: Floats, neighbours: int) -> tuple[Floats, Floats]:
    """Return (N, 3) unit normals towards the camera, and curvatures (N,) of 0 to 1/3, from neighbours (Rusu 2009)."""
    _, indices = cKDTree(points).query(points, k=min(neighbours, len(points)))
    near = points[indices.reshape(len(points), -1)]  # (N, K, 3)
    near = near - near.mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))
    normal = vectors[:, :, 0]
    normal = np.where((normal * points).sum(axis=1, keepdims=True) > 0, -normal, normal)
    return normal, values[:, 0] / np.maximum(values.sum(axis=1), 1e-12)


def component_numbers(points: Floats, reach_m: float) -> NDArray[np.int64]:
    """Return the number (N,) of the component of each point, largest first; points within reach are connected."""
    graph = cKDTree(points).sparse_distance_matrix(cKDTree(points), reach_m, output_type="coo_matrix")
    count, label = connected_components(graph, directed=False)
    order = np.argsort(-np.bincount(label, minlength=count), kind="stable")
    rank = np.empty(count, dtype=np.int64)
    rank[order] = np.arange(count)
    ranked: NDArray[np.int64] = rank[label]
    return ranked
