"""Smooth skin weights from bones: inverse distances to bone segments, diffused along the surface, at most four a
vertex.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .parts import Array, Bone, Part
from .surface_nets import neighbour_mean, neighbour_table

INFLUENCES = 4


def part_weights(
    part: Part, bones: Sequence[Bone], *, girth: Mapping[str, float] | None = None, power: float = 6.0, rounds: int = 8
) -> Array:
    """Weights of one part over all `bones` (#V by #J, rows sum to 1); only `part.bones` get any.

    `girth`: how much thicker than others the limb around a bone is; its bone reaches as much farther.
    """
    names = [bone.name for bone in bones]
    columns = [names.index(name) for name in part.bones]
    weights = np.zeros((len(part.vertices), len(bones)))
    distances = np.stack([segment_distance(part.vertices, bones[j].head, bones[j].tail) for j in columns], axis=1)
    distances /= [(girth or {}).get(name, 1.0) for name in part.bones]
    nearest = distances.min(axis=1, keepdims=True)
    local = ((nearest + 1e-4) / (distances + 1e-4)) ** power
    local /= local.sum(axis=1, keepdims=True)
    table = neighbour_table(part.faces, len(part.vertices))
    for _ in range(rounds if len(columns) > 1 else 0):
        local = 0.5 * (local + neighbour_mean(local, table))
    weights[:, columns] = local
    return limit_influences(weights)


def limit_influences(weights: Array, count: int = INFLUENCES) -> Array:
    """Keep the `count` largest weights of each row, fading out instead of cutting, and normalise (#V by #J)."""
    if weights.shape[1] > count:
        rest = np.partition(weights, -count - 1, axis=1)[:, -count - 1 : -count]
        weights = np.maximum(weights - np.maximum(rest, 1e-3), 0.0)
    return weights / weights.sum(axis=1, keepdims=True)


def segment_distance(points: Array, a: Sequence[float], b: Sequence[float]) -> Array:
    """Distances of `points` (#P by 3) to the segment a–b (#P)."""
    start, axis = np.asarray(a, float), np.asarray(b, float) - np.asarray(a, float)
    t = np.clip((points - start) @ axis / (axis @ axis), 0.0, 1.0)
    return np.linalg.norm(points - start - t[:, None] * axis, axis=1)


def weight_fault(weights: Array) -> str:
    """What is wrong with `weights` (#V by #J), or "": rows must be non-negative, sum to 1 and have few entries."""
    sums = np.abs(weights.sum(axis=1) - 1.0)
    if not np.isfinite(weights).all() or weights.min() < 0.0 or sums.max() > 1e-9:
        return f"row {int(sums.argmax())} sums to {weights[sums.argmax()].sum():.6f}"
    most = int((weights > 0.0).sum(axis=1).max())
    return "" if most <= INFLUENCES else f"a row has {most} influences"
