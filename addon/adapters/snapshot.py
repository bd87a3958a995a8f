# SPDX-License-Identifier: GPL-3.0-or-later
"""The bind snapshot of a mesh, kept in the .blend as a mesh datablock that only the rig refers to.

It holds what Φ, Ψ and Ω are computed from: rest coordinates in rig space (the vertex positions), the faces,
and for a skin its weights, as `slots` pairs of point attributes (bone index, weight). It is written once at
bind; reading it back is a handful of bulk calls, so that a file with a large skin opens fast, and it does not
change when the artist renames vertex groups, paints weights or sculpts the skin.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from . import attributes, positions

Csr = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]


def write(
    name: str, points: positions.Points, faces: tuple[NDArray[np.int32], NDArray[np.int32]], weights: Csr | None
) -> bpy.types.Mesh:
    """A new snapshot mesh of `#V by 3` rig-space points, (corners, sizes) faces and CSR weights (skins only)."""
    mesh = positions.new_mesh(name, points, faces)
    if weights is not None:
        _write_weights(mesh, *weights)
    return mesh


def _write_weights(
    mesh: bpy.types.Mesh, indptr: NDArray[np.int64], indices: NDArray[np.int64], data: NDArray[np.float64]
) -> None:
    counts = np.diff(indptr)
    row = np.repeat(np.arange(len(counts)), counts)
    slot = np.arange(len(indices)) - indptr[row]
    for k in range(int(counts.max(initial=0))):
        at = slot == k
        joints = np.full(len(counts), -1, np.int32)
        values = np.zeros(len(counts), np.float32)
        joints[row[at]] = indices[at]
        values[row[at]] = data[at]
        attributes.write(mesh, f"joint_{k}", "INT", joints)
        attributes.write(mesh, f"weight_{k}", "FLOAT", values)


def read_weights(mesh: bpy.types.Mesh) -> Csr:
    """CSR weights (indptr `#V + 1`, bone indices, values) of a skin's snapshot. Raises `attributes.Damaged`."""
    slots = max(attributes.count(mesh, "joint_"), attributes.count(mesh, "weight_"))
    if not slots:
        raise attributes.Damaged(f"'{mesh.name}' has lost its weights")
    joint_table = np.stack([attributes.read(mesh, f"joint_{k}", "INT") for k in range(slots)], 1)
    weight_table = np.stack([attributes.read(mesh, f"weight_{k}", "FLOAT") for k in range(slots)], 1)
    used = joint_table >= 0
    indptr = np.concatenate([[0], np.cumsum(used.sum(1))]).astype(np.int64)
    return indptr, joint_table[used].astype(np.int64), weight_table[used].astype(np.float64)
