# SPDX-License-Identifier: GPL-3.0-or-later
"""Location, rotation and scale keys that pose a bone at given matrices, in what its parent hands on to it.

Bones inherit everything, as in a scene graph, so that every exporter can write them. A bone without constraints gets
back what the artist keyed, as a refit keeps every bone's turn, scale and offset; another one what its matrix is against
its parent's. Where that is sheared, it is a turn, a scale and another turn (its singular value decomposition), which
two bones can be keyed to, one the other's parent.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector
from numpy.typing import NDArray

from ..adapters import armature

Array = NDArray[np.float64]
Channels = tuple[Vector, Quaternion, Vector]
# The 24 ways to name and direct the axes of a right-handed frame.
FRAMES = [
    frame
    for order in itertools.permutations(np.eye(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
    if np.linalg.det(frame := np.array(order) * np.array(signs)) > 0.0
]


@dataclass(frozen=True)
class Bone:
    """A bone to solve for, all matrices in the armature's space."""

    bone: bpy.types.Bone
    wanted: list[Matrix]  # #F
    parent_posed: list[Matrix] | None  # #F, as solved
    channels: Array  # #F by 10: what the artist keyed
    reach: Array  # #points by 4, in the bone's space: what it moves
    deforms: bool


@dataclass(frozen=True)
class Solved:
    """The keys of one bone, `#F by 10` (location, quaternion, scale), and what they make of it."""

    keys: Array
    posed: list[Matrix]  # #F
    error: float  # largest distance of `reach` from where it should be
    inherits: armature.Inheritance
    connected: bool = False  # whether its location is 0 throughout, as a connected bone's
    helper: Array | None = None  # keys of a bone at its place, which then is its parent


def solve(asked: Bone, tolerance: float) -> Solved:
    """The first way to key the bone that keeps `reach` within `tolerance`, or the best one.

    Sets what the bone inherits from its parent.
    """
    found = []
    for solved in _ways(asked):
        found.append(solved)
        if solved.error <= tolerance:
            break
    best = min(found, key=lambda solved: solved.error)
    armature.set_inheritance(asked.bone, best.inherits)
    return best


def _ways(asked: Bone) -> Iterator[Solved]:
    """The best first. Without a helper, a sheared bone of no weight can do with what it inherited or with nothing."""
    before = armature.inheritance(asked.bone)
    yield from _plain(asked, armature.INHERITS_ALL)
    if asked.deforms:
        armature.set_inheritance(asked.bone, armature.INHERITS_ALL)
        yield _helped(asked)
    yield from _plain(asked, before)
    yield from _plain(asked, armature.INHERITS_PLACE)


def _plain(asked: Bone, inherits: armature.Inheritance) -> Iterator[Solved]:
    for channels in (_keyed, _inverted):
        armature.set_inheritance(asked.bone, inherits)
        found = channels(asked)
        if asked.bone.use_connect:
            yield replace(_try(asked, [(Vector(), turn, size) for _, turn, size in found]), connected=True)
        if not asked.bone.use_connect or channels is _inverted:
            yield _try(asked, found)


def _keyed(asked: Bone) -> list[Channels]:
    return [(Vector(row[:3]), Quaternion(row[3:7]), Vector(row[7:])) for row in asked.channels]


def _inverted(asked: Bone) -> list[Channels]:
    return [matrix.decompose() for matrix in _relative(asked)]


def _relative(asked: Bone) -> list[Matrix]:
    """What is wanted, as channels' matrices: against what the parent hands on."""
    return [_in_parent(asked, k, matrix, invert=True) for k, matrix in enumerate(asked.wanted)]


def _try(asked: Bone, channels: list[Channels]) -> Solved:
    posed = [_in_parent(asked, k, Matrix.LocRotScale(*channel)) for k, channel in enumerate(channels)]
    return Solved(rows(channels), posed, _error(asked, posed), armature.inheritance(asked.bone))


def _helped(asked: Bone) -> Solved:
    """A helper takes the first turn and the scale, the bone turns in it."""
    helper, inner, posed = [], [], []
    before = np.eye(3)
    for k, matrix in enumerate(_relative(asked)):
        left, scale, before = _turn_scale_turn(np.array(matrix.to_3x3()), before)
        helper.append((matrix.translation, Matrix(left).to_quaternion(), Vector(scale)))
        inner.append((Vector(), Matrix(before.T).to_quaternion(), Vector((1.0, 1.0, 1.0))))
        posed.append(_in_parent(asked, k, Matrix.LocRotScale(*helper[-1])) @ Matrix.LocRotScale(*inner[-1]))
    found = Solved(rows(inner), posed, _error(asked, posed), armature.INHERITS_ALL)
    return replace(found, helper=rows(helper))


def _turn_scale_turn(linear: Array, near: Array) -> tuple[Array, Array, Array]:
    """A 3 by 3 matrix as left · diag(scale) · rightᵀ, both turns, `right` in its form that is nearest to `near`."""
    left, scale, right = np.linalg.svd(linear)
    right = right.T
    if np.linalg.det(right) < 0.0:
        left, right = -left, -right
    if np.linalg.det(left) < 0.0:
        left, scale = -left, -scale
    frame = max(FRAMES, key=lambda frame: np.trace(near.T @ right @ frame))
    return left @ frame, np.abs(frame.T) @ scale, right @ frame


def _error(asked: Bone, posed: list[Matrix]) -> float:
    off = (np.array(posed) - np.array(asked.wanted))[:, :3] @ asked.reach.T
    error = float(np.linalg.norm(off, axis=1).max())
    return error if np.isfinite(error) else np.inf


def rows(channels: list[Channels]) -> Array:
    """Keys of them, `#F by 10`: of a turn's two quaternions the one that is nearer to the frame before."""
    keys = np.array([[*place, *turn, *size] for place, turn, size in channels])
    for k in range(1, len(keys)):
        if keys[k, 3:7] @ keys[k - 1, 3:7] < 0.0:
            keys[k, 3:7] *= -1.0
    return keys


def _in_parent(asked: Bone, index: int, matrix: Matrix, *, invert: bool = False) -> Matrix:
    """Channels' matrix to pose matrix, or back, as Blender does it."""
    rest, parent = asked.bone.matrix_local, asked.bone.parent
    if parent is None:
        return asked.bone.convert_local_to_pose(matrix, rest, invert=invert)
    return asked.bone.convert_local_to_pose(
        matrix,
        rest,
        parent_matrix=asked.parent_posed[index],
        parent_matrix_local=parent.matrix_local,
        invert=invert,
    )
