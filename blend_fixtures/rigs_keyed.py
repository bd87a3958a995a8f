"""Bars whose roots move, and bones under every kind of key."""

from __future__ import annotations

from .build import RigObjects
from .limbs import (
    build,
    key,
    limb,
    pose_bones,
    turn,
)


def moving_root_bone() -> RigObjects:
    """The root bone walks and turns."""
    rig = build(limb())
    root = pose_bones(rig)[0]
    key(root, "location", (0.0, 0.0, 0.0), (1.5, -2.0, 0.7), (3.0, 1.0, -1.0))
    turn(rig, 0, (0.4, 1.1, -0.3))
    turn(rig, 1, (0.0, 0.3, 0.8))
    return rig


def moving_armature_object() -> RigObjects:
    """The armature object walks, turns and grows; the skin is its child."""
    rig = build(limb())
    key(rig.armature, "location", (0.0, 0.0, 0.0), (2.0, 1.0, 0.5), (-1.0, 3.0, 1.0))
    key(rig.armature, "rotation_euler", (0.0, 0.0, 0.0), (0.3, 0.2, 1.5), (0.0, -0.4, 3.0))
    key(rig.armature, "scale", (1.0, 1.0, 1.0), (1.0, 1.5, 0.8), (0.5, 0.5, 0.5))
    turn(rig, 1, (0.2, 0.0, 0.9))
    return rig


def moving_armature_object_and_free_skin() -> RigObjects:
    """The same, but the skin has no parent: the armature moves against it."""
    rig = moving_armature_object()
    rig.skins[0].parent = None
    return rig


def keyed_locations() -> RigObjects:
    """Every bone of the chain is moved, not only turned."""
    rig = build(limb())
    for k, bone in enumerate(pose_bones(rig)):
        key(bone, "location", (0.0, 0.0, 0.0), (0.1 * k, 0.15, -0.2), (-0.1, 0.05 * k, 0.25))
        turn(rig, k, (0.1 * k, 0.3, 0.2))
    return rig


def scaled_bones() -> RigObjects:
    """Non-uniform scale above turned bones, which shears them, and a bone turned inside out."""
    rig = build(limb(4))
    key(pose_bones(rig)[0], "scale", (1.0, 1.0, 1.0), (1.4, 0.7, 1.1), (0.8, 1.3, 1.5))
    key(pose_bones(rig)[1], "scale", (1.0, 1.0, 1.0), (0.6, 1.5, 1.0), (1.2, 1.2, 0.7))
    key(pose_bones(rig)[3], "scale", (1.0, 1.0, 1.0), (-1.0, 1.0, 0.8), (-1.0, 1.2, 1.0))
    for k in range(4):
        turn(rig, k, (0.3, 0.5 - 0.2 * k, 0.6))
    return rig


def collapsed_bone() -> RigObjects:
    """A bone scaled to nothing at frame 25, as animators do to hide a part."""
    rig = build(limb())
    turn(rig, 1, (0.0, 0.2, 0.7))
    key(pose_bones(rig)[2], "scale", (1.0, 1.0, 1.0), (0.5, 0.5, 0.5), (0.0, 0.0, 0.0))
    return rig


def rotation_modes() -> RigObjects:
    """Quaternion, axis-angle and an unusual Euler order in one chain."""
    rig = build(limb())
    first, second, third = pose_bones(rig)
    first.rotation_mode, second.rotation_mode, third.rotation_mode = "QUATERNION", "AXIS_ANGLE", "ZYX"
    key(first, "rotation_quaternion", (1.0, 0.0, 0.0, 0.0), (0.9, 0.3, 0.2, 0.1), (0.5, -0.5, 0.5, 0.5))
    key(second, "rotation_axis_angle", (0.0, 0.0, 1.0, 0.0), (0.8, 1.0, 1.0, 0.0), (-1.2, 0.0, 0.3, 1.0))
    key(third, "rotation_euler", (0.0, 0.0, 0.0), (0.3, 0.9, -0.5), (1.0, 0.2, 0.4))
    return rig
