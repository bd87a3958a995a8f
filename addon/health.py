# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a rig can run: each question answers with a sentence for the artist, or nothing.

A rig that can't run is paused: its skins go back to their own Armature modifiers until it can.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import layers, linked
from .adapters import armature, modifier, positions, stack


class Problem(str):
    """A sentence for the artist, and what a button can do about it: "what:name", see `repair`; empty where nothing."""

    fix: str

    def __new__(cls, sentence: str, fix: str = "") -> Problem:
        made = super().__new__(cls, sentence)
        made.fix = fix
        return made


def problem(cage: bpy.types.Object) -> str:
    """Why the rig can't run and what to do, as a `Problem` where a button can help, or an empty string."""
    posed = cage.cage_rig.posed_cage
    if posed is not None and posed.cage_rig.owner != cage:
        return f"'{cage.name}' is a copy of cage '{_name(posed.cage_rig.owner)}'; bind it to skins and bones of its own"
    return (
        linked.problem(cage)
        or _armature_problem(cage)
        or _cage_problem(cage)
        or _skins_problem(cage)
        or _layers_problem(cage)
        or _below_problem(cage)
    )


def _layers_problem(cage: bpy.types.Object) -> str:
    sentence = layers.problem(cage)
    return Problem(sentence, "clear_input") if sentence and cage.cage_rig.input is not None else sentence


def _below_problem(cage: bpy.types.Object) -> str:
    for lower in layers.below(cage):
        if lower.cage_rig.state != "LIVE":
            sentence = f"'{cage.name}' stands on '{lower.name}', which is paused: {lower.cage_rig.message}"
            return Problem(sentence, f"select:{lower.name}")
    return ""


def live_skins(cage: bpy.types.Object) -> list[tuple[int, bpy.types.Object]]:
    """Skins that still are in the file's scenes and the rig's to move, with their index in the rig."""
    skins = enumerate(cage.cage_rig.skins)
    return [(k, skin.object) for k, skin in skins if _in_use(skin.object) and not skin.applied]


def lost_skins(cage: bpy.types.Object) -> str:
    """What the artist should know of skins that were deleted or applied, or an empty string."""
    applied = _applied(cage)
    deleted = len(cage.cage_rig.skins) - len(applied) - len(live_skins(cage))
    if deleted:
        return f"{deleted} skin(s) of '{cage.name}' were deleted; Rebind forgets them"
    if applied:
        return f"Cage Rig was applied to '{applied[0]}', which keeps its shape and follows no more; Rebind forgets it"
    return ""


def _applied(cage: bpy.types.Object) -> list[str]:
    return [skin.object.name for skin in cage.cage_rig.skins if skin.applied and _in_use(skin.object)]


def _in_use(obj: bpy.types.Object | None) -> bool:
    return obj is not None and len(obj.users_collection) > 0


def _is_mesh(obj: bpy.types.Object | None) -> bool:
    return obj is not None and obj.type == "MESH"


def _name(obj: bpy.types.ID | None) -> str:
    return obj.name if obj is not None else "deleted"


def _armature_problem(cage: bpy.types.Object) -> str:
    obj = cage.cage_rig.armature
    if obj is None or obj.type != "ARMATURE" or not _in_use(obj):
        return f"The armature of '{cage.name}' was deleted; undo, or select a new one with the skins and bind again"
    if obj.mode == "EDIT":
        return ""
    missing = follow_renames(cage)
    if missing:
        return Problem(f"Bone '{missing}' of '{obj.name}' was deleted; undo, or press Rebind", "rebind")
    bones = obj.data.bones
    for joint in cage.cage_rig.joints:
        if joint.weighted and bones[joint.name].bbone_segments > 1:
            return bendy(obj, joint.name)
    return ""


def bendy(obj: bpy.types.Object, bone: str) -> str:
    """Why a B-bone that deforms can't be followed."""
    return Problem(
        f"Bone '{bone}' of '{obj.name}' is a B-bone and deforms the skin; set its segments to 1 (Bone, Bendy Bones)",
        f"segments:{bone}",
    )


def _cage_problem(cage: bpy.types.Object) -> str:
    settings = cage.cage_rig
    if not _in_use(cage):
        return f"Cage '{cage.name}' was deleted; undo, or link it into a collection again"
    if settings.snapshot is None:
        return Problem(f"What was bound of '{cage.name}' is lost; press Rebind", "rebind")
    if not _is_mesh(settings.posed_cage) or not _in_use(settings.posed_cage):
        sentence = f"The posed cage of '{cage.name}' was deleted; undo, or press Rebind to make a new one"
        return Problem(sentence, "rebind")
    for obj in (cage, settings.posed_cage):
        if obj.data.is_editmode:
            same = positions.edit_vertex_count(obj.data) == len(settings.snapshot.vertices)
        else:
            same = positions.same_faces(obj.data, settings.snapshot)
        if not same:
            sentence = f"'{obj.name}' has other vertices or faces than when it was bound; undo, or press Rebind"
            return Problem(sentence, "rebind")
    return ""


def _skins_problem(cage: bpy.types.Object) -> str:
    skins = live_skins(cage)
    applied = _applied(cage)
    if applied and not skins:
        return Problem(
            f"Cage Rig was applied to '{applied[0]}', which keeps its shape and follows no more; undo, or press Unbind",
            "unbind",
        )
    if not skins:
        return Problem(f"All skins of '{cage.name}' were deleted; undo, or press Unbind", "unbind")
    for index, obj in skins:
        if not _is_mesh(obj):
            return Problem(
                f"'{obj.name}', a skin of '{cage.name}', is no mesh any more; undo, or press Unbind", "unbind"
            )
        snapshot = cage.cage_rig.skins[index].snapshot
        if snapshot is None:
            return Problem(f"What was bound of '{obj.name}' is lost; press Rebind", "rebind")
        if len(obj.data.vertices) != len(snapshot.vertices):
            return Problem(
                f"'{obj.name}' has {len(obj.data.vertices)} vertices, it had {len(snapshot.vertices)} "
                "when it was bound; undo, or press Rebind",
                "rebind",
            )
        if modifier.find(obj, cage) is None:
            return Problem(f"The Cage Rig modifier of '{obj.name}' was removed; undo, or press Rebind", "rebind")
        if obj.override_library is not None and not modifier.is_whole(obj):
            return (
                f"The Cage Rig modifier of '{obj.name}' is damaged in another file; open and save that file, then "
                "reload it here (Outliner, Blender File, Libraries)"
            )
        blocking = stack.blocking(obj, stack.first(obj))
        if blocking:
            sentence = f"Modifier '{blocking}' of '{obj.name}' may change the vertices before Cage Rig; move it after"
            return Problem(sentence, f"move_after:{obj.name}")
        mask = cage.cage_rig.skins[index].mask
        if mask and mask not in obj.vertex_groups:
            sentence = f"Vertex group '{mask}', the mask of '{obj.name}', was deleted; choose another or none"
            return Problem(sentence, f"clear_mask:{obj.name}")
        reordering = stack.reordering(obj)
        if reordering:
            return Problem(
                f"Modifier '{reordering}' of '{obj.name}' may reorder the vertices, so that what the modifiers before "
                "Cage Rig do, or its mask, can't be read; switch one or the other off",
                f"select:{obj.name}",
            )
    return ""


def follow_renames(cage: bpy.types.Object) -> str:
    """Take over new names of bones, recognised by their rest position; returns the name of a bone that is gone."""
    joints, bones = cage.cage_rig.joints, cage.cage_rig.armature.data.bones
    known = {joint.name for joint in joints}
    lost = [joint for joint in joints if joint.name not in bones]
    if not lost:
        return ""
    fresh = [bone for bone in bones if bone.name not in known]
    for joint in lost:
        same = [bone for bone in fresh if _is_joint(bone, joint)]
        if len(same) != 1:
            return joint.name
        joint.name = same[0].name
    return ""


def _is_joint(bone: bpy.types.Bone, joint: bpy.types.PropertyGroup) -> bool:
    """Whether the bone is where the joint was bound (or was refit to) and points the same way."""
    head = np.array(joint.head) + np.array(joint.shift)
    along = np.array(joint.tail) - np.array(joint.head)
    return np.allclose(bone.head_local, head, atol=1e-5) and np.allclose(
        (bone.tail_local - bone.head_local).normalized(),
        along / np.linalg.norm(along),
        atol=1e-4,
    )


def bone_order(cage: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the rig's joints among `armature.bones` and among `pose.bones`, each `#J`."""
    obj = cage.cage_rig.armature
    rest = {name: k for k, name in enumerate(armature.bone_names(obj.data))}
    pose = {bone.name: k for k, bone in enumerate(obj.pose.bones)}
    names = [joint.name for joint in cage.cage_rig.joints]
    return np.array([rest[name] for name in names]), np.array([pose[name] for name in names])
