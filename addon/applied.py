# SPDX-License-Identifier: GPL-3.0-or-later
"""Skins on which the Cage Rig modifier was applied: the mesh has the rig's shape now, so nothing may deform it again.

Blender says nothing of it. What it leaves is told from a modifier that was removed by where the vertices are: at what
the rig had fed, and not where they were bound. Such a skin leaves its rig with its Armature modifier off.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import binding, layers
from .adapters import dependence, modifier, positions, stack

NEAR = 1e-5  # of the skin's size: a skin no farther from its bound shape was not moved


def settle(cage: bpy.types.Object) -> None:
    """Let skins that were applied leave this rig, and all others that they were on."""
    for skin in cage.cage_rig.skins:
        if skin.applied and skin.object is not None and modifier.find(skin.object, cage) is not None:
            skin.applied = False  # an undo brings back the modifier, and not what a handler wrote since
        if skin.object is not None and not skin.applied and skin.snapshot is not None and _was_applied(skin, cage):
            _leave(skin.object, cage)


def _was_applied(skin: bpy.types.PropertyGroup, cage: bpy.types.Object) -> bool:
    obj = skin.object
    owner = obj.cage_rig.owner
    if obj.type != "MESH" or obj.data.is_editmode or not layers.is_own(obj) or owner is None:
        return False
    if modifier.find(obj, owner) is not None:
        return False
    if len(obj.data.vertices) != len(skin.snapshot.vertices):
        return len(obj.modifiers) == 0  # converted to a mesh, with modifiers that made vertices
    points, fed = positions.read_base(obj.data), modifier.read_fed(obj)
    at_feed = fed is not None and np.array_equal(points, fed)
    if not at_feed and len(obj.modifiers):
        return False
    rest = binding.rest_points(cage.cage_rig, skin.snapshot)
    near = NEAR * float(np.linalg.norm(np.ptp(rest, axis=0)))
    return not positions.close(positions.apply_matrix(np.array(skin.skin_to_rig, np.float64), points), rest, near)


def _leave(obj: bpy.types.Object, cage: bpy.types.Object) -> None:
    owner = obj.cage_rig.owner
    for rig in {cage, owner, *layers.below(owner)}:
        for skin in rig.cage_rig.skins:
            skin.applied |= skin.object == obj
    modifier.remove(obj, None, removing=False)
    stack.keep_suspended_off(obj)
    dependence.settle(obj, [])
