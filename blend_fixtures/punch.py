"""A 24-frame punch of the right hand for the biped, in few keys: guard, wound up, strike, follow through, settled.

Feet stay where they are. Places are wrists and ankles in armature axes, in metres; angles in degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from .biped_skeleton import FINGERS, HAND_ALONG, HAND_BACK, HAND_FRONT
from .posing import Pose, key_hips, key_rotation, placed, reach, reflect, turn

FRAMES = 24
STRIKE = 13
_FEET = {"L": ((0.125, -0.170), -8.0), "R": ((-0.150, 0.185), -48.0)}  # the ankle's place, the foot's turn
# The left hand's fist: fingers fold to the palm; the thumb rolls before it and lies down over them.
_CURLS, _FOLD = (72.0, 82.0, 60.0), Vector(np.cross(HAND_ALONG, -HAND_BACK))
_ROLL, _BESIDE = Vector(np.cross(HAND_FRONT, -HAND_BACK)), Vector(np.cross(HAND_FRONT, HAND_ALONG))
_THUMB = [
    Matrix.Rotation(np.radians(angle), 3, axis) for angle, axis in ((70.0, _ROLL), (50.0, _BESIDE), (50.0, _BESIDE))
]


@dataclass(frozen=True)
class _Body:
    """One key. `hips`: offset; `twist`: of the hips and of the chest over them, to the left; `lean`: forward, of both.

    `left`, `right`: wrists; `elbow`: where the right elbow points; `shoulders`: left and right, how far they
    are drawn forward; `heel`: how far the right heel is lifted.
    """

    hips: tuple[float, float, float]
    twist: tuple[float, float]
    lean: tuple[float, float]
    left: tuple[float, float, float]
    right: tuple[float, float, float]
    elbow: tuple[float, float, float] = (-1.0, 0.4, -0.8)
    shoulders: tuple[float, float] = (8.0, 8.0)
    heel: float = 4.0


_GUARD = _Body((0.0, 0.02, -0.055), (-28.0, -10.0), (4.0, 9.0), (0.16, -0.38, 1.13), (-0.20, -0.26, 1.09))
_WOUND = _Body(
    hips=(-0.02, 0.085, -0.085),
    twist=(-46.0, -26.0),
    lean=(-4.0, 5.0),
    left=(0.10, -0.42, 1.15),
    right=(-0.42, 0.14, 1.04),
    elbow=(-0.5, 1.0, -0.3),
    shoulders=(14.0, -8.0),
)
_STRIKE = _Body(
    hips=(0.02, -0.115, -0.070),
    twist=(24.0, 46.0),
    lean=(9.0, 12.0),
    left=(0.27, -0.20, 1.04),
    right=(0.00, -1.20, 1.14),
    elbow=(-1.0, 0.6, -0.1),
    shoulders=(0.0, 24.0),
    heel=34.0,
)
_FOLLOW = replace(_STRIKE, hips=(0.03, -0.130, -0.085), twist=(28.0, 50.0), right=(0.06, -1.2, 1.08), heel=38.0)
KEYS = {1: _GUARD, 9: _WOUND, STRIKE: _STRIKE, 16: _FOLLOW, 22: _GUARD}


def add_punch(armature: bpy.types.Object, name: str = "punch") -> bpy.types.Action:
    """Key the punch on `armature` as the action `name`, frames 1 to 24."""
    previous: dict[str, Quaternion] = {}
    for frame, body in KEYS.items():
        for bone_name, rotation in _pose(armature, body).items():
            key_rotation(armature.pose.bones[bone_name], rotation, frame=frame, previous=previous)
        key_hips(armature, Vector(body.hips), frame=frame)
    action = armature.animation_data.action
    action.name = name
    action.use_frame_range, action.frame_start, action.frame_end = True, 1, FRAMES
    return action


def _pose(armature: bpy.types.Object, body: _Body) -> Pose:
    pose: Pose = {"hips": turn("z", body.twist[0]) @ turn("x", body.lean[0])}
    for bone_name in ("spine.001", "spine.002", "chest"):
        pose[bone_name] = turn("z", body.twist[1] / 3.0) @ turn("x", body.lean[1] / 3.0)
    for bone_name in ("neck", "head"):  # looks where it strikes
        pose[bone_name] = turn("z", -0.46 * sum(body.twist)) @ turn("x", -0.35 * sum(body.lean))
    hips = Vector(body.hips)
    for side, wrist in (("L", body.left), ("R", body.right)):
        elbow = Vector(body.elbow) if side == "R" else Vector((1.0, 0.4, -0.8))
        drawn = turn("z", body.shoulders[side == "R"]) @ turn("y", 0.4 * body.shoulders[side == "R"])
        pose[f"clavicle.{side}"] = drawn if side == "R" else reflect(drawn)
        pose |= _arm(armature, pose, side, hips, Vector(wrist), elbow)
        pose |= _leg(armature, pose, side, hips, body.heel if side == "R" else 0.0)
    return pose


def _arm(armature: bpy.types.Object, pose: Pose, side: str, hips: Vector, wrist: Vector, elbow: Vector) -> Pose:
    """The arm reaches for `wrist`; the hand is a fist."""
    names = [f"{bone}.{side}" for bone in ("upper_arm", "forearm", "hand")]
    clavicle, _ = placed(armature, pose, f"clavicle.{side}", hips)
    _, shoulder = placed(armature, pose, names[0], hips)
    joints = tuple(armature.data.bones[name].head_local for name in names)
    turns = reach(joints, Vector((0.0, 1.0, 0.0)), shoulder, wrist, elbow)
    made = {names[0]: clavicle.inverted() @ turns["upper"], names[1]: turns["upper"].inverted() @ turns["lower"]}
    for finger in FINGERS:
        for joint in range(3):
            fold = _THUMB[joint] if finger == "thumb" else Matrix.Rotation(np.radians(_CURLS[joint]), 3, _FOLD)
            made[f"{finger}.{joint + 1:02d}.{side}"] = fold if side == "L" else reflect(fold)
    return made


def _leg(armature: bpy.types.Object, pose: Pose, side: str, hips: Vector, heel: float) -> Pose:
    """The leg to its foot, which rolls over the ball."""
    names = [f"{bone}.{side}" for bone in ("thigh", "shin", "foot", "toe")]
    hip_turn, _ = placed(armature, pose, "hips", hips)
    _, hip = placed(armature, pose, names[0], hips)
    *joints, ball = (armature.data.bones[name].head_local for name in names)
    (x, y), yaw = _FEET[side]
    flat, foot = turn("z", yaw), turn("z", yaw) @ turn("x", heel)
    ankle = Vector((x, y, joints[2].z)) + flat @ (ball - joints[2]) + foot @ (joints[2] - ball)
    forward = Vector((0.0, -1.0, 0.0))
    turns = reach(tuple(joints), forward, hip, ankle, turn("z", 0.7 * yaw) @ forward)
    rotations = (hip_turn.inverted() @ turns["upper"], turns["upper"].inverted() @ turns["lower"])
    return dict(zip(names, (*rotations, turns["lower"].inverted() @ foot, turn("x", -heel)), strict=True))
