"""The arm of [CTL*20] Figure 2: a bare right arm out of a short sleeve, three bones, a cage of rings.

Along x from the shoulder at 0, thumb up, the back of the hand toward −Y; the elbow bends upward.
"""

from __future__ import annotations

import numpy as np

from .bar import ring_faces, smooth_step
from .biped_shape import hand_field
from .biped_skeleton import HAND_ALONG, HAND_BACK, HAND_FRONT
from .biped_skeleton import WRIST as BIPED_WRIST
from .fields import Field, halfspace, intersection, ring, union
from .parts import Array, Bone, Cage, Character, Part, join_parts
from .surface_nets import mesh_field

# Along the arm, in metres; the weights blend over this much to either side of a joint.
ELBOW, WRIST, TIP = 0.235, 0.475, 0.710
ELBOW_BLEND, WRIST_BLEND = 0.20, 0.05
LONG = "Long"

_HAND_SCALE = 1.14
_SMOOTHING = 0.04
_HEM = 0.045

# The bare arm: x and radius.
_LIMB = (
    (-0.060, 0.080),
    (0.030, 0.079),
    (0.110, 0.075),
    (0.190, 0.067),
    (0.235, 0.066),
    (0.300, 0.071),
    (0.365, 0.061),
    (0.445, 0.045),
    (0.500, 0.041),
)

# Rings of the cage: x, half depth (y), lower and upper z.
_RINGS = (
    (-0.085, 0.094, -0.094, 0.094),
    (0.055, 0.110, -0.110, 0.110),
    (0.140, 0.092, -0.092, 0.092),
    (0.235, 0.084, -0.084, 0.084),
    (0.330, 0.084, -0.084, 0.084),
    (0.450, 0.066, -0.066, 0.072),
    (0.560, 0.080, -0.098, 0.168),
    (0.732, 0.064, -0.096, 0.104),
)


def arm(*, cell: float = 0.0075) -> Character:
    """The arm in quads of about `cell` metres, and the cage key `LONG`: a longer, stouter arm."""
    skin_box = np.array([(-0.02, -0.12, -0.15), (0.74, 0.12, 0.19)])
    sleeve_box = np.array([(-0.12, -0.13, -0.13), (0.11, 0.13, 0.13)])
    bones = [
        Bone("upper_arm", (0.0, 0.0, 0.0), (ELBOW, 0.0, 0.0)),
        Bone("forearm", (ELBOW, 0.0, 0.0), (WRIST, 0.0, 0.0), "upper_arm", connected=True),
        Bone("hand", (WRIST, 0.0, 0.0), (TIP, 0.0, 0.0), "forearm", connected=True),
    ]
    names = tuple(bone.name for bone in bones)
    parts = [
        Part("arm", *mesh_field(_limb_and_hand(), *skin_box, cell=cell), "Skin", names),
        Part("sleeve", *mesh_field(_sleeve(), *sleeve_box, cell=1.4 * cell), "Hoodie", names),
        Part("hem", *mesh_field(_hem(), *sleeve_box, cell=cell), "Trim", names),
    ]
    skin = join_parts("Arm", parts, [arm_weights(part.vertices[:, 0]) for part in parts])
    cage = arm_cage()
    return Character("Arm", [skin], bones, cage, {LONG: long_cage(cage)})


def arm_weights(x: Array) -> Array:
    """Weights of the three bones by smooth steps along the arm (#V by 3)."""
    forearm, hand = smooth_step(x - ELBOW, ELBOW_BLEND), smooth_step(x - WRIST, WRIST_BLEND)
    return np.column_stack([1.0 - forearm, forearm - hand, hand])


def arm_cage() -> Cage:
    """Rings of four corners along the arm, faces outward."""
    vertices = [
        (x, y, z) for x, half, low, high in _RINGS for y, z in ((-half, low), (half, low), (half, high), (-half, high))
    ]
    return Cage(np.array(vertices), ring_faces(len(_RINGS)))


def long_cage(cage: Cage) -> Array:
    """The cage of an arm with a longer forearm, stoutest below the elbow (#C by 3)."""
    x = cage.vertices[:, 0]
    swell = np.interp(x, [0.055, 0.140, 0.235, 0.330, 0.450, 0.560], [1.0, 1.15, 1.35, 1.75, 1.3, 1.12])
    grown = cage.vertices * np.column_stack([np.ones_like(x), swell, swell])
    grown[:, 0] += np.interp(x, [ELBOW, WRIST], [0.0, 0.105])
    return grown


def limb_radius(x: Array) -> Array:
    """Radius of the bare arm at `x` along its axis (#P)."""
    at, radius = np.array(_LIMB).T
    return np.mean([np.interp(x + shift, at, radius) for shift in np.linspace(-_SMOOTHING, _SMOOTHING, 9)], axis=0)


def _limb_and_hand() -> Field:
    return union([_limb(), _hand()], 0.03)


def _limb() -> Field:
    """Round about x, from the shoulder's flat end to a rounded one inside the hand."""

    def distance(p: Array) -> Array:
        at = np.clip(p[:, 0], _LIMB[0][0], _LIMB[-1][0])
        return np.linalg.norm(np.column_stack([p[:, 0] - at, p[:, 1:]]), axis=1) - limb_radius(at)

    return intersection([distance, halfspace((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0))], 0.02)


def _hand() -> Field:
    """The biped's left hand, mirrored into a right one."""
    frame = np.stack([HAND_ALONG, -HAND_BACK, HAND_FRONT]) / _HAND_SCALE
    field = hand_field()
    return lambda p: _HAND_SCALE * field(BIPED_WRIST + (p - [WRIST, 0.0, 0.0]) @ frame)


def _sleeve() -> Field:
    """Closed over the shoulder; the arm comes out of it."""

    def tube(p: Array) -> Array:
        return np.linalg.norm(np.column_stack([np.minimum(p[:, 0] - 0.01, 0.0), p[:, 1:]]), axis=1) - 0.088

    return intersection([tube, halfspace((_HEM, 0.0, 0.0), (1.0, 0.0, 0.0))], 0.012)


def _hem() -> Field:
    axes = np.array([(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
    return ring((_HEM, 0.0, 0.0), axes, radii=(0.084, 0.084), thickness=0.011, height=1.4)
