# SPDX-License-Identifier: GPL-3.0-or-later
"""Matrices with a row for each vertex, kept with a snapshot mesh: coordinates that were computed elsewhere.

Sixteen columns are one point attribute, a 4 by 4 matrix a vertex: of the attributes that Blender has, the one that is
read fastest (11 MB in 15 ms). It keeps float32.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

WIDTH = 16  # numbers in an attribute


def write(mesh: bpy.types.Mesh, name: str, rows: NDArray[np.floating] | None) -> None:
    """Keep `#V by #columns` with the mesh, instead of what is kept by this name; None: nothing. Not in Edit Mode."""
    for attribute in [found.name for found in mesh.attributes if found.name.startswith(f"{name}.")]:
        mesh.attributes.remove(mesh.attributes[attribute])
    if rows is None:
        return
    for start in range(0, rows.shape[1], WIDTH):
        part = rows[:, start : start + WIDTH]
        block = np.zeros((len(rows), WIDTH), np.float32)
        block[:, : part.shape[1]] = part
        mesh.attributes.new(f"{name}.{start}", "FLOAT4X4", "POINT").data.foreach_set("value", block.ravel())


def read(mesh: bpy.types.Mesh, name: str, columns: int) -> NDArray[np.float32] | None:
    """What `write` kept, `#V by columns`, or None where nothing is kept by this name."""
    if f"{name}.0" not in mesh.attributes:
        return None
    rows = np.empty((len(mesh.vertices), columns), np.float32)
    block = np.empty((len(rows), WIDTH), np.float32)
    for start in range(0, columns, WIDTH):
        mesh.attributes[f"{name}.{start}"].data.foreach_get("value", block.ravel())
        rows[:, start : start + WIDTH] = block[:, : columns - start]
    return rows


def write_indices(mesh: bpy.types.Mesh, name: str, indices: NDArray[np.integer] | None) -> None:
    """Keep up to `#V` indices with the mesh, instead of what is kept by this name; None: nothing. Not in Edit Mode."""
    if name in mesh.attributes:
        mesh.attributes.remove(mesh.attributes[name])
    if indices is not None:
        padded = np.full(len(mesh.vertices), -1, np.int32)
        padded[: len(indices)] = indices
        mesh.attributes.new(name, "INT", "POINT").data.foreach_set("value", padded)


def read_indices(mesh: bpy.types.Mesh, name: str) -> NDArray[np.int32] | None:
    """What `write_indices` kept, or None."""
    if name not in mesh.attributes:
        return None
    indices = np.empty(len(mesh.vertices), np.int32)
    mesh.attributes[name].data.foreach_get("value", indices)
    return indices[indices >= 0]
