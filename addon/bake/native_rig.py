# SPDX-License-Identifier: GPL-3.0-or-later
"""To a native rig: skins, bones and an action that Blender's own Armature modifier plays as the live rig does.

For a rest cage that stands still, and the methods Linear and Dual Quaternion (as Preserve Volume). Rest skins and rest
joints are those that the cage gives, weights those of the bind. The pose is that of the refit transforms T, whatever
makes it (constraints, IK, drivers), keyed plainly: T · rest, in what each bone's parent hands on to it (`solving`).
Then the new rig is played and held against the live one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ..adapters import armature, positions, shape_keys, vertex_groups
from . import solving
from .drafts import Draft, draft
from .keys import Keys
from .live import BakeError, Steps, playing, refuse_unready, rigs, times
from .recording import Recording, SkinRecord

Array = NDArray[np.float64]
TOLERANCE = 1e-4  # of the character's size: a native rig that is farther from the live one than this is refused
SOLVED = 2e-6  # of the same: what float32 leaves of a bone that is keyed exactly
ARMATURE = "Armature"
CHANNELS = (("location", 0, 3, 0.0), ("rotation_quaternion", 3, 7, (1.0, 0.0, 0.0, 0.0)), ("scale", 7, 10, 1.0))


@dataclass(frozen=True)
class NativeRig:
    """What was made, and how far it is from the live rig: a share of the character's size, and where that is."""

    collection: bpy.types.Collection
    armature: bpy.types.Object
    skins: list[bpy.types.Object]
    error: float
    frame: float
    bone: str

    @property
    def helpers(self) -> list[str]:
        """Bones that the armature has besides those of its source: what takes the shear of others."""
        return [bone.name for bone in self.armature.data.bones if bone.get(armature.HELPER)]

    @property
    def summary(self) -> str:
        """One sentence for the artist."""
        text = f"Baked '{self.collection.name}', which plays within {self.error:.1e} of the character's size"
        if self.error > 1e-5:
            text += f" (farthest at bone '{self.bone}', frame {self.frame:g})"
        if any(mod.type == "ARMATURE" and mod.use_deform_preserve_volume for s in self.skins for mod in s.modifiers):
            text += "; other programs don't know its Preserve Volume and skin it linearly"
        if self.helpers:
            text += f"; {len(self.helpers)} bone(s) are added for what is sheared, as '{self.helpers[0]}'"
        return text


def steps(
    cage: bpy.types.Object, frame_start: int, frame_end: int, *, samples: int, keep_action: bool
) -> Steps[NativeRig]:
    """See `to_native_rig`."""
    refuse_unready(cage)
    animated = next((rig for rig in rigs(cage) if shape_keys.is_animated(rig)), None)
    if animated is not None:
        raise BakeError(
            f"The rest cage '{animated.name}' is animated, so its joints have no one place; remove its keys, drivers "
            "and modifiers, or apply them, or bake to shape keys, Alembic or USD"
        )
    at = times(frame_start, frame_end, samples=samples)
    with draft() as made, playing(cage, at[0]) as go:
        seen = Recording(cage)
        for index, time in enumerate(at):
            seen.add(go(time), time)
            yield 0.4 * (index + 1) / len(at)
        bones = _copy_armature(made, seen, keep_action=keep_action)
        if not keep_action:
            yield from (0.4 + 0.2 * share for share in _key_bones(made, bones, seen))
        natives = [_copy_skin(made, skin, bones, seen) for skin in seen.skins]
        collection = made.finish(f"{cage.name} Native")
        with _alone(natives):
            worst = (0.0, at[0], "")
            for index, time in enumerate(at):
                here = _difference(seen, natives, go(time), time)
                _refuse_far(here, seen, keep_action=keep_action)
                worst = max(worst, here)
                yield 0.6 + 0.4 * (index + 1) / len(at)
        return NativeRig(collection, bones, natives, *worst)


def _copy_armature(made: Draft, seen: Recording, *, keep_action: bool) -> bpy.types.Object:
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
    if not keep_action:
        obj.animation_data_clear()
        for bone in obj.pose.bones:
            for constraint in list(bone.constraints):
                bone.constraints.remove(constraint)
    if moved:
        armature.move_heads(obj, bpy.context, heads)
    return obj


def _key_bones(made: Draft, obj: bpy.types.Object, seen: Recording) -> Iterator[float]:
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
        _key_bone(keys, obj.pose.bones[name], seen.times, found.keys)
        if found.helper is not None:
            _key_bone(keys, obj.pose.bones[helpers[name]], seen.times, found.helper)


def _key_bone(keys: Keys, bone: bpy.types.PoseBone, at: list[float], values: Array) -> None:
    _key(keys, bone, f"{bone.path_from_id()}.", at, values)


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
                keys.add(path, k - first, seen.times, values[:, k])


def _key(keys: Keys, owner: bpy.types.bpy_struct, prefix: str, at: list[float], values: Array) -> None:
    """Key what of `values` (`#F by 10`) differs from rest: at every time where it moves, else once."""
    owner.rotation_mode = "QUATERNION"
    for path, first, end, rest in CHANNELS:
        part = values[:, first:end]
        setattr(owner, path, part[0])
        count = len(at) if np.ptp(part, axis=0).any() else int(np.abs(part[0] - rest).max() > 0.0)
        for k in range(end - first if count else 0):
            keys.add(f"{prefix}{path}", k, at[:count], part[:count, k])


def _copy_skin(made: Draft, skin: SkinRecord, bones: bpy.types.Object, seen: Recording) -> bpy.types.Object:
    """The skin in the rest shape that the cage gives it, with the weights of the bind, on the copied armature."""
    obj, place = made.copy_skin(skin.skin, f"{skin.skin.obj.name} Native")
    _set_rest(obj, skin, seen.times, made)
    _weigh(obj, skin, bones, seen.weighted)
    _place(obj, skin, seen, bones, made)
    mod = obj.modifiers.new(ARMATURE, "ARMATURE")
    mod.object, mod.use_vertex_groups, mod.use_bone_envelopes = bones, True, False
    mod.use_deform_preserve_volume = skin.preserves_volume
    obj.modifiers.move(len(obj.modifiers) - 1, place)
    return obj


def _set_rest(obj: bpy.types.Object, skin: SkinRecord, at: list[float], made: Draft) -> None:
    """The rest shape; shape keys keep what they add to it, and their values are keyed plainly."""
    mesh, keys = obj.data, obj.data.shape_keys
    if keys is not None and not keys.use_relative:  # those a live rig does not show
        obj.shape_key_clear()
        keys = None
    if keys is not None:
        keys.animation_data_clear()
        curves = Keys(keys, obj.name, made)
        count = len(mesh.vertices)
        shift = skin.base - shape_keys.read_key(keys.key_blocks[0], count)
        for block, values in zip(keys.key_blocks, np.array(skin.key_values).T, strict=True):
            shape_keys.write_key(block, shape_keys.read_key(block, count) + shift)
            block.value = values[0]
            if np.ptp(values) > 0.0:
                curves.add(f"{block.path_from_id()}.value", 0, at, values)
    positions.write_base(mesh, skin.base)


def _weigh(obj: bpy.types.Object, skin: SkinRecord, bones: bpy.types.Object, weighted: set[str]) -> None:
    """Vertex groups as bound. Other groups with a bone's name, which exporters take for weights, go where they can."""
    asked_for = vertex_groups.named(obj)
    for group in list(obj.vertex_groups):
        bone = bones.data.bones.get(group.name)
        if bone is None:
            continue
        if group.name not in weighted:
            bone.use_deform = False
        if group.name in weighted or group.name not in asked_for:
            obj.vertex_groups.remove(group)
    for name in weighted:
        bones.data.bones[name].use_deform = True
    vertex_groups.write_weights(obj, *skin.weights)


def _place(obj: bpy.types.Object, skin: SkinRecord, seen: Recording, bones: bpy.types.Object, made: Draft) -> None:
    """Where the skin is, by the copied armature instead of the armature, and by nothing else where that can be."""
    to_parent = obj.matrix_parent_inverse.copy()
    if seen.source not in _ancestors(obj) and not skin.is_still:
        return  # it goes its own way
    follows = obj.parent == seen.source and obj.parent_type == "OBJECT"
    obj.parent, obj.parent_type = bones, "OBJECT"
    if follows:
        obj.matrix_parent_inverse = to_parent
        return
    obj.animation_data_clear()
    for constraint in list(obj.constraints):
        obj.constraints.remove(constraint)
    obj.delta_location, obj.delta_rotation_euler, obj.delta_scale = (0.0,) * 3, (0.0,) * 3, (1.0,) * 3
    obj.delta_rotation_quaternion, obj.rotation_mode = (1.0, 0.0, 0.0, 0.0), "QUATERNION"
    if skin.is_still:
        obj.matrix_parent_inverse, obj.matrix_basis = Matrix(skin.to_rig[0]), Matrix()
        return
    obj.matrix_parent_inverse = Matrix()
    _key(Keys(obj, obj.name, made), obj, "", seen.times, solving.rows([Matrix(m).decompose() for m in skin.to_rig]))


def _ancestors(obj: bpy.types.Object) -> list[bpy.types.Object]:
    found = []
    while obj.parent is not None:
        obj = obj.parent
        found.append(obj)
    return found


@contextmanager
def _alone(natives: list[bpy.types.Object]) -> Iterator[None]:
    """Modifiers after the new Armature modifiers off: what comes before is what has to match."""
    hidden = []
    for obj in natives:
        names = [mod.name for mod in obj.modifiers]
        hidden += [mod for mod in obj.modifiers if mod.show_viewport and names.index(mod.name) > names.index(ARMATURE)]
    for mod in hidden:
        mod.show_viewport = False
    yield
    for mod in hidden:
        mod.show_viewport = True


def _difference(
    seen: Recording, natives: list[bpy.types.Object], depsgraph: bpy.types.Depsgraph, time: float
) -> tuple[float, float, str]:
    """How far the new skins are from the live ones now, as a share of the character's size, and the bone there."""
    to_rig = np.linalg.inv(armature.to_array(seen.source.evaluated_get(depsgraph).matrix_world))
    worst = (0.0, time, "")
    for skin, obj in zip(seen.skins, natives, strict=True):
        placed = to_rig @ armature.to_array(obj.evaluated_get(depsgraph).matrix_world)
        native = positions.apply_matrix(placed, positions.read_evaluated(obj, depsgraph))
        live = skin.skin.session.posed_skin(skin.skin.index)
        off = np.linalg.norm(native - live, axis=1) / seen.size
        vertex = int(off.argmax())
        names, (indptr, columns, values) = skin.weights
        mine = slice(indptr[vertex], indptr[vertex + 1])
        bone = names[columns[mine][values[mine].argmax()]] if len(columns[mine]) else ""
        worst = max(worst, (float(off[vertex]), time, bone))
    return worst


def _refuse_far(found: tuple[float, float, str], seen: Recording, *, keep_action: bool) -> None:
    error, time, bone = found
    if error <= TOLERANCE:
        return
    off = f"off by {100.0 * error:.2g} % of the character's size at frame {time:g}, at bone '{bone}'"
    if keep_action:
        why = "constraints, IK or drivers make another motion of its own action; bake a new one"
    elif any(skin.preserves_volume for skin in seen.skins):
        why = "Blender's Preserve Volume does otherwise with what is scaled there; set the method to Linear"
    else:
        why = "location, rotation and scale can't make its motion; bake to shape keys, Alembic or USD"
    raise BakeError(f"The native rig would be {off}: {why}")
