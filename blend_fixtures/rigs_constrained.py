"""Bars whose bones are posed by constraints and drivers."""

from __future__ import annotations

import numpy as np
from mathutils import Vector

from .build import RigObjects
from .limbs import (
    add_curve,
    add_empty,
    build,
    control,
    editing,
    key,
    limb,
    pose_bones,
    turn,
    turn_bone,
)


def stretch_to() -> RigObjects:
    """A bone that stretches to a control bone, with its volume kept, and bulges on its child."""
    rig = build(limb(extra=[control("hand", (1.0, 0.0, 0.0))]))
    stretch = pose_bones(rig)[1].constraints.new("STRETCH_TO")
    stretch.target, stretch.subtarget = rig.armature, "hand"
    stretch.rest_length = rig.armature.data.bones[1].length
    key(rig.armature.pose.bones["hand"], "location", (0.0, 0.0, 0.0), (0.4, -0.6, 0.5), (-0.3, 0.2, -0.5))
    return rig


def ik_with_pole() -> RigObjects:
    """An IK chain of two with a pole; both controls do not deform."""
    controls = [control("hand", (0.9, 0.0, 0.0)), control("pole", (0.0, 0.0, 1.2))]
    rig = build(limb(extra=controls))
    with editing(rig.armature) as bones:
        bones["bone.1"].tail.z = bones["bone.2"].head.z = 0.05
    ik = pose_bones(rig)[2].constraints.new("IK")
    ik.target, ik.subtarget, ik.chain_count = rig.armature, "hand", 2
    ik.pole_target, ik.pole_subtarget, ik.pole_angle = rig.armature, "pole", -0.5 * np.pi
    key(rig.armature.pose.bones["hand"], "location", (-0.1, 0.0, 0.0), (-0.4, 0.3, 0.3), (-0.6, -0.3, 0.0))
    key(rig.armature.pose.bones["pole"], "location", (0.0, 0.0, 0.0), (0.0, 0.8, 0.0), (0.5, -0.8, 0.0))
    return rig


def stretchy_ik() -> RigObjects:
    """An IK chain whose bones stretch, pulled farther than it is long."""
    rig = build(limb(extra=[control("hand", (1.0, 0.0, 0.0))]))
    ik = pose_bones(rig)[2].constraints.new("IK")
    ik.target, ik.subtarget = rig.armature, "hand"
    for bone in pose_bones(rig)[:3]:
        bone.ik_stretch = 0.4
    key(rig.armature.pose.bones["hand"], "location", (0.0, 0.0, 0.0), (0.8, 0.5, 0.3), (-0.5, 0.4, -0.6))
    return rig


def spline_ik() -> RigObjects:
    """A chain along a curve that is moved and bent by its own shape keys."""
    rig = build(limb(4))
    curve = add_curve("Path", [(-1.0, 0.0, 0.0), (-0.3, 0.0, 0.0), (0.3, 0.0, 0.0), (1.1, 0.0, 0.0)])
    curve.shape_key_add(name="Basis")
    bent = curve.shape_key_add(name="Bent")
    for point, offset in zip(bent.data, (0.0, 0.3, -0.3, 0.6), strict=True):
        point.co += Vector((0.0, offset, -0.5 * offset))
    key(bent, "value", 0.0, 1.0, 0.4)
    spline = pose_bones(rig)[3].constraints.new("SPLINE_IK")
    spline.target, spline.chain_count, spline.y_scale_mode = curve, 4, "FIT_CURVE"
    return rig


def copies_and_limits() -> RigObjects:
    """Copy Rotation and Copy Location from control bones, Limit Rotation and Limit Scale on keyed bones."""
    rig = build(limb(4, extra=[control("turn", (0.0, 0.8, 0.0)), control("place", (0.0, -0.8, 0.0))]))
    bones = pose_bones(rig)
    copied = bones[1].constraints.new("COPY_ROTATION")
    copied.target, copied.subtarget, copied.influence = rig.armature, "turn", 0.7
    copied.target_space = copied.owner_space = "LOCAL"
    placed = bones[3].constraints.new("COPY_LOCATION")
    placed.target, placed.subtarget, placed.use_z, placed.influence = rig.armature, "place", False, 0.5
    limit = bones[2].constraints.new("LIMIT_ROTATION")
    limit.use_limit_x = limit.use_limit_z = True
    limit.max_x, limit.max_z, limit.owner_space = 0.2, 0.3, "LOCAL"
    size = bones[0].constraints.new("LIMIT_SCALE")
    size.use_max_x, size.max_x = True, 1.1
    key(bones[0], "scale", (1.0, 1.0, 1.0), (1.5, 1.2, 1.0), (0.8, 0.8, 0.8))
    turn(rig, 2, (0.9, 0.1, 0.9))
    turn_bone(rig.armature.pose.bones["turn"], (0.5, 0.6, 0.7))
    key(rig.armature.pose.bones["place"], "location", (0.0, 0.0, 0.0), (0.5, 0.9, 0.4), (1.0, 1.0, 0.0))
    return rig


def targets_outside() -> RigObjects:
    """Child Of and Damped Track to objects, and an Armature constraint between two bones."""
    rig = build(limb(4))
    bones = pose_bones(rig)
    holder, aim = add_empty("Holder", (-1.0, 0.0, 0.0)), add_empty("Aim", (1.0, 0.5, 1.0))
    child = bones[0].constraints.new("CHILD_OF")
    child.target, child.inverse_matrix = holder, holder.matrix_world.inverted()
    track = bones[2].constraints.new("DAMPED_TRACK")
    track.target, track.track_axis = aim, "TRACK_Y"
    both = bones[3].constraints.new("ARMATURE")
    for name, weight in (("bone.0", 0.3), ("bone.2", 0.7)):
        target = both.targets.new()
        target.target, target.subtarget, target.weight = rig.armature, name, weight
    key(holder, "location", (-1.0, 0.0, 0.0), (-0.5, 0.6, 0.2), (-1.5, -0.5, 0.8))
    key(holder, "rotation_euler", (0.0, 0.0, 0.0), (0.5, 0.2, 0.4), (-0.6, 0.0, 0.9))
    key(aim, "location", (1.0, 0.5, 1.0), (0.8, 1.4, -0.5), (1.5, -1.0, 0.5))
    return rig


def driven_bones() -> RigObjects:
    """Bones turned and scaled by drivers that read another bone."""
    rig = build(limb(extra=[control("slider", (0.0, 1.0, 0.0))]))
    for bone, path, index, expression in (
        (pose_bones(rig)[1], "rotation_euler", 2, "2 * way"),
        (pose_bones(rig)[2], "rotation_euler", 0, "-way"),
        (pose_bones(rig)[2], "scale", 1, "1 + way"),
    ):
        bone.rotation_mode = "XYZ"
        driver = bone.driver_add(path, index).driver
        variable = driver.variables.new()
        variable.name, variable.type = "way", "TRANSFORMS"
        target = variable.targets[0]
        target.id, target.bone_target, target.transform_type = rig.armature, "slider", "LOC_X"
        target.transform_space = "LOCAL_SPACE"
        driver.expression = expression
    key(rig.armature.pose.bones["slider"], "location", (0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (-0.4, 0.0, 0.0))
    return rig
