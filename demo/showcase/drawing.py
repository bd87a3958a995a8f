"""Meshes that draw lines: a cage as tubes with knots, bones as octahedra. Vectorised; all return vertices and faces."""

from __future__ import annotations

import numpy as np

Array = np.ndarray

_SIDES = 8


def tubes(vertices: Array, faces: list[list[int]], *, radius: float) -> tuple[Array, Array]:
    """One tube along each edge of a polygon mesh → vertices (#V by 3), quads (#F by 4)."""
    pairs = np.array([(a, b) for face in faces for a, b in zip(face, face[1:] + face[:1], strict=True)])
    edges = np.unique(np.sort(pairs, axis=1), axis=0)
    start, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
    across, up = _frames(end - start)
    turn = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    offsets = radius * (np.cos(turn)[None, :, None] * across[:, None] + np.sin(turn)[None, :, None] * up[:, None])
    rings = np.stack([start[:, None] + offsets, end[:, None] + offsets], axis=1)
    side = np.arange(_SIDES)
    quad = np.stack([side, (side + 1) % _SIDES, (side + 1) % _SIDES + _SIDES, side + _SIDES], axis=1)
    quads = quad[None] + 2 * _SIDES * np.arange(len(edges))[:, None, None]
    return rings.reshape(-1, 3), quads.reshape(-1, 4)


def knots(points: Array, *, radius: float) -> tuple[Array, Array]:
    """A small ball at each point → vertices (#V by 3), quads (#F by 4)."""
    rings, sides = 6, 10
    polar = np.pi * np.arange(rings + 1) / rings
    turn = 2.0 * np.pi * np.arange(sides) / sides
    ball = np.stack(
        [
            np.outer(np.sin(polar), np.cos(turn)),
            np.outer(np.sin(polar), np.sin(turn)),
            np.outer(np.cos(polar), turn**0),
        ],
        axis=2,
    ).reshape(-1, 3)
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij"))
    k = (j + 1) % sides
    quad = np.stack([i * sides + j, (i + 1) * sides + j, (i + 1) * sides + k, i * sides + k], axis=1)
    quads = quad[None] + len(ball) * np.arange(len(points))[:, None, None]
    return (points[:, None] + radius * ball[None]).reshape(-1, 3), quads.reshape(-1, 4)


def octahedra(bones: Array, *, width: float = 0.11, limit: float = np.inf) -> tuple[Array, Array]:
    """Bones (#J by 2 by 3) as Blender draws them, `width` of their length but at most `limit` thick → triangles."""
    head, tail = bones[:, 0], bones[:, 1]
    across, up = _frames(tail - head)
    length = np.linalg.norm(tail - head, axis=1, keepdims=True)
    reach = np.minimum(width * length, limit)
    waist = head + 0.14 * (tail - head)
    corners = np.stack([waist + reach * across, waist + reach * up, waist - reach * across, waist - reach * up], axis=1)
    points = np.concatenate([head[:, None], corners, tail[:, None]], axis=1)
    shell = np.array([[0, k % 4 + 1, k] for k in (1, 2, 3, 4)] + [[5, k, k % 4 + 1] for k in (1, 2, 3, 4)])
    triangles = shell[None] + 6 * np.arange(len(bones))[:, None, None]
    return points.reshape(-1, 3), triangles.reshape(-1, 3)


def _frames(axes: Array) -> tuple[Array, Array]:
    """Two unit directions across each axis (#A by 3)."""
    unit = axes / np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-12)
    helper = np.where(np.abs(unit[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    across = np.cross(unit, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(unit, across)
