# SPDX-License-Identifier: GPL-3.0-or-later
"""Point attributes that the add-on keeps with a mesh, as arrays; what is not as it was written is named."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

KINDS = {"INT": (np.int32, 1), "FLOAT": (np.float32, 1), "FLOAT4X4": (np.float32, 16)}


class Damaged(ValueError):
    """An attribute is not as the add-on wrote it; the message says which and how."""


def write(mesh: bpy.types.Mesh, name: str, kind: str, values: NDArray[np.generic]) -> None:
    """Keep `#V` values (rows, where one has several numbers). Not in Edit Mode."""
    mesh.attributes.new(name, kind, "POINT").data.foreach_set("value", values.ravel())


def read(mesh: bpy.types.Mesh, name: str, kind: str) -> NDArray[np.generic]:
    """What `write` kept, `#V` or `#V by` the numbers of a value. Raises `Damaged`."""
    found = mesh.attributes.get(name)
    if found is None:
        raise Damaged(f"'{mesh.name}' has lost its attribute '{name}'")
    if (found.domain, found.data_type) != ("POINT", kind) or len(found.data) != len(mesh.vertices):
        raise Damaged(f"attribute '{name}' of '{mesh.name}' is of another kind than what was kept")
    dtype, width = KINDS[kind]
    values = np.empty((len(mesh.vertices), width), dtype)
    found.data.foreach_get("value", values.ravel())
    return values[:, 0] if width == 1 else values


def count(mesh: bpy.types.Mesh, prefix: str) -> int:
    """How many attributes have this prefix and a number."""
    return sum(found.name.startswith(prefix) and found.name[len(prefix) :].isdigit() for found in mesh.attributes)
