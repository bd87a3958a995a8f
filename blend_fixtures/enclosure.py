"""Checks of a cage: closed, manifold, outward, mirror-symmetric, around every vertex of the skins.

Plain numpy, meant as an independent answer beside the add-on's own checks; cost #P × #F.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .parts import Array, Cage


@dataclass(frozen=True)
class CageReport:
    """What `check_cage` found.

    `clearance`: smallest distance of a skin vertex to the cage, in metres; negative if one is outside.
    """

    closed: bool
    manifold: bool
    outward: bool
    clearance: float
    outside: int

    @property
    def good(self) -> bool:
        return self.closed and self.manifold and self.outward and self.outside == 0


def triangulate(faces: Sequence[Sequence[int]]) -> Array:
    """Fans of all polygons (#T by 3)."""
    return np.array([(face[0], face[k], face[k + 1]) for face in faces for k in range(1, len(face) - 1)], dtype=int)


def check_cage(cage: Cage, points: Array) -> CageReport:
    """Check `cage` against the skin vertices `points` (#P by 3, the cage's space)."""
    triangles = triangulate(cage.faces)
    directed = np.concatenate([triangles, np.roll(triangles, -1, axis=1)]).reshape(2, -1).T
    codes = directed[:, 0] * len(cage.vertices) + directed[:, 1]
    twins = directed[:, 1] * len(cage.vertices) + directed[:, 0]
    once = len(np.unique(codes)) == len(codes)
    closed = once and np.array_equal(np.sort(codes), np.sort(twins))
    winding = winding_numbers(points, cage.vertices, triangles)
    distance = surface_distances(points, cage.vertices, triangles)
    outside = winding < 0.5
    return CageReport(
        closed=bool(closed),
        manifold=bool(closed and _single_fans(triangles, len(cage.vertices))),
        outward=signed_volume(cage.vertices, triangles) > 0.0,
        clearance=float(np.where(outside, -distance, distance).min()),
        outside=int(outside.sum()),
    )


def signed_volume(vertices: Array, triangles: Array) -> float:
    """The enclosed volume, positive if the faces point outward."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def winding_numbers(points: Array, vertices: Array, triangles: Array) -> Array:
    """How often the surface winds around each point: 1 inside, 0 outside (#P).

    Solid angles after van Oosterom and Strackee.
    """
    total = np.zeros(len(points))
    columns = np.ascontiguousarray(points.T)
    for triangle in triangles:
        a, b, c = (vertices[v][:, None] - columns for v in triangle)
        la, lb, lc = (np.sqrt(_dot(x, x)) for x in (a, b, c))
        above = _dot(a, np.cross(b, c, axis=0))
        below = la * lb * lc + lc * _dot(a, b) + lb * _dot(a, c) + la * _dot(b, c)
        total += np.arctan2(above, below)
    return total / (2.0 * np.pi)


def surface_distances(points: Array, vertices: Array, triangles: Array) -> Array:
    """Distance of each point to the nearest triangle (#P)."""
    return nearest_on_surface(points, vertices, triangles)[0]


def nearest_on_surface(points: Array, vertices: Array, triangles: Array) -> tuple[Array, Array, Array]:
    """Nearest points of a triangle surface: distance (#P), triangle (#P) and its barycentric coordinates (#P by 3)."""
    columns = np.ascontiguousarray(points.T)
    best = np.full(len(points), np.inf)
    face = np.zeros(len(points), dtype=int)
    weights = np.zeros((3, len(points)))
    for index, triangle in enumerate(triangles):
        squared, barycentric = _closest_barycentric(columns, vertices[triangle])
        nearer = squared < best
        best[nearer], face[nearer] = squared[nearer], index
        weights[:, nearer] = barycentric[:, nearer]
    return np.sqrt(best), face, weights.T


def _closest_barycentric(points: Array, corners: Array) -> tuple[Array, Array]:
    """Squared distances (#P) of `points` (3 by #P) to one triangle, and the closest points' barycentric
    coordinates (3 by #P).
    """
    a, b, c = corners
    ab, ac = b - a, c - a
    offset = points - a[:, None]
    d1, d2 = ab @ offset, ac @ offset
    aa, bb, cc = ab @ ab, ab @ ac, ac @ ac
    scale = max(aa * cc - bb * bb, 1e-30)
    v, w = (cc * d1 - bb * d2) / scale, (aa * d2 - bb * d1) / scale
    best = np.stack([1.0 - v - w, v, w])
    squared = _dot(offset, offset) - v * d1 - w * d2
    squared = np.where((best >= 0.0).all(axis=0), np.maximum(squared, 0.0), np.inf)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        edge = corners[second] - corners[first]
        offset = points - corners[first][:, None]
        t = np.clip(edge @ offset / max(edge @ edge, 1e-30), 0.0, 1.0)
        gap = offset - edge[:, None] * t
        distance = _dot(gap, gap)
        nearer = distance < squared
        on_edge = np.zeros_like(best)
        on_edge[first], on_edge[second] = 1.0 - t, t
        best, squared = np.where(nearer, on_edge, best), np.where(nearer, distance, squared)
    return squared, best


def is_mirror_symmetric(vertices: Array, tolerance: float = 1e-9) -> bool:
    """Whether the set of `vertices` is its own mirror image in x."""
    mirror = vertices * [-1.0, 1.0, 1.0]
    squared = ((vertices[:, None] - mirror[None]) ** 2).sum(axis=2)
    return bool(squared.min(axis=1).max() <= tolerance**2)


def _single_fans(triangles: Array, count: int) -> bool:
    """Whether the triangles around each vertex form one fan (no two surfaces touch in a vertex only)."""
    following = {}
    for triangle in triangles.tolist():
        for k in range(3):
            following[triangle[k], triangle[(k + 1) % 3]] = triangle[(k + 2) % 3]
    degree = np.bincount(triangles.ravel(), minlength=count)
    first = {edge[0]: edge[1] for edge in following}
    for vertex, start in first.items():
        steps, at = 0, start
        while steps == 0 or at != start:
            at, steps = following[vertex, at], steps + 1
        if steps != degree[vertex]:
            return False
    return True


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ip,ip->p", a, b)
