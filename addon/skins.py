# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a running rig: what moves their rest shape in Blender, and writing their posed points."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from . import health
from .adapters import modifier, positions, shape_keys, stack, vertex_groups
from .session import Mask, Session, SessionError

Points = NDArray[np.float32]
Matrix = NDArray[np.float64]
Written = dict[int, tuple[int, bytes]]  # skin index -> (session revision, its matrix) of the last write


FLAT = 1e-12  # a box of so little volume, relative to its longest edge's cube, has none
_UNREADABLE = (
    "modifiers after Cage Rig on '{obj.name}' reorder its vertices, so that {what} can't be read; "
    "switch one or the other off"
)


@dataclass(frozen=True)
class Place:
    """Where a skin is in the armature's space, and the world matrices that say so."""

    bones: object
    skin: object
    matrix: Matrix  # from the skin's space to the armature's
    still: bool  # it is that of the bind
    inverse: Matrix | None  # of `matrix`; None: it changes nothing
    key: bytes


Places = dict[int, Place]


def place(cage: bpy.types.Object, index: int, depsgraph: bpy.types.Depsgraph, known: Places) -> Place:
    """Where skin `index` is now; taken from `known`, and kept there, while neither object moves."""
    bones = cage.cage_rig.armature.evaluated_get(depsgraph).matrix_world
    skin = cage.cage_rig.skins[index].object.evaluated_get(depsgraph).matrix_world
    found = known.get(index)
    if found is None or found.bones != bones or found.skin != skin:
        matrix, still = to_rig(cage, index, depsgraph)
        inverse = None if np.array_equal(matrix, np.eye(4)) else np.linalg.inv(matrix)
        found = known[index] = Place(bones.copy(), skin.copy(), matrix, still, inverse, matrix.tobytes())
    return found


def to_rig(cage: bpy.types.Object, index: int, depsgraph: bpy.types.Depsgraph) -> tuple[Matrix, bool]:
    """Matrix from skin `index` to the armature's space now, and whether it is still that of the bind.

    That of the bind too where either is scaled to nothing, as animators hide characters: what is flat has no inverse.
    """
    skin = cage.cage_rig.skins[index]
    bones = cage.cage_rig.armature.evaluated_get(depsgraph).matrix_world
    world = skin.object.evaluated_get(depsgraph).matrix_world
    bound = np.array(skin.skin_to_rig, np.float64)
    if is_flat(bones) or is_flat(world):
        return bound, True
    now = np.array(bones.inverted() @ world, np.float64)
    far = 1.0 + max(float(np.abs(np.array(world)).max()), float(np.abs(np.array(bones)).max()))
    still = bool(np.allclose(now, bound, rtol=0.0, atol=2e-6 * far))
    return (bound, True) if still else (now, False)


def is_flat(world: object) -> bool:
    """Whether this 4 by 4 matrix scales a direction to nothing, so that it has no inverse."""
    axes = np.array(world, np.float64)[:3, :3]
    return bool(abs(np.linalg.det(axes)) <= FLAT * np.abs(axes).max() ** 3)


@dataclass
class RestShape:
    """What moves the rest shape of every skin beside the cage, and where the cage acts on it."""

    offsets: list[Points | None]  # #M by 3 in rig space
    masks: list[Mask | None]  # #M
    complete: bool = True  # False: a part can only be read from the next evaluation on


def offset(
    cage: bpy.types.Object,
    index: int,
    obj: bpy.types.Object,
    at: Place,
    session: Session,
    depsgraph: bpy.types.Depsgraph,
) -> Points | None:
    """What moves the rest shape of skin `index`, which is `obj`, where no modifier before ours is at work on it."""
    bound = None if at.still else np.array(cage.cage_rig.skins[index].skin_to_rig, np.float64)
    return _without_modifiers(obj, depsgraph, session.snapshot.skins[index].points, at.matrix, bound)


def read(cage: bpy.types.Object, session: Session, depsgraph: bpy.types.Depsgraph, *, readable: bool) -> RestShape:
    """Offsets by shape keys, by modifiers before ours and by the object's moves; masks by vertex groups.

    What a modifier before ours makes of positions or weights can be read from the next evaluation on after ours was
    told to keep it (and not where ours was hidden until now: `readable` False). A skin in Edit Mode stays as it was.
    """
    found = RestShape(session.offsets, session.masks)
    for index, obj in health.live_skins(cage):
        if obj.data.is_editmode:
            continue
        visible = readable and modifier.is_shown(obj)
        _read_offset(found, cage, index, session, depsgraph, visible=visible)
        _read_mask(found, cage, index, depsgraph, visible=visible)
    return found


def _read_offset(
    found: RestShape,
    cage: bpy.types.Object,
    index: int,
    session: Session,
    depsgraph: bpy.types.Depsgraph,
    *,
    visible: bool,
) -> None:
    skin = cage.cage_rig.skins[index]
    rest = session.snapshot.skins[index].points
    matrix, still = to_rig(cage, index, depsgraph)
    deformed = stack.deformed_before(skin.object)
    kept = modifier.keep_input(skin.object, deformed)
    found.complete &= kept
    if deformed and kept and visible:
        found.offsets[index] = positions.apply_matrix(matrix, _given(skin.object, depsgraph)) - rest
    else:
        bound = None if still else np.array(skin.skin_to_rig, np.float64)
        found.offsets[index] = _without_modifiers(skin.object, depsgraph, rest, matrix, bound)


def _given(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Points:
    """The skin as modifiers before ours deform it, in its own space."""
    given = modifier.read_input(obj, depsgraph)
    if given is None:
        raise SessionError(_UNREADABLE.format(what="what the ones before it do", obj=obj))
    return given


def _read_mask(
    found: RestShape, cage: bpy.types.Object, index: int, depsgraph: bpy.types.Depsgraph, *, visible: bool
) -> None:
    skin = cage.cage_rig.skins[index]
    kept = modifier.keep_mask(skin.object, cage, skin.mask)
    found.complete &= kept
    if not skin.mask:
        found.masks[index] = None
    elif kept and visible:
        mask = modifier.read_mask(skin.object, cage, depsgraph)
        if mask is None:
            raise SessionError(_UNREADABLE.format(what="its mask", obj=skin.object))
        found.masks[index] = np.clip(mask, 0.0, 1.0)
    elif found.masks[index] is None:
        found.masks[index] = vertex_groups.read_group(skin.object, skin.mask)


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


def write(
    skins: list[tuple[int, bpy.types.Object]],
    cage: bpy.types.Object,
    session: Session,
    depsgraph: bpy.types.Depsgraph,
    written: Written,
    known: Places,
) -> None:
    """Feed posed points to those of the `skins` that this rig places and whose result changed since `written`.

    A skin in Edit Mode waits.
    """
    placed = []
    for index, obj in skins:
        if obj.data.is_editmode or obj.cage_rig.owner != cage:
            written.pop(index, None)
            continue
        if not modifier.take_own(obj):
            written.pop(index, None)
        placed.append((index, obj, place(cage, index, depsgraph, known)))
    feed(placed, session, written)


def feed(placed: list[tuple[int, bpy.types.Object, Place]], session: Session, written: Written) -> None:
    """Feed posed points to those of these skins whose result changed since `written`."""
    for index, obj, at in placed:
        state = (session.revision, at.key)
        if written.get(index) == state and modifier.is_fed(obj):
            continue
        points = session.posed_skin(index)
        if at.inverse is not None:
            points = positions.apply_matrix(at.inverse, points)
        modifier.write(obj, points)
        written[index] = state
