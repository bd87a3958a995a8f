# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones as arrays: rest and posed matrices of an armature, and the pose of the refit armature."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

Matrices = NDArray[np.float64]


@dataclass(frozen=True)
class RestBones:
    """The bones of an armature in the armature's space, in the order of `armature.bones`."""

    names: list[str]
    parents: NDArray[np.int32]  # #J, -1 at roots
    heads: NDArray[np.float64]  # #J by 3
    tails: NDArray[np.float64]  # #J by 3
    deform: NDArray[np.bool_]  # #J
    segments: NDArray[np.int32]  # #J, more than 1 for B-bones


def read_rest(armature: bpy.types.Armature) -> RestBones:
    """Rest bones. Not in Edit Mode of the armature (there `edit_bones` are the truth)."""
    bones = armature.bones
    count = len(bones)
    names = [bone.name for bone in bones]
    index = {name: k for k, name in enumerate(names)}
    heads, tails = np.empty((count, 3)), np.empty((count, 3))
    bones.foreach_get("head_local", heads.ravel())
    bones.foreach_get("tail_local", tails.ravel())
    return RestBones(
        names,
        np.array([index[bone.parent.name] if bone.parent else -1 for bone in bones], np.int32),
        heads,
        tails,
        np.array([bone.use_deform for bone in bones], bool),
        np.array([bone.bbone_segments for bone in bones], np.int32),
    )


def read_rest_matrices(armature: bpy.types.Armature) -> Matrices:
    """`matrix_local` of every bone, `#bones by 4 by 4`, acting on columns, in the armature's space."""
    return _read_matrices(armature.bones, "matrix_local")


def read_pose_matrices(armature_object: bpy.types.Object) -> Matrices:
    """Posed matrix of every pose bone, `#bones by 4 by 4`, in the armature's space. Pass the evaluated object."""
    return _read_matrices(armature_object.pose.bones, "matrix")


def _read_matrices(bones: bpy.types.bpy_prop_collection, name: str) -> Matrices:
    flat = np.empty(len(bones) * 16, np.float32)
    bones.foreach_get(name, flat)
    return flat.reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)


def bone_names(armature: bpy.types.Armature) -> list[str]:
    """Names in the order of `armature.bones`, which is the order of `pose.bones` too."""
    return [bone.name for bone in armature.bones]


def new_refit_armature(name: str, source: bpy.types.Armature) -> bpy.types.Armature:
    """A copy of the armature with the same bones, parentless and unconnected: bones are freed by `free_bones`."""
    armature = source.copy()
    armature.name = name
    armature.animation_data_clear()
    armature.display_type = "STICK"
    for bone in armature.bones:
        bone.color.palette = "THEME04"
    return armature


def free_bones(obj: bpy.types.Object, context: bpy.types.Context) -> None:
    """Make every bone of the armature object parentless, unconnected and plain. Enters and leaves Edit Mode."""
    view_layer, root = context.view_layer, context.scene.collection
    linked = obj.name in root.objects
    if not linked:
        root.objects.link(obj)  # a bone can be edited only where its object is visible
    active, selected = view_layer.objects.active, [other for other in view_layer.objects if other.select_get()]
    for other in selected:
        other.select_set(False)
    view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in obj.data.edit_bones:
        bone.use_connect = False
        bone.parent = None
        bone.bbone_segments = 1
    bpy.ops.object.mode_set(mode="OBJECT")
    if not linked:
        root.objects.unlink(obj)
    for other in selected:
        other.select_set(True)
    view_layer.objects.active = active


def depend_on_bones(obj: bpy.types.Object, armature_object: bpy.types.Object, names: list[str]) -> None:
    """Make Blender evaluate these bones wherever it evaluates `obj`, even where the armature is hidden.

    Blender evaluates the bones of a hidden armature only for what depends on each of them. A driver that reads every
    bone and always gives 0 is such a dependency; unlike a constraint it draws no relationship lines.
    """
    obj.driver_remove("delta_location", 0)
    driver = obj.driver_add("delta_location", 0).driver
    driver.type, driver.expression = "SCRIPTED", "0.0"
    for name in names:
        variable = driver.variables.new()
        variable.type = "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target = armature_object, name


def write_refit_pose(obj: bpy.types.Object, rest: Matrices, posed: Matrices) -> None:
    """Pose the parentless refit bones at `posed`, `#J by 4 by 4` in the armature's space."""
    basis = np.linalg.inv(rest) @ posed
    obj.pose.bones.foreach_set("matrix_basis", basis.transpose(0, 2, 1).astype(np.float32).ravel())
    obj.update_tag(refresh={"DATA"})


def to_array(matrix: Matrix) -> Matrices:
    """A mathutils matrix as a 4 by 4 float64 array."""
    return np.array(matrix, np.float64)
