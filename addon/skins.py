# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a running rig: what moves their rest shape in Blender, and writing their posed points."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from . import health
from .adapters import modifier, positions, shape_keys
from .session import Session, SessionError

Points = NDArray[np.float32]
Matrix = NDArray[np.float64]
Written = dict[int, tuple[int, bytes]]  # skin index -> (session revision, its matrix) of the last write


def to_rig(cage: bpy.types.Object, index: int, depsgraph: bpy.types.Depsgraph) -> tuple[Matrix, bool]:
    """Matrix from skin `index` to the armature's space now, and whether it is still that of the bind."""
    skin = cage.cage_rig.skins[index]
    bones = cage.cage_rig.armature.evaluated_get(depsgraph).matrix_world
    world = skin.object.evaluated_get(depsgraph).matrix_world
    bound, now = np.array(skin.skin_to_rig, np.float64), np.array(bones.inverted_safe() @ world, np.float64)
    far = 1.0 + max(float(np.abs(np.array(world)).max()), float(np.abs(np.array(bones)).max()))
    still = bool(np.allclose(now, bound, rtol=0.0, atol=2e-6 * far))
    return (bound, True) if still else (now, False)


def offsets(
    cage: bpy.types.Object, session: Session, depsgraph: bpy.types.Depsgraph, *, readable: bool
) -> tuple[list[Points | None], bool]:
    """Rest-pose offsets of every skin: by its shape keys, by modifiers before ours, and by its object's moves.

    Returns them with whether they are complete: what a modifier before ours does can be read from the next evaluation
    on after our modifier was told to keep it (and not where it was hidden until now: `readable` False).
    """
    found: list[Points | None] = [None] * len(cage.cage_rig.skins)
    complete = True
    for index, obj in health.live_skins(cage):
        if obj.data.is_editmode:
            continue
        rest = session.snapshot.skins[index].points
        matrix, still = to_rig(cage, index, depsgraph)
        deformed = modifier.deformed_before(obj)
        kept = modifier.keep_input(obj, deformed)
        complete &= kept
        if deformed and kept and readable and modifier.find(obj).show_viewport:
            found[index] = positions.apply_matrix(matrix, _given(obj, depsgraph)) - rest
        else:
            bound = np.array(cage.cage_rig.skins[index].skin_to_rig, np.float64)
            found[index] = _without_modifiers(obj, depsgraph, rest, matrix, None if still else bound)
    return found, complete


def _given(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Points:
    """The skin as modifiers before ours deform it, in its own space."""
    given = modifier.read_input(obj, depsgraph)
    if given is None:
        raise SessionError(
            f"modifiers after Cage Rig on '{obj.name}' reorder its vertices, so that what the ones before it do can't "
            "be read; switch one or the other off"
        )
    return given


def _without_modifiers(
    obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph, rest: Points, matrix: Matrix, bound: Matrix | None
) -> Points | None:
    """Offset by shape keys, and by the object's move from `bound` to `matrix` (None: it has not moved)."""
    offset: Points | None = None
    if bound is not None:
        offset = positions.apply_matrix(matrix @ np.linalg.inv(bound), rest) - rest
    keys = obj.data.shape_keys
    if keys is not None:
        local = shape_keys.offsets(obj, keys.evaluated_get(depsgraph), len(rest))
        if local is not None:
            shift = local @ matrix[:3, :3].T.astype(np.float32)
            offset = shift if offset is None else offset + shift
    return offset


def write(cage: bpy.types.Object, session: Session, depsgraph: bpy.types.Depsgraph, written: Written) -> None:
    """Feed posed points to the skins whose result changed since `written`. A skin in Edit Mode waits."""
    for index, obj in health.live_skins(cage):
        if obj.data.is_editmode:
            written.pop(index, None)
            continue
        matrix, _ = to_rig(cage, index, depsgraph)
        state = (session.revision, matrix.tobytes())
        if written.get(index) == state and modifier.ATTRIBUTE in obj.data.attributes:
            continue
        points = session.posed_skin(index)
        if not np.array_equal(matrix, np.eye(4)):
            points = positions.apply_matrix(np.linalg.inv(matrix), points)
        modifier.write(obj, points)
        written[index] = state
