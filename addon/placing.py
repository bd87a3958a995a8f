# SPDX-License-Identifier: GPL-3.0-or-later
"""Cages, skins and armatures whose transforms were applied, or whose origins were set: their points have other
coordinates and are where they were. The rig takes that over, so that nothing moves.

It is seen in the file alone, whatever was done meanwhile: an undo may come back to a step that was saved in between.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from . import binding, layers
from .adapters import armature, positions
from .skins import is_flat

NEAR = 1e-5  # of the size
SAMPLES = 8  # vertices of a skin that are looked at first
Matrix4 = NDArray[np.float64]
Points = NDArray[np.float64]


def settle(cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph, seen: bytes = b"") -> bytes:
    """Take over what Apply or Set Origin did. Where points were moved as well, nothing is taken over.

    Skins are looked at where an object has moved since the places that the last call returned were `seen`.
    """
    settings = cage.cage_rig
    objects = (cage, settings.armature, settings.posed_cage)
    if any(obj is None or obj.data is None or not layers.is_own(obj) or obj.mode == "EDIT" for obj in objects):
        return b""
    worlds = [_world(obj, depsgraph) for obj in objects]
    kinds = [obj.type for obj in objects]
    if settings.snapshot is None or kinds != ["MESH", "ARMATURE", "MESH"] or any(map(is_flat, worlds)):
        return b""
    _settle_cage(cage, worlds[0])
    found = b"".join(world.tobytes() for world in (*worlds, *(_world(skin.object, depsgraph) for skin in _skins(cage))))
    if found == seen:
        return found
    if not _settle_skins(cage, worlds[1], depsgraph):
        change = _of_armature(cage, worlds[1], depsgraph)
        if change is not None:
            _rebase(cage, change)
            _settle_skins(cage, worlds[1], depsgraph)
        for skin in _skins(cage):
            _settle_moved(cage, skin)
    return found


def _world(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Matrix4:
    return np.array(obj.evaluated_get(depsgraph).matrix_world, np.float64)


def _moved(matrix: Matrix4, points: Points) -> Points:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def _same(one: Points, other: Points, size: float, fuzz: float = 0.0) -> bool:
    return one.shape == other.shape and bool(np.abs(one - other).max() <= NEAR * size + fuzz)


def _fuzz(space: Matrix4, world: Matrix4) -> float:
    """How far float32 matrices may put a point off that goes from `world` into a space."""
    return 5e-7 * float(np.abs(np.linalg.inv(space)).max() * np.abs(world).max())


def _size(points: Points) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0))) + 1e-30


def _settle_cage(cage: bpy.types.Object, world: Matrix4) -> None:
    settings, points = cage.cage_rig, positions.read_base(cage.data).astype(np.float64)
    marks = _marks(points)
    state, seen = np.float32([*world.ravel(), *marks.ravel()]), np.float32(settings.place)
    if np.array_equal(seen, state):
        return
    if seen.any():
        before, old = seen[:16].astype(np.float64).reshape(4, 4), seen[16:].astype(np.float64).reshape(-1, 3)
        change = np.linalg.inv(world) @ before
        size, fuzz = _size(points), _fuzz(world, before)
        if _same(marks, _moved(change, old), size, fuzz) and not _same(marks, old, size):
            to_rig = np.array(settings.cage_to_rig, np.float64) @ np.linalg.inv(change)
            settings.cage_to_rig = to_rig.T.tolist()
    settings.place = state.tolist()


def _marks(points: Points) -> Points:
    """Four points that go with any affine map of all points, and with hardly anything else."""
    return _weights(len(points)) @ points


@lru_cache(maxsize=8)
def _weights(count: int) -> Matrix4:
    weights = 1.0 + 0.9 * np.cos(np.outer(np.arange(1.0, 5.0), np.arange(count)))
    return weights / weights.sum(1, keepdims=True)


def _settle_skins(cage: bpy.types.Object, bones: Matrix4, depsgraph: bpy.types.Depsgraph) -> bool:
    """Take over skins that were applied alone. Returns whether all that can be looked at rest where they were bound."""
    whole = True
    for skin in _skins(cage):
        world, bound = _world(skin.object, depsgraph), np.array(skin.skin_to_rig, np.float64)
        now, fuzz = np.linalg.inv(bones) @ world, _fuzz(bones, world)
        base, rest = (positions.read_some(mesh, SAMPLES) for mesh in (skin.object.data, skin.snapshot))
        rest = _moved(_rebased(cage), rest)
        size = _size(rest)
        if not _same(_moved(now, base), rest, size, fuzz):
            whole = False
        elif np.isfinite(bound).all() and not _same(_moved(bound, base), rest, size, fuzz):
            skin.skin_to_rig = now.T.tolist()
    return whole


def _settle_moved(cage: bpy.types.Object, skin: bpy.types.PropertyGroup) -> None:
    """Take over a skin that was moved since it was bound, then applied: its base is an affine map of the old one."""
    bound = np.array(skin.skin_to_rig, np.float64)
    base, rest = (positions.read_some(mesh, SAMPLES) for mesh in (skin.object.data, skin.snapshot))
    if not np.isfinite(bound).all() or _same(_moved(bound, base), _moved(_rebased(cage), rest), _size(rest)):
        return
    base = positions.read_base(skin.object.data).astype(np.float64)
    rest = binding.rest_points(cage.cage_rig, skin.snapshot).astype(np.float64)
    to_rig, exact = _affine(base, rest)
    if exact:
        skin.skin_to_rig = to_rig.T.tolist()


def _affine(points: Points, images: Points, fuzz: float = 0.0) -> tuple[Matrix4, bool]:
    """The affine map that comes nearest to taking points to their images, and whether it does."""
    solved, _, rank, _ = np.linalg.lstsq(np.c_[points, np.ones(len(points))], images, rcond=None)
    change = np.eye(4)
    change[:3] = solved.T
    return change, rank == 4 and _same(_moved(change, points), images, _size(images), fuzz)


def _skins(cage: bpy.types.Object) -> list[bpy.types.PropertyGroup]:
    def may_be(skin: bpy.types.PropertyGroup) -> bool:
        obj, snapshot = skin.object, skin.snapshot
        if obj is None or skin.applied or snapshot is None or obj.type != "MESH" or not layers.is_own(obj):
            return False
        return not obj.data.is_editmode and 0 < len(obj.data.vertices) == len(snapshot.vertices)

    return [skin for skin in cage.cage_rig.skins if may_be(skin)]


def _of_armature(cage: bpy.types.Object, bones: Matrix4, depsgraph: bpy.types.Depsgraph) -> Matrix4 | None:
    """From rig space as it was bound to the armature's present space, where bones and skins agree on that."""
    rest = armature.read_rest(cage.cage_rig.armature.data)
    place = {name: k for k, name in enumerate(rest.names)}
    joints = cage.cage_rig.joints
    if any(joint.name not in place for joint in joints):
        return None
    order = [place[joint.name] for joint in joints]
    now = np.concatenate([rest.heads[order], rest.tails[order]])
    heads = np.array([np.add(joint.head, joint.shift) for joint in joints], np.float64)
    ways = np.array([np.subtract(joint.tail, joint.head) for joint in joints], np.float64)
    then = np.concatenate([heads, heads + ways])
    if _same(now, then, _size(then)):
        return None
    for change in _candidates(cage, bones, depsgraph):
        fuzz = _fuzz(np.eye(4), change)
        if np.linalg.det(change[:3, :3]) > 0.0 and _same(_moved(change, then), now, _size(now), fuzz):
            return change
    return None


def _candidates(cage: bpy.types.Object, bones: Matrix4, depsgraph: bpy.types.Depsgraph) -> Iterator[Matrix4]:
    """Maps from rig space as it was bound to today's: where Blender has put the posed cage so that it stays in its
    place, and how skins rest now, if they lie otherwise.
    """
    posed = cage.cage_rig.posed_cage
    if posed.parent == cage.cage_rig.armature:
        yield _from_bones(posed, depsgraph)
    for skin in _skins(cage):
        base = positions.read_base(skin.object.data).astype(np.float64)
        old = binding.rest_points(cage.cage_rig, skin.snapshot).astype(np.float64)
        world = _world(skin.object, depsgraph)
        change, exact = _affine(old, _moved(np.linalg.inv(bones) @ world, base), _fuzz(bones, world))
        if exact:
            yield change


def _rebased(cage: bpy.types.Object) -> Matrix4:
    found = np.array(cage.cage_rig.rebased, np.float64)
    return found if found.any() else np.eye(4)


def _rebase(cage: bpy.types.Object, change: Matrix4) -> None:
    """Bring all that the rig keeps in rig space to the armature's present space.

    In the settings alone: an undo brings back what its step has changed, and leaves what a handler wrote elsewhere.
    """
    settings = cage.cage_rig
    settings.rebased = (change @ _rebased(cage)).T.tolist()
    for skin in settings.skins:
        skin.skin_to_rig = (change @ np.array(skin.skin_to_rig, np.float64)).T.tolist()
    settings.cage_to_rig = (change @ np.array(settings.cage_to_rig, np.float64)).T.tolist()
    for joint in settings.joints:
        joint.head, joint.tail = _moved(change, np.array([joint.head, joint.tail], np.float64))
        joint.shift = change[:3, :3] @ np.array(joint.shift, np.float64)
    for obj in (settings.posed_cage, settings.refit_armature):
        if obj is not None and obj.parent == settings.armature:
            obj.matrix_parent_inverse.identity()
            obj.matrix_basis.identity()
    refit = settings.refit_armature
    if refit is not None and len(refit.data.bones) == len(settings.joints):
        heads = armature.read_rest(refit.data).heads
        wanted = np.array([joint.head for joint in settings.joints], np.float64)
        if _same(_moved(change, heads), wanted, _size(wanted), _fuzz(np.eye(4), change)):
            refit.data.transform(Matrix(change))


def posed_has_stayed(
    cage: bpy.types.Object, before: positions.Points, posed: positions.Points, depsgraph: bpy.types.Depsgraph
) -> bool:
    """Whether the posed cage's points are where they were because its origin was set; then the object is put back."""
    obj = cage.cage_rig.posed_cage
    if obj.data.is_editmode or obj.parent is None or is_flat(_world(obj.parent, depsgraph)):
        return False
    place = _from_bones(obj, depsgraph)
    if np.allclose(place, np.eye(4), atol=1e-6):
        return False
    if not _same(_moved(place, posed.astype(np.float64)), before.astype(np.float64), _size(before)):
        return False
    _put_back(obj, place)
    return True


def _from_bones(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Matrix4:
    """Where a child of the armature is in rig space."""
    return np.linalg.inv(_world(obj.parent, depsgraph)) @ _world(obj, depsgraph)


def _put_back(obj: bpy.types.Object, place: Matrix4) -> None:
    """Let the object's space be rig space again, its points where they are."""
    obj.data.transform(Matrix(place))
    obj.matrix_parent_inverse.identity()
    obj.matrix_basis.identity()
