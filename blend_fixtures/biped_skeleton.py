"""The biped's skeleton: 47 bones, an A-pose, facing −Y, feet on z = 0, left is +x."""

from __future__ import annotations

import numpy as np

from .parts import Array, Bone

SPINE = ("hips", "spine.001", "spine.002", "chest", "neck", "head")
FINGERS = ("thumb", "index", "middle", "ring")

SHOULDER = np.array([0.170, 0.005, 1.170])
ELBOW = np.array([0.355, 0.020, 0.990])
WRIST = np.array([0.535, 0.000, 0.830])

# Along the arm, toward the thumb (the front) and out of the back of the hand.
HAND_ALONG = np.array([0.74, -0.06, -0.67]) / np.linalg.norm([0.74, -0.06, -0.67])
HAND_BACK = np.cross(HAND_ALONG, [0.0, -1.0, 0.0])
HAND_BACK = -HAND_BACK / np.linalg.norm(HAND_BACK)
HAND_FRONT = np.cross(HAND_BACK, HAND_ALONG) * np.sign(np.cross(HAND_BACK, HAND_ALONG)[1]) * -1.0

_FINGER_ROOTS = {"thumb": (0.020, 0.040), "index": (0.088, 0.040), "middle": (0.096, 0.0), "ring": (0.086, -0.040)}
_FINGER_SLOPES = {
    "thumb": (0.62, 0.80, -0.22),
    "index": (1.0, 0.13, -0.10),
    "middle": (1.0, 0.0, -0.10),
    "ring": (1.0, -0.15, -0.10),
}
_FINGER_LENGTHS = {"thumb": 0.092, "index": 0.090, "middle": 0.098, "ring": 0.084}


def hand_point(along: float, front: float, back: float = 0.0) -> Array:
    """A point of the left hand from hand coordinates: metres from the wrist along the hand, to its front and to
    its back.
    """
    return WRIST + along * HAND_ALONG + front * HAND_FRONT + back * HAND_BACK


def finger_joints(finger: str) -> Array:
    """Root, two joints and tip of a finger of the left hand (4 by 3)."""
    slope = np.asarray(_FINGER_SLOPES[finger])
    direction = slope @ np.stack([HAND_ALONG, HAND_FRONT, HAND_BACK]) / np.linalg.norm(slope)
    curl = -HAND_BACK * np.array([0.0, 0.0, 0.004, 0.012])[:, None]
    reach = np.array([0.0, 0.38, 0.70, 1.0]) * _FINGER_LENGTHS[finger]
    return hand_point(*_FINGER_ROOTS[finger]) + reach[:, None] * direction + curl


def biped_bones() -> list[Bone]:
    """All bones, parents first; only `root` does not deform."""
    bones = [Bone("root", (0.0, 0.0, 0.0), (0.0, 0.25, 0.0), deform=False)]
    heights = [
        (0.0, 0.010, 0.745),
        (0.0, 0.010, 0.850),
        (0.0, 0.008, 0.955),
        (0.0, 0.006, 1.060),
        (0.0, 0.010, 1.235),
        (0.0, 0.0, 1.360),
    ]
    tails = [*heights[1:], (0.0, 0.0, 1.800)]
    for k, name in enumerate(SPINE):
        bones.append(Bone(name, heights[k], tails[k], SPINE[k - 1] if k else "root", connected=k > 0))
    left = [*_arm(), *_leg()]
    return bones + left + [_mirror(bone) for bone in left]


def _arm() -> list[Bone]:
    palm = hand_point(0.075, 0.0)
    bones = [
        _bone("clavicle.L", (0.035, 0.0, 1.185), SHOULDER, "chest"),
        _bone("upper_arm.L", SHOULDER, ELBOW, "clavicle.L"),
        _bone("forearm.L", ELBOW, WRIST, "upper_arm.L"),
        _bone("hand.L", WRIST, palm, "forearm.L"),
    ]
    for finger in FINGERS:
        joints, parent = finger_joints(finger), "hand.L"
        for k in range(3):
            name = f"{finger}.{k + 1:02d}.L"
            bones.append(_bone(name, joints[k], joints[k + 1], parent, connected=k > 0))
            parent = name
    return bones


def _leg() -> list[Bone]:
    hip, knee, ankle = (0.098, 0.010, 0.710), (0.110, -0.006, 0.410), (0.116, 0.022, 0.105)
    ball, tip = (0.124, -0.098, 0.040), (0.128, -0.190, 0.040)
    return [
        _bone("thigh.L", hip, knee, "hips"),
        _bone("shin.L", knee, ankle, "thigh.L"),
        _bone("foot.L", ankle, ball, "shin.L"),
        _bone("toe.L", ball, tip, "foot.L"),
    ]


def _bone(name: str, head: Array | tuple, tail: Array | tuple, parent: str, *, connected: bool | None = None) -> Bone:
    joined = name not in ("clavicle.L", "thigh.L") and "01" not in name if connected is None else connected
    return Bone(name, tuple(float(x) for x in head), tuple(float(x) for x in tail), parent, joined)


def _mirror(bone: Bone) -> Bone:
    def flip(point: tuple[float, float, float]) -> tuple[float, float, float]:
        return (-point[0], point[1], point[2])

    parent = bone.parent[:-2] + ".R" if bone.parent.endswith(".L") else bone.parent
    return Bone(bone.name[:-2] + ".R", flip(bone.head), flip(bone.tail), parent, bone.connected, bone.deform)
