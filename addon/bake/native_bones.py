# SPDX-License-Identifier: GPL-3.0-or-later
"""The armature of a native rig: rest bones at the refit joints, and keys that pose them as the live rig does."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ..adapters import armature, positions
from . import solving
from .drafts import Draft
from .keys import Keys
from .live import BakeError
from .recording import Recording

Array = NDArray[np.float64]
SOLVED = 2e-6  # of the character's size: what float32 leaves of a bone that is keyed exactly


def copy_armature(made: Draft, seen: Recording, *, keep_action: bool) -> bpy.types.Object:
    """The armature with its rest bones at the refit joints, without constraints unless it plays its own action."""
    source = seen.source
    rest = armature.read_rest(source.data)
    heads = dict(zip(rest.names, rest.heads, strict=True))
    joints = {name: joint for name, (joint, _) in seen.refit().items()}
    moved = {name: joint for name, joint in joints.items() if np.linalg.norm(joint - heads[name]) > 1e-6 * seen.size}
    heads |= moved
    if keep_action:
        keyed = armature.keyed_location(source, armature.leaves_parent(source.data, heads)) if moved else None
        if keyed:
            raise BakeError(
                f"Bone '{keyed}' of '{source.name}' has to be disconnected, which would bring its keyed location to "
                "life; bake a new action, or delete its location keys"
            )
    obj = made.copy(source, f"{source.name} Native")
    obj.data.animation_data_clear()
    obj.data.pose_position = "POSE"
    if keep_action:
        armature.let_refer(obj, source, obj)
    else:
        obj.animation_data_clear()
        for bone in obj.pose.bones:
            for constraint in list(bone.constraints):
                bone.constraints.remove(constraint)
    if moved:
        armature.move_heads(obj, bpy.context, heads)
    return obj


def key_bones(made: Draft, obj: bpy.types.Object, seen: Recording) -> Iterator[float]:
    """Pose the copied armature at every time, by keys; yields its progress."""
    refit, weighted = seen.refit(), seen.weighted
    pose = {bone.name: k for k, bone in enumerate(seen.source.pose.bones)}
    reach = _reach(seen, obj)
    solved: dict[str, solving.Solved] = {}
    names = armature.bone_names(obj.data)  # parents come before their children
    for index, name in enumerate(names):
        bone = obj.data.bones[name]
        if name in refit:
            rest = armature.to_array(bone.matrix_local)
            wanted = [Matrix(transform @ rest) for transform in refit[name][1]]
        else:  # a bone made after the bind, which no cage moves
            wanted = [Matrix(poses[pose[name]]) for poses in seen.poses]
        solved[name] = solving.solve(
            solving.Bone(
                bone,
                wanted,
                solved[bone.parent.name].posed if bone.parent else None,
                np.array([channels[pose[name]] for channels in seen.channels]),
                reach[name],
                name in weighted,
            ),
            SOLVED * seen.size,
        )
        yield (index + 1) / len(names)
    armature.disconnect(obj, bpy.context, [name for name, found in solved.items() if not found.connected])
    helpers = armature.add_helpers(obj, bpy.context, [name for name in names if solved[name].helper is not None])
    keys = Keys(obj, obj.name, made)
    _key_object(keys, obj, seen)
    for name, found in solved.items():
        for key, values in ((name, found.keys), (helpers.get(name), found.helper)):
            if values is not None:
                bone = obj.pose.bones[key]
                keys.add_transform(bone, f"{bone.path_from_id()}.", seen.times, values)


def _reach(seen: Recording, obj: bpy.types.Object) -> dict[str, Array]:
    """Points that each bone moves, `#points by 4` in its own space: a frame of its length, the box of its vertices."""
    found, boxes = {}, _boxes(seen)
    for bone in obj.data.bones:
        reach = np.vstack([np.zeros(3), np.eye(3) * bone.length])
        if bone.name in boxes:
            low, high = boxes[bone.name]
            corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
            local = np.linalg.inv(armature.to_array(bone.matrix_local))
            reach = np.vstack([reach, corners @ local[:3, :3].T + local[:3, 3]])
        found[bone.name] = np.column_stack([reach, np.ones(len(reach))])
    return found


def _boxes(seen: Recording) -> dict[str, tuple[Array, Array]]:
    """Low and high corner of the rest vertices that each bone moves, in the armature's space."""
    found: dict[str, tuple[Array, Array]] = {}
    for skin in seen.skins:
        points = positions.apply_matrix(skin.to_rig[0], skin.base)
        names, (indptr, columns, _) = skin.weights
        row = np.repeat(np.arange(len(points)), np.diff(indptr))
        for column in np.unique(columns).tolist():
            moved = points[row[columns == column]]
            low, high = moved.min(axis=0), moved.max(axis=0)
            if names[column] in found:
                low, high = np.minimum(low, found[names[column]][0]), np.maximum(high, found[names[column]][1])
            found[names[column]] = low, high
    return found


def _key_object(keys: Keys, obj: bpy.types.Object, seen: Recording) -> None:
    """The armature object's own place, as its keys, drivers and actions make it; parent and constraints stay."""
    values = np.array(seen.placement)
    last = values.shape[1] - 3
    for path, first, end in (("location", 0, 3), (seen.rotation_path, 3, last), ("scale", last, last + 3)):
        setattr(obj, path, values[0, first:end])
        if np.ptp(values[:, first:end], axis=0).any():
            for k in range(first, end):
                keys.add(path, k - first, seen.times, values[:, k], group="Object Transforms")
