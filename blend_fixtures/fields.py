"""Distance fields to model with: a field maps points (#P by 3) to distances (#P), negative inside.

Distances are exact for round cones and close to exact near the surface for the others; surface nets need no more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

Array = np.ndarray
Field = Callable[[Array], Array]


def ellipsoid(center: Sequence[float], radii: Sequence[float]) -> Field:
    """An axis-aligned ellipsoid (first-order distance)."""
    c, r = np.asarray(center, float), np.asarray(radii, float)

    def distance(p: Array) -> Array:
        scaled = (p - c) / r
        k0 = np.linalg.norm(scaled, axis=1)
        k1 = np.linalg.norm(scaled / r, axis=1)
        return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)

    return distance


def cone(a: Sequence[float], b: Sequence[float], ra: float, rb: float | None = None) -> Field:
    """A capsule from `a` to `b` whose radius goes from `ra` to `rb`."""
    start, axis = np.asarray(a, float), np.asarray(b, float) - np.asarray(a, float)
    end_radius = ra if rb is None else rb
    length_squared = max(float(axis @ axis), 1e-12)

    def distance(p: Array) -> Array:
        t = np.clip((p - start) @ axis / length_squared, 0.0, 1.0)
        return np.linalg.norm(p - start - t[:, None] * axis, axis=1) - (ra + t * (end_radius - ra))

    return distance


def chain(points: Sequence[Sequence[float]], radii: Sequence[float], blend: float = 0.0) -> Field:
    """Capsules through `points`, one radius a point."""
    links = [cone(a, b, ra, rb) for a, b, ra, rb in zip(points, points[1:], radii, radii[1:], strict=False)]
    return union(links, blend)


def ring(
    center: Sequence[float], axes: Array, *, radii: tuple[float, float], thickness: float, height: float = 1.0
) -> Field:
    """An elliptic ring.

    `axes`: 3 by 3, rows are its two directions and its normal; `height` stretches the tube along the normal.
    """
    c, frame = np.asarray(center, float), np.asarray(axes, float)
    mean = 0.5 * (radii[0] + radii[1])

    def distance(p: Array) -> Array:
        q = (p - c) @ frame.T
        across = np.hypot(q[:, 0] / radii[0], q[:, 1] / radii[1]) * mean - mean
        return np.hypot(across, q[:, 2] / height) - thickness

    return distance


def slab(
    a: Sequence[float], b: Sequence[float], *, radii: tuple[float, float], low: float, high: float, bevel: float
) -> Field:
    """A stadium-shaped plate between the heights `low` and `high`, with rounded edges (a shoe's sole)."""
    outline = cone([a[0], a[1], 0.0], [b[0], b[1], 0.0], radii[0], radii[1])

    def distance(p: Array) -> Array:
        flat = p * [1.0, 1.0, 0.0]
        d = np.stack([outline(flat) + bevel, np.abs(p[:, 2] - 0.5 * (low + high)) - 0.5 * (high - low) + bevel])
        return np.minimum(d.max(axis=0), 0.0) + np.linalg.norm(np.maximum(d, 0.0), axis=0) - bevel

    return distance


def halfspace(point: Sequence[float], normal: Sequence[float]) -> Field:
    """Everything behind the plane through `point`."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    return lambda p: (p - np.asarray(point, float)) @ n


def union(fields: Sequence[Field], blend: float = 0.0) -> Field:
    """The union, with joints rounded over the length `blend`."""

    def distance(p: Array) -> Array:
        total = fields[0](p)
        for field in fields[1:]:
            total = _smooth_minimum(total, field(p), blend)
        return total

    return distance


def intersection(fields: Sequence[Field], blend: float = 0.0) -> Field:
    """The intersection, with edges rounded over the length `blend`."""
    opposite = union([(lambda p, f=field: -f(p)) for field in fields], blend)
    return lambda p: -opposite(p)


def mirrored(field: Field) -> Field:
    """The half x ≥ 0 of `field` and its mirror image."""
    return lambda p: field(np.column_stack([np.abs(p[:, 0]), p[:, 1:]]))


def _smooth_minimum(a: Array, b: Array, k: float) -> Array:
    if k <= 0.0:
        return np.minimum(a, b)
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * k * 0.25
