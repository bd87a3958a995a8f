"""What the tests of rigs compare with: Blender's own Armature modifier, and a rig under an affinely changed cage.

An affine change of the rest cage moves skin and joints by the same affine map (our coordinates reproduce it), so
that the whole coupled pose can be written down with loops and Blender's own matrices.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from scene import Rig, native, rest, shown, update

from blend_fixtures.build import RigObjects

Array = np.ndarray
FAT = np.array([1.2, 1.6, 1.6])  # what `scene.fat_key` does to the cage


@dataclass(frozen=True)
class Bound:
    """What held at the bind: rest skins and the fattening map, in the armature's space."""

    skins: list[Array]  # #M by 3
    fatten: Array  # 4 by 4
    size: float

    @staticmethod
    def of(rig: Rig | RigObjects) -> Bound:
        """Read it, the bones at rest. Call where the objects are as they were at the bind."""
        rig.armature.data.pose_position = "REST"
        update()
        cage = _to_rig(rig, rig.cage)
        skins = [_apply(_to_rig(rig, skin), rest(skin)) for skin in rig.skins]
        size = _extent(np.concatenate(skins))
        rig.armature.data.pose_position = "POSE"
        update()
        return Bound(skins, cage @ np.diag([*FAT, 1.0]) @ np.linalg.inv(cage), size)


def worst_against_blender(rig: Rig) -> float:
    """Largest distance of our skins from Blender's own, as a share of the skin's size."""
    worst = 0.0
    for skin in rig.skins:
        ours = shown(skin)
        worst = max(worst, float(np.abs(ours - blender_alone(skin)).max()) / _extent(rest(skin)))
    return worst


def blender_alone(skin: bpy.types.Object) -> Array:
    """The skin as Blender shows it without us: by its Armature modifier, or else by its parent."""
    if "Armature" in skin.modifiers:
        return native(skin)
    ours = skin.modifiers["Cage Rig"]
    ours.show_viewport = False
    update()
    points = shown(skin)
    ours.show_viewport = True
    update()
    return points


def motion(rig: Rig) -> float:
    """How far the pose moves the skins from rest, as a share of their size."""
    return max(float(np.abs(shown(skin) - rest(skin)).max()) for skin in rig.skins) / rig.size


def refit_heads(rig: Rig) -> Array:
    """Heads of the posed refit bones (#J by 3, the armature's space)."""
    return np.array([bone.head for bone in rig.refit.pose.bones])


def pose_heads(rig: Rig) -> Array:
    """Heads of the armature's posed bones (#J by 3, the armature's space), in the refit bones' order."""
    return np.array([rig.armature.pose.bones[bone.name].head for bone in rig.refit.pose.bones])


def fat_rig(rig: Rig, bound: Bound) -> tuple[Array, list[Array]]:
    """Refit heads (#J by 3) and posed skins (armature's space) of the present pose under the fattened cage."""
    names = [bone.name for bone in rig.armature.data.bones]
    place = {name: k for k, name in enumerate(names)}
    parents = [bone.parent.name if bone.parent else None for bone in rig.armature.data.bones]
    moved = np.empty((len(names), 4, 4))
    heads = np.empty((len(names), 3))
    for name in _parents_first(names, parents):
        k = place[name]
        parent = None if parents[k] is None else place[parents[k]]
        animated = _transform(rig, name)
        above = np.eye(4) if parent is None else _transform(rig, names[parent])
        joint = np.array(rig.armature.data.bones[name].head_local)
        offset = _point(animated, joint) - _point(above, joint)
        refit = _point(bound.fatten, joint)
        heads[k] = _point(np.eye(4) if parent is None else moved[parent], refit) + offset
        moved[k] = animated
        moved[k, :3, 3] = heads[k] - animated[:3, :3] @ refit
    skins = [
        _skinned(
            _apply(bound.fatten, before) + _apply(_to_rig(rig, skin), rest(skin)) - before, skin, place, moved, rig
        )
        for skin, before in zip(rig.skins, bound.skins, strict=True)
    ]
    return heads, skins


def shown_in_rig(rig: Rig) -> list[Array]:
    """The skins as shown, in the armature's space."""
    return [_apply(_to_rig(rig, skin), shown(skin)) for skin in rig.skins]


def _skinned(points: Array, skin: bpy.types.Object, place: dict[str, int], moved: Array, rig: Rig) -> Array:
    """Linear blend skinning by the skin's own groups, one loop."""
    deforming = {name for name in place if rig.armature.data.bones[name].use_deform}
    groups = [group.name for group in skin.vertex_groups]
    posed = points.copy()
    for vertex in skin.data.vertices:
        found = [(place[groups[g.group]], g.weight) for g in vertex.groups if groups[g.group] in deforming]
        total = sum(weight for _, weight in found)
        if total > 0.0:
            blended = sum(weight / total * moved[k] for k, weight in found)
            posed[vertex.index] = _point(blended, points[vertex.index])
    return posed


def _transform(rig: Rig, name: str) -> Array:
    """T of one bone: what takes it from rest to its pose, in the armature's space."""
    bone = rig.armature.pose.bones[name]
    return np.array(bone.matrix) @ np.linalg.inv(np.array(bone.bone.matrix_local))


def _parents_first(names: list[str], parents: list[str | None]) -> Iterable[str]:
    done: set[str | None] = {None}
    while len(done) <= len(names):
        for name, parent in zip(names, parents, strict=True):
            if parent in done and name not in done:
                done.add(name)
                yield name


def _extent(points: Array) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _to_rig(rig: Rig | RigObjects, obj: bpy.types.Object) -> Array:
    return np.linalg.inv(np.array(rig.armature.matrix_world)) @ np.array(obj.matrix_world)


def _apply(matrix: Array, points: Array) -> Array:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def _point(matrix: Array, point: Array) -> Array:
    return matrix[:3, :3] @ point + matrix[:3, 3]
