# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones as arrays: rest and posed matrices of an armature, and the pose of the refit armature."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector
from numpy.typing import NDArray

from .. import compat

Matrices = NDArray[np.float64]
Inheritance = tuple[bool, bool, str]  # rotation, location along the bone's own axes, scale
INHERITS_ALL: Inheritance = (True, True, "FULL")
INHERITS_PLACE: Inheritance = (False, True, "NONE")
HELPER = "cage_rig_helper"  # marks bones that `add_helpers` made


@dataclass(frozen=True)
class RestBones:
    """The bones of an armature in the armature's space, in the order of `armature.bones`."""

    names: list[str]
    parents: NDArray[np.int32]  # #J, -1 at roots
    heads: NDArray[np.float64]  # #J by 3
    tails: NDArray[np.float64]  # #J by 3
    deform: NDArray[np.bool_]  # #J
    segments: NDArray[np.int32]  # #J, more than 1 for B-bones
    envelopes: NDArray[np.bool_]  # #J, weights multiplied by the envelope


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
        np.array([bone.use_envelope_multiply for bone in bones], bool),
    )


def read_rest_matrices(armature: bpy.types.Armature) -> Matrices:
    """`matrix_local` of every bone, `#bones by 4 by 4`, acting on columns, in the armature's space."""
    return _read_matrices(armature.bones, "matrix_local")


def read_pose_matrices(armature_object: bpy.types.Object) -> Matrices:
    """Posed matrix of every pose bone, `#bones by 4 by 4`, in the armature's space. Pass the evaluated object."""
    return _read_matrices(armature_object.pose.bones, "matrix")


def read_pose_rows(armature_object: bpy.types.Object, rows: NDArray[np.float32]) -> None:
    """The same into `#bones by 4 by 4` that is there, acting on rows as Blender has them."""
    armature_object.pose.bones.foreach_get("matrix", rows.reshape(-1))


def read_channels(armature_object: bpy.types.Object) -> Matrices:
    """Location, rotation (a quaternion) and scale of every pose bone, `#bones by 10`. Pass the evaluated object."""
    return np.array([[*bone.location, *_rotation(bone), *bone.scale] for bone in armature_object.pose.bones])


def _rotation(bone: bpy.types.PoseBone) -> Quaternion:
    if bone.rotation_mode == "QUATERNION":
        return bone.rotation_quaternion.normalized()
    if bone.rotation_mode == "AXIS_ANGLE":
        angle, *axis = bone.rotation_axis_angle
        return Quaternion(axis, angle) if any(axis) else Quaternion()
    return bone.rotation_euler.to_quaternion()


def _read_matrices(bones: bpy.types.bpy_prop_collection, name: str) -> Matrices:
    flat = np.empty(len(bones) * 16, np.float32)
    bones.foreach_get(name, flat)
    return flat.reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)


def bone_names(armature: bpy.types.Armature) -> list[str]:
    """Names in the order of `armature.bones`, which is the order of `pose.bones` too."""
    return [bone.name for bone in armature.bones]


def ends(armature: bpy.types.Armature, names: list[str]) -> list[str]:
    """Those of these bones from which none of them descends. What waits for them waits for all: Blender evaluates a
    bone after its parent.
    """
    bones, above = armature.bones, set()
    for name in names:
        bone = bones[name].parent if name in bones else None
        while bone is not None and bone.name not in above:
            above.add(bone.name)
            bone = bone.parent
    return [name for name in names if name not in above]


def new_refit_armature(name: str, source: bpy.types.Armature) -> bpy.types.Armature:
    """A copy of the armature with the same bones, parentless and unconnected: bones are freed by `free_bones`."""
    armature = source.copy()
    armature.name = name
    armature.animation_data_clear()
    armature.display_type, armature.pose_position = "STICK", "POSE"
    for bone in armature.bones:
        bone.color.palette = "THEME04"
    return armature


@contextmanager
def editing(obj: bpy.types.Object, context: bpy.types.Context) -> Iterator[bpy.types.ArmatureEditBones]:
    """Edit Mode of an armature object, wherever it is hidden; selection and visibility are put back after."""
    view_layer, root = context.view_layer, context.scene.collection
    linked, hidden = obj.name in root.objects, obj.hide_viewport
    if not linked:
        root.objects.link(obj)  # a bone can be edited only where its object is visible
    obj.hide_viewport = False
    eye = obj.hide_get()
    obj.hide_set(False)
    active, selected = view_layer.objects.active, [other for other in view_layer.objects if other.select_get()]
    for other in selected:
        other.select_set(False)
    view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        yield obj.data.edit_bones
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
        obj.hide_set(eye)
        obj.hide_viewport = hidden
        for other in selected:
            other.select_set(True)
        view_layer.objects.active = active
        if not linked:
            root.objects.unlink(obj)


def free_bones(obj: bpy.types.Object, context: bpy.types.Context) -> None:
    """Make every bone of the armature object parentless, unconnected and plain. Object Mode."""
    with editing(obj, context) as bones:
        for bone in bones:
            bone.use_connect = False
            bone.parent = None
            bone.bbone_segments = 1
            bone.use_local_location = bone.use_inherit_rotation = True
            bone.inherit_scale = "FULL"


def leaves_parent(armature: bpy.types.Armature, heads: dict[str, NDArray[np.float64]]) -> list[str]:
    """Connected bones that can't stay so when these bones (all of the armature's) get new heads (armature's space).

    A parent whose connected child stays on its axis can grow or shrink to it; another one would turn.
    """
    return [
        bone.name
        for bone in armature.bones
        if bone.use_connect and bone.parent and not _on_axis(bone.parent, heads[bone.parent.name], heads[bone.name])
    ]


def _on_axis(bone: bpy.types.Bone, head: NDArray[np.float64], place: NDArray[np.float64]) -> bool:
    along = np.array(bone.tail_local - bone.head_local)
    offset = place - head
    reach = float(offset @ along) / float(along @ along)
    return reach > 1e-3 and float(np.linalg.norm(offset - reach * along)) < 1e-6 * float(np.linalg.norm(along))


def keyed_location(obj: bpy.types.Object, names: list[str]) -> str | None:
    """The first of these bones whose location the object's action keys, or None."""
    paths = {f'pose.bones["{bpy.utils.escape_identifier(name)}"].location': name for name in names}
    return next((paths[curve.data_path] for curve in compat.action_curves(obj) if curve.data_path in paths), None)


def move_heads(obj: bpy.types.Object, context: bpy.types.Context, heads: dict[str, NDArray[np.float64]]) -> None:
    """Move all rest bones by name to new heads (armature's space), orientation and roll kept. Object Mode.

    Connected bones stay so where they can (`leaves_parent`); the others' pose locations, which a connection hides,
    are set to 0.
    """
    leaving = leaves_parent(obj.data, heads)
    for name in leaving:
        obj.pose.bones[name].location = (0.0, 0.0, 0.0)
    with editing(obj, context) as bones:
        connected = {bone.name for bone in bones if bone.use_connect} - set(leaving)
        for bone in bones:
            bone.use_connect = False
        for name, head in heads.items():
            bone = bones[name]
            along, roll = bone.tail - bone.head, bone.roll
            reached = [heads[child.name] for child in bone.children if child.name in connected]
            bone.head = Vector(head)
            bone.tail = Vector(reached[0]) if reached else bone.head + along
            bone.roll = roll
        for name in connected:
            bones[name].use_connect = True


def disconnect(obj: bpy.types.Object, context: bpy.types.Context, names: list[str]) -> None:
    """Let these bones leave their parent's tail; they stay where they are. Object Mode."""
    connected = [name for name in names if obj.data.bones[name].use_connect]
    if connected:
        with editing(obj, context) as bones:
            for name in connected:
                bones[name].use_connect = False


def let_refer(obj: bpy.types.Object, source: bpy.types.Object, target: bpy.types.Object) -> None:
    """Let bone constraints and drivers of the armature object that refer to `source` refer to `target`."""
    holders = [constraint for bone in obj.pose.bones for constraint in bone.constraints]
    holders += [end for holder in holders if holder.type == "ARMATURE" for end in holder.targets]
    for holder in holders:
        for name in ("target", "pole_target"):
            if getattr(holder, name, None) == source:
                setattr(holder, name, target)
    drivers = obj.animation_data.drivers if obj.animation_data else []
    for variable in [variable for curve in drivers for variable in curve.driver.variables]:
        for end in variable.targets:
            if end.id == source:
                end.id = target


def inheritance(bone: bpy.types.Bone | bpy.types.EditBone) -> Inheritance:
    """What the bone inherits of its parent's pose."""
    return bone.use_inherit_rotation, bone.use_local_location, bone.inherit_scale


def set_inheritance(bone: bpy.types.Bone | bpy.types.EditBone, inherits: Inheritance) -> None:
    """Set what the bone inherits of its parent's pose."""
    bone.use_inherit_rotation, bone.use_local_location, bone.inherit_scale = inherits


def add_helpers(obj: bpy.types.Object, context: bpy.types.Context, names: list[str]) -> dict[str, str]:
    """Put a bone that moves no skin between each of these bones and its parent. Object Mode.

    It rests where the bone rests; both inherit everything. Returns the names by the bones'.
    """
    if not names:
        return {}
    made = {}
    with editing(obj, context) as bones:
        for name in names:
            bone, helper = bones[name], bones.new(f"{name}.shear")
            made[name] = helper.name
            helper[HELPER] = True
            helper.head, helper.tail, helper.roll = bone.head, bone.tail, bone.roll
            helper.use_deform = False
            helper.parent, bone.use_connect = bone.parent, False
            bone.parent = helper
            set_inheritance(helper, INHERITS_ALL)
            set_inheritance(bone, INHERITS_ALL)
            for collection in bone.collections:
                collection.assign(helper)
    return made


def write_refit_pose(obj: bpy.types.Object, basis: Matrices) -> None:
    """Pose the parentless refit bones, each by `basis` in its own rest space, `#J by 4 by 4`."""
    write_refit_rows(obj, basis.transpose(0, 2, 1).astype(np.float32, order="C"))


def write_refit_rows(obj: bpy.types.Object, basis: NDArray[np.float32]) -> None:
    """The same, acting on rows as Blender has them."""
    obj.pose.bones.foreach_set("matrix_basis", basis.reshape(-1))
    obj.update_tag(refresh={"DATA"})


def to_array(matrix: Matrix) -> Matrices:
    """A mathutils matrix as a 4 by 4 float64 array."""
    return np.array(matrix, np.float64)
