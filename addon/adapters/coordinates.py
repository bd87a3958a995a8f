# SPDX-License-Identifier: GPL-3.0-or-later
"""Matrices with a row for each vertex, kept with a snapshot mesh: coordinates that were computed elsewhere.

Sixteen columns are one point attribute, a 4 by 4 matrix a vertex: of the attributes that Blender has, the one that is
read fastest (11 MB in 15 ms). It keeps float32.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from . import attributes

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
        attributes.write(mesh, f"{name}.{start}", "FLOAT4X4", block)


def read(mesh: bpy.types.Mesh, name: str, columns: int) -> NDArray[np.float32] | None:
    """What `write` kept, `#V by columns`, or None where nothing is kept by this name. Raises `attributes.Damaged`."""
    if not attributes.count(mesh, f"{name}."):
        return None
    blocks = [attributes.read(mesh, f"{name}.{start}", "FLOAT4X4") for start in range(0, columns, WIDTH)]
    return np.ascontiguousarray(np.concatenate(blocks, axis=1)[:, :columns])


def write_indices(mesh: bpy.types.Mesh, name: str, indices: NDArray[np.integer] | None) -> None:
    """Keep up to `#V` indices with the mesh, instead of what is kept by this name; None: nothing. Not in Edit Mode."""
    if name in mesh.attributes:
        mesh.attributes.remove(mesh.attributes[name])
    if indices is not None:
        padded = np.full(len(mesh.vertices), -1, np.int32)
        padded[: len(indices)] = indices
        attributes.write(mesh, name, "INT", padded)


def read_indices(mesh: bpy.types.Mesh, name: str) -> NDArray[np.int32] | None:
    """What `write_indices` kept, or None. Raises `attributes.Damaged`."""
    if name not in mesh.attributes:
        return None
    indices = attributes.read(mesh, name, "INT")
    return indices[indices >= 0]
