# SPDX-License-Identifier: GPL-3.0-or-later
"""Joints as bones: where they end, and what keys play a skeleton animation as [CTL*20]'s prototype does."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from .prototype import Skeleton, SkeletonMotion
from .text import Doubles, Ints

SHORTER = 0.6  # length of a bone that goes on in the direction of another one, for each unit of that one's
SAME_PLACE = 1e-3  # joints nearer than this share of the skeleton's size are at the same place


def tails(skeleton: Skeleton, up: Doubles) -> Doubles:
    """Where the bones end, `#J by 3`.

    At the child's joint; between several, or at the one that most joints descend from where between them is too near. A
    bone whose child is at its own place lies along that one, and a last bone goes on as its parent does, both shorter.
    Where nothing says it, upward.
    """
    joints, parents = skeleton.joints, skeleton.parents
    near = SAME_PLACE * float(np.linalg.norm(np.ptp(joints, axis=0)))
    steps = np.where((parents >= 0)[:, None], joints - joints[parents], 0.0)
    lengths = np.linalg.norm(steps, axis=1)
    upward = up * (float(lengths[lengths > near].mean()) if (lengths > near).any() else max(near, 1.0))
    below = _descendants(parents)
    along = np.zeros_like(joints)
    for j in np.argsort(below, kind="stable"):  # children before parents
        children = np.flatnonzero(parents == j)
        apart = children[lengths[children] > near]
        if len(apart):
            along[j] = _between(steps[apart], below[apart])
        elif len(children):
            along[j] = SHORTER * along[children[below[children].argmax()]]
        else:
            along[j] = SHORTER * _onward(int(j), steps, parents, near)
        if np.linalg.norm(along[j]) <= 1e-3 * near:
            along[j] = upward
    return joints + along


def _between(steps: Doubles, below: Ints) -> Doubles:
    """The mean of the steps to children, or the step to the one with most joints below it where the mean is short."""
    mean = steps.mean(axis=0)
    short = np.linalg.norm(mean) < 0.5 * np.linalg.norm(steps, axis=1).mean()
    return steps[below.argmax()] if short else mean


def _onward(j: int, steps: Doubles, parents: Ints, near: float) -> Doubles:
    """The last step that leads to joint j from elsewhere; nothing where there is none."""
    while j >= 0:
        if np.linalg.norm(steps[j]) > near:
            return steps[j]
        j = int(parents[j])
    return np.zeros(3)


def _descendants(parents: Ints) -> Ints:
    """How many joints each joint has below it."""
    below, above = np.zeros(len(parents), np.int64), parents
    while (above >= 0).any():
        np.add.at(below, above[above >= 0], 1)
        above = np.where(above >= 0, parents[above], -1)
    return below


@dataclass(frozen=True)
class BoneKeys:
    """Keys of one bone: quaternions (w x y z) and places against rest in its own axes, each at its own times."""

    rotation_times: Doubles  # seconds
    rotations: Doubles  # #times by 4
    location_times: Doubles
    locations: Doubles  # #times by 3


def keys(
    skeleton: Skeleton, motion: SkeletonMotion, rest: Doubles, *, rate: float | None, keep_steps: bool
) -> list[BoneKeys]:
    """Keys of every bone whose rest orientation is `rest` (`#J by 3 by 3`).

    The prototype takes the rotations, the roots' places, and keeps every other joint where it is on its father at rest;
    `keep_steps` takes those joints' places from the animation too. Between two keys it turns each bone evenly about one
    axis, as Blender's curves do not: `rate` is how many keys a second are put there for that (None: none).
    """
    turns, parents = rotations(motion.angles), skeleton.parents
    fathers = np.where((parents >= 0)[:, None, None], turns[:, parents], np.eye(3))
    steps = motion.places - skeleton.joints
    above = steps[:, parents] + np.einsum("kjab,jb->kja", fathers, skeleton.joints - skeleton.joints[parents])
    places = motion.places - np.where(parents[:, None] >= 0, skeleton.joints[parents] + above, skeleton.joints)
    if not keep_steps:
        places[:, parents >= 0] = 0.0
    own = rest.transpose(0, 2, 1) @ fathers.transpose(0, 1, 3, 2)  # from rig space into the axes of the bone
    quaternions = _steady(_quaternions(own @ turns @ rest))
    locations = np.einsum("kjab,kjb->kja", own, places)
    between = _times_between(motion.times, rate)
    return [
        BoneKeys(
            *_unless_still(between, _slerp(motion.times, quaternions[:, j], between)),
            *_unless_still(motion.times, locations[:, j]),
        )
        for j in range(len(parents))
    ]


def rotations(degrees: Doubles) -> Doubles:
    """Rz Ry Rx of Euler angles (`… by 3`), `… by 3 by 3`."""
    (cx, cy, cz), (sx, sy, sz) = (np.moveaxis(f(np.radians(degrees)), -1, 0) for f in (np.cos, np.sin))
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _quaternions(matrices: Doubles) -> Doubles:
    """w x y z of rotations (`… by 3 by 3`): by the largest of the four, which is never near 0."""
    m = matrices
    diagonal = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]], axis=-1)
    trace = diagonal.sum(axis=-1, keepdims=True)
    squares = np.concatenate([1.0 + trace, 1.0 - trace + 2.0 * diagonal], axis=-1)  # 4 w², 4 x², 4 y², 4 z²
    products = np.empty((*m.shape[:-2], 4, 4))  # 4 q qᵀ
    for k in range(4):
        products[..., k, k] = squares[..., k]
    for k, (a, b) in enumerate(((2, 1), (0, 2), (1, 0)), start=1):
        products[..., 0, k] = products[..., k, 0] = m[..., a, b] - m[..., b, a]
    for a, b in itertools.combinations(range(3), 2):
        products[..., a + 1, b + 1] = products[..., b + 1, a + 1] = m[..., a, b] + m[..., b, a]
    largest = squares.argmax(axis=-1)[..., None, None]
    row = np.take_along_axis(products, np.broadcast_to(largest, (*m.shape[:-2], 1, 4)), axis=-2)[..., 0, :]
    return row / np.linalg.norm(row, axis=-1, keepdims=True)


def _steady(quaternions: Doubles) -> Doubles:
    """Signs so that each key (first axis) is the nearer one of the two to the key before."""
    found = quaternions.copy()
    for k in range(1, len(found)):
        found[k] *= np.where((found[k] * found[k - 1]).sum(axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    return found


def _times_between(times: Doubles, rate: float | None) -> Doubles:
    """The times with those of a rate between them."""
    if rate is None:
        return times
    grid = np.arange(np.ceil(times[0] * rate), np.floor(times[-1] * rate) + 1) / rate
    apart = np.abs(grid[:, None] - times).min(axis=1) > 1e-3 / rate
    return np.sort(np.concatenate([times, grid[apart]]))


def _slerp(times: Doubles, values: Doubles, at: Doubles) -> Doubles:
    """Unit quaternions `values` (`#times by 4`) at other times within theirs, along the shortest arcs."""
    if len(times) == 1:
        return values
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = ((at - times[k]) / (times[k + 1] - times[k]))[:, None]
    first, second = values[k], values[k + 1]
    angle = np.arccos(np.clip((first * second).sum(axis=1, keepdims=True), -1.0, 1.0))
    near = angle < 1e-6
    sine = np.where(near, 1.0, np.sin(angle))
    weights = [np.where(near, s, np.sin(s * angle) / sine) for s in (1.0 - share, share)]
    found = weights[0] * first + weights[1] * second
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def _unless_still(times: Doubles, values: Doubles) -> tuple[Doubles, Doubles]:
    """One key for a value that does not change."""
    still = float(np.ptp(values, axis=0).max()) < 1e-9
    return (times[:1], values[:1]) if still else (times, values)
