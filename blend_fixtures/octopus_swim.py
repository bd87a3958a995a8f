"""A 48-frame cycle for the octopus: arms ripple one after the other, the head nods."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from .octopus import LINKS, angles, arm_bone
from .posing import Pose, key_rotation, turn

FRAMES = 48
KEY_STEP = 3


def add_swim(armature: bpy.types.Object, name: str = "swim") -> bpy.types.Action:
    """Key the cycle on `armature` as the action `name`, frames 1 to 48 (the key at 49 repeats the first)."""
    previous: dict[str, Quaternion] = {}
    for frame in range(1, FRAMES + 2, KEY_STEP):
        for bone_name, rotation in swim_pose(2.0 * np.pi * (frame - 1) / FRAMES).items():
            key_rotation(armature.pose.bones[bone_name], rotation, frame=frame, previous=previous)
    action = armature.animation_data.action
    action.name = name
    action.use_frame_range, action.frame_start, action.frame_end, action.use_cyclic = True, 1, FRAMES, True
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, 24
    return action


def swim_pose(phase: float) -> Pose:
    """Rotations by bone (armature axes, relative to the parent) at `phase` (radians)."""
    pose: Pose = {"body": turn("x", 2.0 * np.sin(phase)), "head": turn("x", -6.0 * np.sin(phase - 0.6))}
    for arm, angle in enumerate(angles()):
        hinge = Vector((np.sin(angle), -np.cos(angle), 0.0))  # a turn about it lifts the arm
        beat = phase + 0.9 * np.pi * (arm % 2) + 0.35 * arm
        for link in range(LINKS):
            lift = 7.0 + 4.0 * link + (9.0 + 5.0 * link) * np.sin(beat - 0.7 * link)
            sway = 8.0 * np.sin(beat + 1.0 - 0.6 * link)
            pose[arm_bone(arm, link)] = Matrix.Rotation(np.radians(lift), 3, hinge) @ turn("z", sway)
    return pose
