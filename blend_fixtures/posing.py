"""What the biped's actions share: turns about the armature's axes, limbs that reach for a place, keys.

A pose gives each bone a rotation as it acts in armature axes on the rest pose, relative to its parent.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

_AXES = {"x": Vector((1, 0, 0)), "y": Vector((0, 1, 0)), "z": Vector((0, 0, 1))}

Pose = dict[str, Matrix]


def turn(axis: str, degrees: float) -> Matrix:
    """A rotation about an axis of the armature."""
    return Matrix.Rotation(np.radians(degrees), 3, _AXES[axis])


def reflect(rotation: Matrix) -> Matrix:
    """The mirror image in x of a rotation."""
    flip = Matrix.Diagonal((-1.0, 1.0, 1.0))
    return flip @ rotation @ flip


def placed(armature: bpy.types.Object, pose: Pose, name: str, offset: Vector) -> tuple[Matrix, Vector]:
    """How `pose` turns a bone in armature axes, and where its head is; the hips are moved by `offset` (metres)."""
    bone = armature.data.bones[name]
    if bone.parent is None:
        return Matrix.Identity(3), bone.head_local.copy()
    parent, at = placed(armature, pose, bone.parent.name, offset)
    head = at + parent @ (bone.head_local - bone.parent.head_local)
    return parent @ pose.get(name, Matrix.Identity(3)), head + offset if name == "hips" else head


def reach(joints: tuple[Vector, Vector, Vector], bend: Vector, start: Vector, target: Vector, toward: Vector) -> Pose:
    """Two-bone IK → the rotations "upper" and "lower" in armature axes.

    `joints`: of the limb at rest, whose middle one bends in the direction `bend`. Posed, the first is at `start`, the
    last at `target` or as near as the limb reaches, and the middle one goes `toward`.
    """
    first, middle, last = joints
    upper, lower = middle - first, last - middle
    way = target - start
    length = min(way.length, 0.995 * (upper.length + lower.length))
    cosine = (upper.length_squared + length**2 - lower.length_squared) / (2.0 * upper.length * length)
    hinge = way.cross(toward).normalized()
    along = Matrix.Rotation(np.arccos(np.clip(cosine, -1.0, 1.0)), 3, hinge) @ way.normalized() * upper.length
    rest_hinge = (last - first).cross(bend).normalized()
    ends = {"upper": (upper, along), "lower": (lower, way.normalized() * length - along)}
    return {name: _frame(end, hinge) @ _frame(bone, rest_hinge).transposed() for name, (bone, end) in ends.items()}


def key_rotation(bone: bpy.types.PoseBone, rotation: Matrix, *, frame: int, previous: dict[str, Quaternion]) -> None:
    """Key a rotation of a pose, the short way from the bone's previous key."""
    rest = bone.bone.matrix_local.to_3x3()
    channel = (rest.inverted() @ rotation @ rest).to_quaternion()
    if bone.name in previous:
        channel.make_compatible(previous[bone.name])
    previous[bone.name] = channel
    bone.rotation_mode = "QUATERNION"
    bone.rotation_quaternion = channel
    bone.keyframe_insert("rotation_quaternion", frame=frame, group=bone.name)


def key_hips(armature: bpy.types.Object, offset: Vector, *, frame: int) -> None:
    """Key the hips' offset (metres, armature axes)."""
    bone = armature.pose.bones["hips"]
    bone.location = bone.bone.matrix_local.to_3x3().inverted() @ offset
    bone.keyframe_insert("location", frame=frame, group="hips")


def _frame(along: Vector, hinge: Vector) -> Matrix:
    """Axes as columns: along a bone, about its hinge, and across both."""
    first = along.normalized()
    third = first.cross(hinge).normalized()
    return Matrix((first, third.cross(first), third)).transposed()
