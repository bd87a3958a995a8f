# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights from vertex groups."""

from __future__ import annotations

import itertools

import bpy
import numpy as np
from numpy.typing import NDArray

from .snapshot import Csr

SMALLEST_SUM = 1e-4


def read_weights(obj: bpy.types.Object, bone_index: dict[str, int]) -> Csr:
    """Weights of the groups named as deforming bones, as CSR (indptr `#V + 1`, bone indices, values > 0).

    Blender has no bulk access to vertex groups, so this walks the vertices; it runs at bind only. Not normalised; a
    vertex whose weights sum to next to nothing has none, as in Blender's Armature modifier. Not in Edit Mode.
    """
    joint_of = np.array([bone_index.get(group.name, -1) for group in obj.vertex_groups] + [-1], np.int64)
    per_vertex = [[(g.group, g.weight) for g in vertex.groups] for vertex in obj.data.vertices]
    counts = np.array([len(groups) for groups in per_vertex], np.int64)
    flat = np.array(list(itertools.chain.from_iterable(per_vertex)), np.float64).reshape(-1, 2)
    row = np.repeat(np.arange(len(counts)), counts)
    group = np.clip(flat[:, 0].astype(np.int64), 0, len(joint_of) - 1)
    joints = joint_of[group]
    keep = (joints >= 0) & (flat[:, 1] > 0.0)
    total = np.bincount(row[keep], flat[keep, 1], minlength=len(counts))
    keep &= total[row] > SMALLEST_SUM
    row, joints, values = row[keep], joints[keep], flat[keep, 1]
    indptr = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=len(counts)))]).astype(np.int64)
    return indptr, joints, values


def write_weights(obj: bpy.types.Object, names: list[str], weights: Csr) -> None:
    """Add groups of CSR weights, whose columns are `names` and whose rows are normalised. Not in Edit Mode.

    A name without weights gets no group. Walks the weights, as Blender has no bulk access.
    """
    indptr, columns, values = weights
    row = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
    shares = values / np.bincount(row, values, minlength=len(indptr) - 1)[row]
    for column in np.unique(columns).tolist():
        add, at = obj.vertex_groups.new(name=names[column]).add, columns == column
        for vertex, share in zip(row[at].tolist(), shares[at].tolist(), strict=True):
            add((vertex,), share, "REPLACE")


def named(obj: bpy.types.Object) -> set[str]:
    """Groups that modifiers or shape keys of the object go by; all of them where node groups may do so."""
    if any(mod.type == "NODES" for mod in obj.modifiers):
        return {group.name for group in obj.vertex_groups}
    found = {
        getattr(mod, prop.identifier)
        for mod in obj.modifiers
        for prop in mod.bl_rna.properties
        if prop.type == "STRING"
    }
    keys = obj.data.shape_keys
    return found if keys is None else found | {block.vertex_group for block in keys.key_blocks}


def read_group(obj: bpy.types.Object, name: str) -> NDArray[np.float32]:
    """Weights of one vertex group, `#V`; zero where a vertex is not in it or the group is gone."""
    weights = np.zeros(len(obj.data.vertices), np.float32)
    group = obj.vertex_groups.get(name)
    if group is not None:
        weights[:] = [next((g.weight for g in v.groups if g.group == group.index), 0.0) for v in obj.data.vertices]
    return weights


def write_whole(obj: bpy.types.Object, names: list[str]) -> None:
    """Put each vertex into the group of its name (`#V` names), with weight 1. Not in Edit Mode."""
    for name in dict.fromkeys(names):
        rows = [row for row, other in enumerate(names) if other == name]
        (obj.vertex_groups.get(name) or obj.vertex_groups.new(name=name)).add(rows, 1.0, "REPLACE")
