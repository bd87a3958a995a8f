"""Bars whose bones inherit, or do not, in every way, and hierarchies of every kind."""

from __future__ import annotations

import numpy as np

from .build import RigObjects
from .limbs import (
    bent,
    build,
    carry,
    key,
    limb,
    pose_bones,
    replaced,
    turn,
    turn_bone,
)
from .parts import Bone


def every_inherit_scale() -> RigObjects:
    """A scaled and turned chain where each bone inherits scale in another of Blender's six ways."""
    modes = ("FULL", "FIX_SHEAR", "ALIGNED", "AVERAGE", "NONE", "NONE_LEGACY")
    rig = build(limb(7))
    for bone, mode in zip(rig.armature.data.bones[1:], modes, strict=True):
        bone.inherit_scale = mode
    for k, bone in enumerate(pose_bones(rig)):
        key(bone, "scale", (1.0, 1.0, 1.0), (1.2, 0.8, 1.0 + 0.1 * k), (0.9, 1.2, 0.8))
        turn(rig, k, (0.1, 0.2, 0.3))
    return rig


def no_inherited_rotation() -> RigObjects:
    """A bone that does not turn with its parent, scaled and not."""
    rig = build(limb(4))
    rig.armature.data.bones[1].use_inherit_rotation = False
    rig.armature.data.bones[3].use_inherit_rotation = False
    rig.armature.data.bones[3].inherit_scale = "NONE"
    key(pose_bones(rig)[0], "scale", (1.0, 1.0, 1.0), (1.3, 1.0, 0.8), (0.9, 1.1, 1.0))
    for k in range(4):
        turn(rig, k, (0.4, 0.1 * k, 0.6))
    return rig


def no_local_location() -> RigObjects:
    """Bones moved along the armature's axes, not their own."""
    rig = build(limb())
    for k, bone in enumerate(pose_bones(rig)):
        bone.bone.use_local_location = False
        key(bone, "location", (0.0, 0.0, 0.0), (0.2, 0.1 * k, 0.3), (0.0, -0.3, 0.1))
        turn(rig, k, (0.3, 0.4, 0.2))
    return rig


def several_roots() -> RigObjects:
    """Three bones side by side without parents, each with its own motion, weights blended between them."""
    character = limb()
    bones = [Bone(bone.name, bone.head, bone.tail) for bone in character.bones]
    rig = build(replaced(character, bones=bones))
    for k, bone in enumerate(pose_bones(rig)):
        key(bone, "location", (0.0, 0.0, 0.0), (0.1, 0.2 * k, 0.3), (0.2 * k, -0.2, 0.0))
        turn(rig, k, (0.5 - 0.3 * k, 0.4, 0.3 * k))
    return rig


def control_bones_between() -> RigObjects:
    """Non-deforming bones inside the chain and outside the cage; one has a vertex group that must not count."""
    character = limb()
    bones = [
        Bone("ground", (0.0, 0.0, -3.0), (0.0, 0.5, -3.0), deform=False),
        Bone("bone.0", character.bones[0].head, character.bones[0].tail, "ground"),
        Bone("lift", character.bones[0].tail, (-0.3, 0.0, 0.5), "bone.0", deform=False),
        Bone("bone.1", character.bones[1].head, character.bones[1].tail, "lift"),
        Bone("bone.2", character.bones[2].head, character.bones[2].tail, "bone.1"),
    ]
    weights = np.zeros((len(character.skins[0].vertices), 5))
    weights[:, [1, 3, 4]] = character.skins[0].weights
    weights[:, 2] = 0.4
    rig = build(replaced(character, bones=bones, weights=weights))
    key(pose_bones(rig)[0], "location", (0.0, 0.0, 0.0), (0.5, 0.3, 0.0), (-0.3, 1.0, 0.2))
    for k in (0, 2, 3):
        turn(rig, k, (0.3, 0.5, -0.2))
    return rig


def bones_without_weights() -> RigObjects:
    """Deforming bones that no vertex knows: one in the chain, one at its end, one far away."""
    character = limb(5)
    weights = character.skins[0].weights.copy()
    weights[:, 1] += weights[:, 2]
    weights[:, 2] = 0.0
    bones = [
        *character.bones,
        Bone("leaf", (1.0, 0.0, 0.0), (1.4, 0.0, 0.0), "bone.4"),
        Bone("far", (5, 5, 5), (5, 5, 6)),
    ]
    rig = build(replaced(character, bones=bones, weights=np.pad(weights, ((0, 0), (0, 2)))))
    for k in range(7):
        turn(rig, k, (0.1 * k, 0.3, 0.3 - 0.1 * k))
    key(pose_bones(rig)[2], "location", (0.0, 0.0, 0.0), (0.0, 0.2, 0.1), (0.1, 0.0, -0.2))
    return rig


def mirrored_armature() -> RigObjects:
    """The armature object mirrored by a negative scale; the skin is its child."""
    rig = bent()
    rig.armature.scale = (-1.0, 1.0, 1.0)
    carry(rig)
    return rig


def mirrored_bones() -> RigObjects:
    """Left and right arms from a middle root, posed as mirror images of each other."""
    character = limb(4)
    bones = [Bone("root", (0.0, 0.0, -0.15), (0.0, 0.0, 0.15))]
    for side, sign in (("L", 1.0), ("R", -1.0)):
        elbow = (0.5 * sign, 0.0, 0.0)
        bones.append(Bone(f"upper.{side}", (0.0, 0.0, 0.0), elbow, "root"))
        bones.append(Bone(f"fore.{side}", elbow, (sign, 0.0, 0.0), f"upper.{side}", connected=True))
    weights = np.zeros((len(character.skins[0].vertices), 5))
    weights[:, 1:] = character.skins[0].weights[:, [2, 3, 1, 0]]  # the limb's bones run from right to left
    rig = build(replaced(character, bones=bones, weights=weights))
    key(pose_bones(rig)[0], "location", (0.0, 0.0, 0.0), (0.0, 0.2, 0.3), (0.1, 0.0, -0.3))
    for name in ("upper", "fore"):
        left, right = (rig.armature.pose.bones[f"{name}.{side}"] for side in "LR")
        turn_bone(left, (0.5, 0.2, 0.7))
        turn_bone(right, (0.5, -0.2, -0.7))
    return rig
