"""The biped's cage: closed, 118 vertices, quads, mirror-symmetric; torso, head, arms, mittens, legs, feet, with a
loop at each joint.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .biped_skeleton import ELBOW, HAND_ALONG, HAND_BACK, HAND_FRONT, SHOULDER, WRIST, hand_point
from .parts import Array, Cage

# Rings of the trunk: height, half width, front y, back y, and how far the middle bulges beyond front and back.
_TRUNK = {
    "hip": (0.580, 0.235, -0.150, 0.165, 0.010),
    "waist": (0.840, 0.235, -0.195, 0.200, 0.020),
    "armpit": (0.968, 0.265, -0.200, 0.205, 0.030),
    "shoulder": (1.300, 0.180, -0.150, 0.205, 0.040),
    "jaw": (1.350, 0.205, -0.215, 0.190, 0.050),
    "brow": (1.620, 0.285, -0.235, 0.235, 0.050),
    "crown": (1.915, 0.150, -0.115, 0.165, 0.010),
}
_ORDER = list(_TRUNK)


def biped_cage() -> Cage:
    """The cage around both skins, faces outward."""
    return _half().mirrored()


def biped_loops() -> dict[str, list[int]]:
    """Its loops of vertices by name: around the trunk as in `_TRUNK`, around limbs as "wrist.L"."""
    return _half().mirrored_loops()


def _half() -> _Half:
    half = _Half()
    trunk = [half.trunk_ring(name, *_TRUNK[name]) for name in _ORDER]
    for low, high in pairwise(trunk):
        half.join_trunk(low, high, gap=low is trunk[_ORDER.index("armpit")])
    half.faces.append(trunk[-1])
    _add_arm(half, trunk[_ORDER.index("armpit")], trunk[_ORDER.index("shoulder")])
    _add_leg(half, trunk[0])
    return half


def fat_cage(cage: Cage) -> Array:
    """The cage of a stouter biped: belly and seat grow most, limbs and cheeks a little (#C by 3)."""
    x, y, z = cage.vertices.T
    trunk = np.where(np.abs(x) < 0.30, 1.0, 0.0)
    belly = 0.62 * trunk * np.exp(-(((z - 0.84) / 0.20) ** 2))
    grown = cage.vertices.copy()
    grown[:, 0] += x * belly
    grown[:, 1] += (y - 0.01) * belly * np.where(y < 0.0, 1.25, 0.75)
    grown += _limb_growth(cage.vertices)
    return grown


def short_cage(cage: Cage) -> Array:
    """The cage of a small biped with a big head: other proportions, so that every joint has to move (#C by 3)."""
    knots = np.array([-1.0, 0.10, 0.62, 1.30, 1.37, 2.0])
    shrunk = cage.vertices.copy()
    shrunk[:, 2] = np.interp(cage.vertices[:, 2], knots, [-1.0, 0.10, 0.40, 0.90, 0.965, 1.72])
    head = cage.vertices[:, 2] > 1.33
    shrunk[head, :2] *= 1.16
    trunk = (np.abs(cage.vertices[:, 0]) < 0.30) & ~head & (cage.vertices[:, 2] > 0.55)
    shrunk[trunk, 0] *= 0.94
    arm = np.abs(cage.vertices[:, 0]) > 0.30
    shift = 0.22 * (np.abs(cage.vertices[:, 0]) - 0.20)
    shrunk[arm, 0] -= (np.sign(cage.vertices[:, 0]) * shift)[arm]
    return shrunk


def _limb_growth(vertices: Array) -> Array:
    """Offsets that widen the arms and legs about their axes by a third (#C by 3)."""
    side = np.where(vertices[:, 0] < 0.0, -1.0, 1.0)[:, None] * [1.0, 0.0, 0.0] + [0.0, 1.0, 1.0]
    left = vertices * side
    arm = (left[:, 0] > 0.30) & (left[:, 0] < 0.52) & (left[:, 2] > 0.6)
    leg = (left[:, 2] < 0.50) & (left[:, 2] > 0.25)
    axis = (WRIST - SHOULDER) / np.linalg.norm(WRIST - SHOULDER)
    offset = left - SHOULDER
    growth = 0.34 * arm[:, None] * (offset - (offset @ axis)[:, None] * axis)
    across = (left - [0.112, 0.005, 0.0]) * [1.0, 1.0, 0.0]
    growth += leg[:, None] * across * np.where(across[:, :1] < 0.0, [0.0, 0.28, 0.0], [0.28, 0.28, 0.0])
    return growth * side


class _Half:
    """The half x ≥ 0 of a cage under construction. Trunk rings run front middle, front, back, back middle."""

    def __init__(self) -> None:
        self.vertices: list[Array] = []
        self.faces: list[list[int]] = []
        self.loops: dict[str, list[int]] = {}

    def add(self, points: Array) -> list[int]:
        start = len(self.vertices)
        self.vertices.extend(np.asarray(points, float))
        return list(range(start, start + len(points)))

    def trunk_ring(self, name: str, z: float, x: float, front: float, back: float, bulge: float) -> list[int]:
        self.loops[name] = self.add([(0.0, front - bulge, z), (x, front, z), (x, back, z), (0.0, back + bulge, z)])
        return self.loops[name]

    def join_trunk(self, low: list[int], high: list[int], *, gap: bool) -> None:
        """Quads between two trunk rings; `gap` leaves the side open for the arm."""
        for k in (0, 1, 2):
            if not (gap and k == 1):
                self.faces.append([low[k], low[k + 1], high[k + 1], high[k]])

    def join_loop(self, first: list[int], second: list[int]) -> None:
        """Quads between two closed rings that turn the same way, seen from the second."""
        for k in range(len(first)):
            n = (k + 1) % len(first)
            self.faces.append([first[k], first[n], second[n], second[k]])

    def mirrored(self) -> Cage:
        """The whole cage: middle vertices shared, the others mirrored."""
        points, (sided, other) = np.array(self.vertices), self._twins()
        vertices = np.concatenate([points, points[sided] * [-1.0, 1.0, 1.0]])
        return Cage(vertices, self.faces + [[int(other[v]) for v in reversed(face)] for face in self.faces])

    def mirrored_loops(self) -> dict[str, list[int]]:
        """The loops of the whole cage: the trunk's closed, a limb's on both sides."""
        _, other = self._twins()
        whole = {}
        for name, loop in self.loops.items():
            twin = [int(other[v]) for v in loop]
            if name in _TRUNK:
                whole[name] = [*loop, *sorted(set(twin) - set(loop))]
            else:
                whole[f"{name}.L"], whole[f"{name}.R"] = loop, twin
        return whole

    def _twins(self) -> tuple[Array, Array]:
        """Which vertices are off the middle, and the number of each one's mirror image."""
        sided = np.array(self.vertices)[:, 0] > 0.0
        other = np.arange(len(sided))
        other[sided] = len(sided) + np.arange(sided.sum())
        return sided, other


def _add_arm(half: _Half, low: list[int], high: list[int]) -> None:
    """Arm from the open side of the trunk: elbow (two loops), wrist, knuckles, fingertips."""
    ring = [low[1], low[2], high[2], high[1]]
    upper, lower = ELBOW - SHOULDER, WRIST - ELBOW
    bend = upper / np.linalg.norm(upper) + lower / np.linalg.norm(lower)
    sections = [
        ("elbow", ELBOW - 0.17 * upper, upper, 0.115, 0.122),
        ("forearm", ELBOW + 0.20 * lower, bend, 0.105, 0.108),
        ("wrist", hand_point(-0.012, 0.0), HAND_ALONG, 0.100, 0.094),
    ]
    for name, center, axis, deep, tall in sections:
        ring = _next_loop(half, name, ring, _section(center, axis, deep=(deep, deep), tall=tall))
    ring = _next_loop(half, "knuckles", ring, _hand_section(0.088, front=0.152, rear=0.092, back=0.056, palm=0.078))
    ring = _next_loop(half, "tips", ring, _hand_section(0.224, front=0.092, rear=0.092, back=0.044, palm=0.086))
    half.faces.append(ring)


def _section(center: Array, axis: Array, *, deep: tuple[float, float], tall: float) -> Array:
    """A rectangle across the arm: lower front, lower back, upper back, upper front."""
    along = axis / np.linalg.norm(axis)
    up = np.cross(along, [0.0, 1.0, 0.0])
    up *= np.sign(up[2]) / np.linalg.norm(up)
    front = np.array([0.0, -deep[0], 0.0])
    rear = np.array([0.0, deep[1], 0.0])
    return np.array(
        [center + front - tall * up, center + rear - tall * up, center + rear + tall * up, center + front + tall * up]
    )


def _hand_section(along: float, *, front: float, rear: float, back: float, palm: float) -> Array:
    origin = WRIST + along * HAND_ALONG
    corners = [(front, -palm), (-rear, -palm), (-rear, back), (front, back)]
    return np.array([origin + a * HAND_FRONT + b * HAND_BACK for a, b in corners])


def _next_loop(half: _Half, name: str, ring: list[int], points: Array) -> list[int]:
    half.loops[name] = new = half.add(points)
    half.join_loop(ring, new)
    return new


def _add_leg(half: _Half, hip: list[int]) -> None:
    """Leg below half of the lowest trunk ring: knee (two loops), ankle, and a foot with heel, toe top and toe sole."""
    ring = [hip[0], hip[3], hip[2], hip[1]]
    loops = [
        ("above knee", 0.470, 0.006, 0.225, -0.118, 0.120),
        ("below knee", 0.350, 0.008, 0.226, -0.118, 0.128),
        ("ankle", 0.160, 0.012, 0.230, -0.112, 0.135),
    ]
    for name, z, inner, outer, front, back in loops:
        section = np.array([(inner, front, z), (inner, back, z), (outer, back, z), (outer, front, z)])
        ring = _next_loop(half, name, ring, section)
    inner_front, inner_back, outer_back, outer_front = ring
    heel_in, heel_out, toe_in, toe_out, sole_in, sole_out = half.add(
        [
            (0.014, 0.145, -0.024), (0.236, 0.145, -0.024),
            (0.012, -0.238, 0.105), (0.242, -0.238, 0.105),
            (0.012, -0.244, -0.024), (0.244, -0.244, -0.024),
        ]
    )  # fmt: skip
    half.faces += [
        [inner_back, outer_back, heel_out, heel_in],
        [outer_front, inner_front, toe_in, toe_out],
        [toe_out, toe_in, sole_in, sole_out],
        [sole_out, sole_in, heel_in, heel_out],
        [inner_front, inner_back, heel_in, sole_in],
        [inner_front, sole_in, toe_in],
        [outer_back, outer_front, sole_out, heel_out],
        [outer_front, toe_out, sole_out],
    ]
