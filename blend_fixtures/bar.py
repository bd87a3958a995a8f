"""The bar of [CTL*20] Figure 5: two bones with the joint in the middle, a fine skin, a box cage of rings.

Along x, from −1 to 1.
"""

from __future__ import annotations

import numpy as np

from .parts import Array, Bone, Cage, Character, Skin

ANGLES = (45.0, 90.0, 135.0)
STRETCH = 1.5

_HALF = 0.2
_BEVEL = 0.06
_BLEND = 0.34
_RINGS = (-1.15, -0.72, -0.34, 0.0, 0.34, 0.72, 1.15)


def bar(*, segments: int = 72, across: int = 12) -> Character:
    """The bar with `segments` quads along it and `across` over each side."""
    vertices, faces = _rounded_box(segments, across)
    bones = [
        Bone("lower", (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        Bone("upper", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), "lower", connected=True),
    ]
    cage = box_cage(_RINGS, half=_HALF + 0.08)
    skin = Skin("Bar", vertices, faces, joint_weights(vertices[:, 0]), ("Bar",), np.zeros(len(faces), dtype=int))
    return Character("Bar", [skin], bones, cage, {"Stretch": stretched_cage(cage)})


def joint_weights(x: Array) -> Array:
    """Weights of the two bones by a smooth step around x = 0 (#V by 2)."""
    second = smooth_step(x, _BLEND)
    return np.column_stack([1.0 - second, second])


def smooth_step(x: Array, half: float) -> Array:
    """From 0 at −`half` to 1 at `half`, twice differentiable."""
    t = np.clip(0.5 + 0.5 * x / half, 0.0, 1.0)
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)


def stretched_cage(cage: Cage, factor: float = STRETCH) -> Array:
    """The cage lengthened from its left end: the middle of the bar moves, and the joint has to follow (#C by 3)."""
    left = cage.vertices[:, 0].min()
    vertices = cage.vertices.copy()
    vertices[:, 0] = left + factor * (vertices[:, 0] - left)
    return vertices


def box_cage(rings: tuple[float, ...] | list[float], *, half: float) -> Cage:
    """A box along x: four corners a ring at the given x (metres), `half` its half width."""
    corners = np.array([(-half, -half), (half, -half), (half, half), (-half, half)])
    return Cage(np.array([(x, *corner) for x in rings for corner in corners]), ring_faces(len(rings)))


def ring_faces(count: int) -> list[list[int]]:
    """Quads over `count` rings of four corners along x, both ends closed, outward."""
    faces = [[0, 3, 2, 1]]
    for low in range(0, 4 * (count - 1), 4):
        faces += [[low + i, low + (i + 1) % 4, low + 4 + (i + 1) % 4, low + 4 + i] for i in range(4)]
    last = 4 * (count - 1)
    return [*faces, [last, last + 1, last + 2, last + 3]]


def _rounded_box(segments: int, across: int) -> tuple[Array, Array]:
    """The box's grid surface with rounded edges: vertices (#V by 3), quads (#F by 4), outward."""
    counts = np.array([segments, across, across])
    faces, points = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end in (0, 1):
            i, j = np.meshgrid(np.arange(counts[u]), np.arange(counts[v]), indexing="ij")
            ring = [(0, 0), (1, 0), (1, 1), (0, 1)] if end else [(0, 0), (0, 1), (1, 1), (1, 0)]
            quad = np.zeros((i.size, 4, 3), dtype=int)
            quad[:, :, axis] = end * counts[axis]
            for k, (du, dv) in enumerate(ring):
                quad[:, k, u], quad[:, k, v] = (i + du).ravel(), (j + dv).ravel()
            points.append(quad.reshape(-1, 3))
    lattice, inverse = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    faces = inverse.reshape(-1, 4)
    half = np.array([1.0, _HALF, _HALF])
    raw = (2.0 * lattice / counts - 1.0) * half
    core = np.clip(raw, -(half - _BEVEL), half - _BEVEL)
    offset = raw - core
    length = np.linalg.norm(offset, axis=1, keepdims=True)
    return core + offset * (_BEVEL / np.maximum(length, 1e-12)), faces
