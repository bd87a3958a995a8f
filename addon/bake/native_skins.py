# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a native rig: in the rest shape that the cage gives them, with the weights of the bind."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ..adapters import positions, shape_keys, vertex_groups
from . import solving
from .drafts import Draft
from .keys import Keys
from .recording import Recording, SkinRecord


def copy_skin(made: Draft, skin: SkinRecord, bones: bpy.types.Object, seen: Recording) -> bpy.types.Object:
    """The skin in the rest shape that the cage gives it, with the weights of the bind, on the copied armature."""
    obj, place = made.copy_skin(skin.skin, f"{skin.skin.obj.name} Native")
    _set_rest(obj, skin, seen.times, made)
    _weigh(obj, skin, bones, seen.weighted)
    _place(obj, skin, seen, bones, made)
    mod = obj.modifiers.new("Armature", "ARMATURE")
    mod.object, mod.use_vertex_groups, mod.use_bone_envelopes = bones, True, False
    mod.use_deform_preserve_volume = skin.preserves_volume
    obj.modifiers.move(len(obj.modifiers) - 1, place)
    return obj


def _set_rest(obj: bpy.types.Object, skin: SkinRecord, at: list[float], made: Draft) -> None:
    """The rest shape; shape keys keep what they add to it, and their values are keyed plainly."""
    mesh, keys = obj.data, obj.data.shape_keys
    if keys is not None and not keys.use_relative:  # those a live rig does not show
        obj.shape_key_clear()
        keys = None
    if keys is not None:
        keys.animation_data_clear()
        curves = Keys(keys, obj.name, made)
        count = len(mesh.vertices)
        shift = skin.base - shape_keys.read_key(keys.key_blocks[0], count)
        for block, values in zip(keys.key_blocks, np.array(skin.key_values).T, strict=True):
            shape_keys.write_key(block, shape_keys.read_key(block, count) + shift)
            block.value = values[0]
            if np.ptp(values) > 0.0:
                curves.add(f"{block.path_from_id()}.value", 0, at, values)
    positions.write_base(mesh, skin.base)


def _weigh(obj: bpy.types.Object, skin: SkinRecord, bones: bpy.types.Object, weighted: set[str]) -> None:
    """Vertex groups as bound. Other groups with a bone's name, which exporters take for weights, go where they can."""
    asked_for = vertex_groups.named(obj)
    for group in list(obj.vertex_groups):
        bone = bones.data.bones.get(group.name)
        if bone is None:
            continue
        if group.name not in weighted:
            bone.use_deform = False
        if group.name in weighted or group.name not in asked_for:
            obj.vertex_groups.remove(group)
    for name in weighted:
        bones.data.bones[name].use_deform = True
    vertex_groups.write_weights(obj, *skin.weights)


def _place(obj: bpy.types.Object, skin: SkinRecord, seen: Recording, bones: bpy.types.Object, made: Draft) -> None:
    """Where the skin is, by the copied armature instead of the armature, and by nothing else where that can be."""
    to_parent = obj.matrix_parent_inverse.copy()
    if seen.source not in _ancestors(obj) and not skin.is_still:
        return  # it goes its own way
    follows = obj.parent == seen.source and obj.parent_type == "OBJECT"
    obj.parent, obj.parent_type = bones, "OBJECT"
    if follows:
        obj.matrix_parent_inverse = to_parent
        return
    obj.animation_data_clear()
    for constraint in list(obj.constraints):
        obj.constraints.remove(constraint)
    obj.delta_location, obj.delta_rotation_euler, obj.delta_scale = (0.0,) * 3, (0.0,) * 3, (1.0,) * 3
    obj.delta_rotation_quaternion, obj.rotation_mode = (1.0, 0.0, 0.0, 0.0), "QUATERNION"
    if skin.is_still:
        obj.matrix_parent_inverse, obj.matrix_basis = Matrix(skin.to_rig[0]), Matrix()
        return
    obj.matrix_parent_inverse = Matrix()
    values = solving.rows([Matrix(matrix).decompose() for matrix in skin.to_rig])
    Keys(obj, obj.name, made).add_transform(obj, "", seen.times, values)


def _ancestors(obj: bpy.types.Object) -> list[bpy.types.Object]:
    found = []
    while obj.parent is not None:
        obj = obj.parent
        found.append(obj)
    return found
