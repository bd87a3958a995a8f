"""A 48-frame walk in place for the biped: feet by two-bone IK in the hips' frame, the rest from sines of the phase."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from .biped_skeleton import FINGERS, HAND_ALONG, HAND_BACK
from .posing import Pose, key_hips, key_rotation, reflect, turn

FRAMES = 48
KEY_STEP = 2
_STRIDE = 0.22
_STANCE = 0.56


def add_walk(armature: bpy.types.Object, name: str = "walk") -> bpy.types.Action:
    """Key the walk on `armature` as the action `name`, frames 1 to 48 (the key at 49 repeats the first)."""
    previous: dict[str, Quaternion] = {}
    for frame in range(1, FRAMES + 2, KEY_STEP):
        rotations, hips = walk_pose(armature, 2.0 * np.pi * (frame - 1) / FRAMES)
        for bone_name, rotation in rotations.items():
            key_rotation(armature.pose.bones[bone_name], rotation, frame=frame, previous=previous)
        key_hips(armature, hips, frame=frame)
    action = armature.animation_data.action
    action.name = name
    action.use_frame_range, action.frame_start, action.frame_end, action.use_cyclic = True, 1, FRAMES, True
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, 24
    return action


def walk_pose(armature: bpy.types.Object, phase: float) -> tuple[Pose, Vector]:
    """Rotations by bone (armature axes, relative to the parent) and the hips' offset (metres) at `phase` (radians)."""
    c, s = np.cos(phase), np.sin(phase)
    hips_offset = Vector((0.022 * s, 0.0, -0.027 - 0.016 * np.cos(2.0 * phase - 0.4)))
    hips = turn("z", -9.0 * c) @ turn("y", -4.0 * s) @ turn("x", 3.0)
    pose: Pose = {"hips": hips}
    for bone_name in ("spine.001", "spine.002", "chest"):
        pose[bone_name] = turn("z", 6.0 * c) @ turn("y", 2.2 * s) @ turn("x", 1.2 + 1.0 * np.cos(2.0 * phase - 0.8))
    pose["neck"] = turn("z", -4.0 * c) @ turn("x", -3.0 - 1.5 * np.cos(2.0 * phase - 1.2))
    pose["head"] = turn("z", -4.0 * c) @ turn("y", -2.5 * s) @ turn("x", -2.0 - 2.0 * np.cos(2.0 * phase - 1.6))
    for side, shift in (("L", 0.0), ("R", np.pi)):
        frame = (hips if side == "L" else reflect(hips), _side_offset(hips_offset, side))
        for bone_name, rotation in {**_arm(phase + shift), **_leg(armature, phase + shift, *frame)}.items():
            pose[f"{bone_name}.{side}"] = rotation if side == "L" else reflect(rotation)
    return pose, hips_offset


def _arm(phase: float) -> Pose:
    """The left arm, back when the left foot is in front."""
    c, late = np.cos(phase), np.cos(phase - 0.5)
    arm = (HAND_ALONG * [1.0, 0.0, 1.0]) / np.linalg.norm(HAND_ALONG[[0, 2]])
    hinge = Vector(np.cross(arm, [0.0, -1.0, 0.0]))
    pose = {
        "clavicle": turn("z", 5.0 * c) @ turn("y", -2.0),
        "upper_arm": turn("x", 34.0 * c - 2.0) @ turn("y", 17.0 + 3.0 * np.cos(2.0 * phase)),
        "forearm": Matrix.Rotation(np.radians(40.0 - 22.0 * late), 3, hinge),
        "hand": Matrix.Rotation(np.radians(4.0 - 10.0 * np.cos(phase - 1.0)), 3, hinge),
    }
    fold = Vector(np.cross(HAND_ALONG, -HAND_BACK))
    for k, finger in enumerate(FINGERS):
        curl = 6.0 if finger == "thumb" else 13.0 + 4.0 * k + 4.0 * np.cos(phase - 1.2)
        for joint in (1, 2, 3):
            pose[f"{finger}.{joint:02d}"] = Matrix.Rotation(np.radians(curl), 3, fold)
    return pose


def _foot(phase: float) -> tuple[float, float, float]:
    """Forward offset and height of the ball (metres) and pitch of the foot (radians, heel up) of a foot that
    strikes at phase 0.
    """
    t = (phase / (2.0 * np.pi)) % 1.0
    if t < _STANCE:
        u = t / _STANCE
        strike = max(0.0, 1.0 - u / 0.16)
        push = max(0.0, (u - 0.62) / 0.38)
        return _STRIDE * (1.0 - 2.0 * u), 0.036 * strike, np.radians(40.0 * push**1.6 - 20.0 * strike)
    u = (t - _STANCE) / (1.0 - _STANCE)
    ease = u * u * (3.0 - 2.0 * u)
    lift = 0.075 * np.sin(np.pi * u) ** 0.9 + 0.036 * ease
    return (
        _STRIDE * (2.0 * ease - 1.0),
        lift,
        np.radians(40.0 * (1.0 - u) ** 1.3 - 20.0 * ease + 14.0 * np.sin(np.pi * u)),
    )


def _leg(armature: bpy.types.Object, phase: float, hips: Matrix, offset: Vector) -> Pose:
    """The left leg: the ankle goes where the foot's roll wants it, thigh and shin follow in the hips' y–z plane."""
    bones = armature.data.bones
    hip, knee, ankle, ball = (bones[name].head_local.copy() for name in ("thigh.L", "shin.L", "foot.L", "toe.L"))
    pivot = bones["hips"].head_local
    forward, lift, pitch = _foot(phase)
    roll = turn("x", np.degrees(pitch))
    target = ball + Vector((0.0, -forward, lift)) + roll @ (ankle - ball)
    reach = hips.inverted() @ (target - (pivot + offset + hips @ (hip - pivot)))
    thigh, shin = (knee - hip).yz, (ankle - knee).yz
    length = min(reach.yz.length, 0.999 * (thigh.length + shin.length))
    cosine = (thigh.length_squared + length**2 - shin.length_squared) / (2.0 * thigh.length * length)
    toward = np.arctan2(reach.y, -reach.z) - np.arccos(np.clip(cosine, -1.0, 1.0))
    upper = toward - np.arctan2(thigh.x, -thigh.y)
    knee_at = Vector((np.sin(toward), -np.cos(toward))) * thigh.length
    ankle_at = reach.yz.normalized() * length
    lower = np.arctan2(*((ankle_at - knee_at) * Vector((1, -1)))) - np.arctan2(shin.x, -shin.y)
    tilt = hips.to_euler("ZYX").x
    toe = max(pitch, 0.0) * (0.85 if (phase / (2 * np.pi)) % 1.0 < _STANCE else 0.3)
    angles = {"thigh": upper, "shin": lower - upper, "foot": pitch - tilt - lower, "toe": -toe}
    return {bone_name: turn("x", np.degrees(angle)) for bone_name, angle in angles.items()}


def _side_offset(offset: Vector, side: str) -> Vector:
    return offset.copy() if side == "L" else Vector((-offset.x, offset.y, offset.z))
