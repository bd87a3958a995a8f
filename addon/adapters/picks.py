# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices that a message is about: finding where a mesh is open or not manifold, and selecting."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray


def broken_vertices(
    points: NDArray[np.floating], faces: tuple[NDArray[np.integer], NDArray[np.integer]]
) -> NDArray[np.bool_]:
    """Which vertices (`#V`) are on edges of one face or of more than two, where vertices at one place are the same."""
    corners, sizes = (part.astype(np.int64) for part in faces)
    following = np.arange(1, len(corners) + 1)
    ends = np.cumsum(sizes)
    following[ends - 1] = ends - sizes
    _, place = np.unique(points, axis=0, return_inverse=True)
    place = place.ravel()  # of another shape in numpy 2.0
    pairs = np.sort(np.stack([place[corners], place[corners[following]]], 1), 1)
    edges, count = np.unique(pairs, axis=0, return_counts=True)
    return np.isin(place, edges[count != 2])


def corners_of(
    faces: tuple[NDArray[np.integer], NDArray[np.integer]], chosen: NDArray[np.bool_], count: int
) -> NDArray[np.bool_]:
    """Which of so many vertices are corners of the chosen faces (`#F`)."""
    found = np.zeros(count, bool)
    found[faces[0][np.repeat(chosen, faces[1])]] = True
    return found


def select_vertices(mesh: bpy.types.Mesh, chosen: NDArray[np.bool_]) -> None:
    """Select these vertices and nothing else, so that they are seen in Edit Mode. Not in Edit Mode."""
    vertices = np.asarray(chosen, bool)
    mesh.vertices.foreach_set("select", vertices)
    ends = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", ends)
    mesh.edges.foreach_set("select", vertices[ends.reshape(-1, 2)].all(1))
    starts, sizes = np.empty(len(mesh.polygons), np.int32), np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("loop_total", sizes)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    whole = np.logical_and.reduceat(vertices[corners], starts) if len(starts) else np.zeros(0, bool)
    mesh.polygons.foreach_set("select", whole)
    mesh.update()
