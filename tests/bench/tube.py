"""A character of any size: a bumpy tube along x, bones in a row, a cage of six corners a ring with a point at each end.

What costs time depends on how many vertices, bones and cage vertices there are, not on what they look like.
"""

from __future__ import annotations

import numpy as np

from blend_fixtures.parts import Array, Bone, Cage, Character, Skin

INFLUENCES = 4
LENGTH = 10.0
_SIDES = 6


def tube(vertices: int, bones: int, cage_vertices: int) -> Character:
    """A closed tube of about so many vertices, and a cage of exactly so many where that is 6 n + 2."""
    around = max(6, 2 * round(np.sqrt(vertices) / 4))
    rings = round((vertices - 2) / around)
    along = np.linspace(0.02, LENGTH - 0.02, rings)
    radius = 0.8 + 0.12 * np.sin(2.3 * along)
    points = _around(along, radius, around, LENGTH)
    names = [f"bone.{j}" for j in range(bones)]
    heads = [(LENGTH * j / bones, 0.0, 0.0) for j in range(bones + 1)]
    chain = [Bone(names[j], heads[j], heads[j + 1], names[j - 1] if j else None, bool(j)) for j in range(bones)]
    rest = Skin("Tube", points, _triangles(rings, around), chain_weights(points[:, 0], bones))
    cage_rings = (cage_vertices - 2) // _SIDES
    corners = _around(np.linspace(-0.4, LENGTH + 0.4, cage_rings), np.full(cage_rings, 1.4), _SIDES, LENGTH, 0.9)
    cage = Cage(corners, _triangles(cage_rings, _SIDES).tolist())
    return Character("Tube", [rest], chain, cage)


def chain_weights(x: Array, bones: int) -> Array:
    """Weights of a chain of bones along x (#V by #J), four of them at most."""
    place = x / LENGTH * bones - 0.5
    far = np.abs(place[:, None] - np.arange(bones))
    weights = np.where(far < INFLUENCES / 2, np.exp(-1.2 * far**2), 0.0)
    return weights / weights.sum(1, keepdims=True)


def _around(along: Array, radius: Array, around: int, length: float, overhang: float = 0.1) -> Array:
    """Rings around the x axis, and the points of both ends after them."""
    turn = 2 * np.pi * np.arange(around) / around
    x, turn = np.meshgrid(along, turn, indexing="ij")
    wide = radius[:, None] * (1 + 0.05 * np.cos(3 * turn))
    rings = np.stack([x, wide * np.cos(turn), wide * np.sin(turn)], axis=-1).reshape(-1, 3)
    return np.concatenate([rings, [[-overhang, 0, 0], [length + overhang, 0, 0]]])


def _triangles(rings: int, around: int) -> Array:
    """Faces of such rings, outward."""
    ring, k = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = (ring * around + k).ravel(), (ring * around + (k + 1) % around).ravel()
    sides = np.concatenate([np.stack([a, b, b + around], -1), np.stack([a, b + around, a + around], -1)])
    k = np.arange(around)
    start, end, last = rings * around, rings * around + 1, (rings - 1) * around
    caps = [np.stack([np.full(around, start), (k + 1) % around, k], -1)]
    caps += [np.stack([np.full(around, end), last + k, last + (k + 1) % around], -1)]
    return np.concatenate([sides, *caps])
