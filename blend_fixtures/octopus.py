"""The octopus: a round head on eight straight arms, eyes that turn with it, and a cage of quads; symmetric in x."""

from __future__ import annotations

import numpy as np

from .fields import chain, ellipsoid, mirrored, union
from .parts import Array, Bone, Cage, Character, Part, join_parts
from .skin_weights import part_weights
from .surface_nets import mesh_field, symmetrise

ARMS = 8
LINKS = 5
# Along an arm: distance from the axis, height and radius, at the joints and the tip.
_REACH = np.array([0.26, 0.55, 0.82, 1.07, 1.29, 1.48])
_HEIGHT = np.array([0.30, 0.22, 0.16, 0.125, 0.10, 0.085])
_RADIUS = np.array([0.17, 0.125, 0.10, 0.08, 0.065, 0.05])
# The cage's sections of an arm: at which joint, and how much wider than the arm.
_SECTIONS = (1.0, 2.0, 3.0, 4.0, 5.45)
_MARGIN = 1.5
# Rings of the cage around the head: radius and height.
_RINGS = ((0.44, 0.06), (0.50, 0.52), (0.60, 0.90), (0.36, 1.30))


def angles() -> Array:
    """Direction of each arm about the axis, in radians; the first is in front, beside −Y."""
    return -np.pi / 2.0 + (np.arange(ARMS) + 0.5) * 2.0 * np.pi / ARMS


def arm_bone(arm: int, link: int) -> str:
    """The name of a bone of an arm, both from 0."""
    return f"arm.{arm + 1}.{link + 1:02d}"


def octopus() -> Character:
    """The whole character, about 12,000 vertices, 1.2 tall, 3 across, facing −Y, arms on the floor."""
    bones = _bones()
    parts = [_body(), *_eyes()]
    cage = _cage()
    skin = join_parts("Octopus", parts, [part_weights(part, bones, girth=_GIRTH) for part in parts])
    return Character("Octopus", [skin], bones, cage, {"Puffed": _puffed(cage), "Long": _long(cage)})


_GIRTH = {"body": 2.0, "head": 3.0}


def _bones() -> list[Bone]:
    found = [
        Bone("body", (0.0, 0.0, 0.25), (0.0, 0.0, 0.55)),
        Bone("head", (0.0, 0.0, 0.55), (0.0, 0.0, 1.15), "body", True),
    ]
    for arm in range(ARMS):
        joints = _arm_points(arm)
        for link in range(LINKS):
            head, tail = (tuple(map(float, point)) for point in joints[link : link + 2])
            found.append(Bone(arm_bone(arm, link), head, tail, arm_bone(arm, link - 1) if link else "body", link > 0))
    return found


def _arm_points(arm: int) -> Array:
    """Joints and tip of an arm, `LINKS + 1` by 3."""
    angle = angles()[arm]
    return np.column_stack([_REACH * np.cos(angle), _REACH * np.sin(angle), _HEIGHT])


def _body() -> Part:
    head = ellipsoid((0.0, 0.03, 0.82), (0.46, 0.44, 0.40))
    trunk = ellipsoid((0.0, 0.0, 0.40), (0.34, 0.34, 0.30))
    right = [arm for arm in range(ARMS) if np.cos(angles()[arm]) > 0.0]
    arms = union([chain(_arm_points(arm), _RADIUS, 0.02) for arm in right], 0.10)
    field = mirrored(union([union([head, trunk], 0.20), arms], 0.16))
    vertices, faces = mesh_field(field, np.array([-1.6, -1.6, -0.05]), np.array([1.6, 1.6, 1.3]), cell=0.032)
    names = ["body", "head", *(arm_bone(arm, link) for arm in range(ARMS) for link in range(LINKS))]
    return Part("body", symmetrise(vertices), faces, "Octopus", tuple(names))


def _eyes() -> list[Part]:
    found = []
    for name, material, radius, out in (("eye", "White", 0.105, 0.0), ("pupil", "Ink", 0.055, 0.068)):
        for side in (-1.0, 1.0):
            center = np.array([side * 0.19, -0.37, 0.88])
            ahead = np.array([side * 0.16, -1.0, 0.12]) / np.linalg.norm([0.16, 1.0, 0.12])
            box = np.full(3, radius * 1.4)
            at = center + out * ahead
            vertices, faces = mesh_field(ellipsoid((0.0, 0.0, 0.0), (radius,) * 3), -box, box, cell=radius / 5.0)
            found.append(Part(f"{name}{side:+.0f}", vertices + at, faces, material, ("head",)))
    return found


def _cage() -> Cage:
    """Rings of eight around the head; a tube of quads from each side of the lowest for an arm."""
    corners = np.append(angles() - np.pi / ARMS, angles()[-1] + np.pi / ARMS)[:ARMS]
    rings = [[[r * np.cos(a), r * np.sin(a), z] for a in corners] for r, z in _RINGS]
    vertices = [point for ring in rings for point in ring]
    faces: list[list[int]] = []
    for ring in range(len(_RINGS) - 1):
        for k in range(ARMS):
            side = [ring * ARMS + k, ring * ARMS + (k + 1) % ARMS]
            quad = [*side, side[1] + ARMS, side[0] + ARMS]
            if ring:
                faces.append(quad)
            else:
                _grow_arm(k, quad, vertices, faces)
    for ring, z in ((0, -0.06), (len(_RINGS) - 1, 1.34)):
        center, first = len(vertices), ring * ARMS
        vertices.append([0.0, 0.0, z])
        for k in range(ARMS):
            pair = [first + k, first + (k + 1) % ARMS]
            faces.append([*(pair if ring else pair[::-1]), center])
    return Cage(np.array(vertices), faces)


def _grow_arm(arm: int, quad: list[int], vertices: list[list[float]], faces: list[list[int]]) -> None:
    """A tube from `quad` (low left, low right, high right, high left, seen from outside) to the arm's tip."""
    angle = angles()[arm]
    along, across = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
    for place in _SECTIONS:
        reach, height, radius = (np.interp(place, range(LINKS + 1), values) for values in (_REACH, _HEIGHT, _RADIUS))
        reach += max(place - LINKS, 0.0) * 0.2
        center, size = reach * along + [0.0, 0.0, height], _MARGIN * radius
        now = range(len(vertices), len(vertices) + 4)
        for sideways, up in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)):
            vertices.append((center + size * (sideways * across + [0.0, 0.0, up])).tolist())
        faces += [[quad[i], quad[(i + 1) % 4], now[(i + 1) % 4], now[i]] for i in range(4)]
        quad = list(now)
    faces.append(quad)


def _puffed(cage: Cage) -> Array:
    """The head blown up, its upper rings wide."""
    grown = cage.vertices.copy()
    ring = (np.arange(len(grown)) >= ARMS) & (np.arange(len(grown)) < len(_RINGS) * ARMS)
    grown[ring] *= [1.35, 1.35, 1.15]
    grown[-1, 2] *= 1.15
    return grown


def _long(cage: Cage) -> Array:
    """Arms stretched, thinner at their ends."""
    grown = cage.vertices.copy()
    distance = np.linalg.norm(grown[:, :2], axis=1)
    outer = distance > _REACH[1] - 0.05
    factor = 1.0 + 0.28 * (distance[outer] - _REACH[1]) / distance[outer]
    grown[outer, :2] *= factor[:, None]
    return grown
