# SPDX-License-Identifier: GPL-3.0-or-later
"""What a bind writes into the file: snapshots, posed cage, refit bones, modifiers; and taking it away."""

from __future__ import annotations

import uuid
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from . import binding, layers, sync
from .adapters import armature, modifier, positions, snapshot, stack
from .session import Session, Snapshot

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Bound:
    """What a bind has read: the core's snapshot, and what only Blender needs of it."""

    snapshot: Snapshot
    bone_names: list[str]
    skin_to_rig: list[Matrix]
    cage_to_rig: Matrix


def install(context: bpy.types.Context, cage: bpy.types.Object, bound: Bound, session: Session) -> None:
    """Write the rig and let it run in the session that the bind computed."""
    settings = cage.cage_rig
    sync.drop(cage)
    _write_joints(cage, bound)
    settings.bind_id = uuid.uuid4().hex
    settings.property_unset("rebased")
    settings.property_unset("place")
    settings.cage_to_rig = bound.cage_to_rig.T.tolist()
    remove_mesh(settings.snapshot)
    settings.snapshot = snapshot.write(f"{cage.name} Bind", bound.snapshot.cage, bound.snapshot.cage_faces, None)
    _make_posed_cage(context, cage, bound)
    _make_refit_armature(context, cage)
    stack.suspend_armature(cage, settings.armature)
    for index, skin in enumerate(settings.skins):
        part = bound.snapshot.skins[index]
        remove_mesh(skin.snapshot)
        skin.snapshot = snapshot.write(f"{skin.object.name} Bind", part.points, part.faces, part.weights)
        skin.skin_to_rig = bound.skin_to_rig[index].T.tolist()
        _join(skin.object, cage)
    layers.wait(cage)
    binding.write_known(cage, bound.snapshot.known)
    binding.mark(cage)
    settings.state = "PAUSED"  # a rig until the first update makes it live
    sync.start(cage, context.evaluated_depsgraph_get(), session)


def _join(skin: bpy.types.Object, cage: bpy.types.Object) -> None:
    settings = cage.cage_rig
    skin.cage_rig.part = "SKIN"
    if modifier.find(skin, cage) is None:
        modifier.add(skin, settings.posed_cage, stack.place(skin, settings.armature))
    layers.settle(skin)
    stack.suspend_armature(skin, settings.armature)


def _write_joints(cage: bpy.types.Object, bound: Bound) -> None:
    joints = cage.cage_rig.joints
    joints.clear()
    weighted = set(np.concatenate([skin.weights[1] for skin in bound.snapshot.skins]).tolist())
    for k, name in enumerate(bound.bone_names):
        joint = joints.add()
        joint.name, joint.parent = name, int(bound.snapshot.parents[k])
        joint.weighted = k in weighted
        joint.head, joint.tail = bound.snapshot.heads[k], bound.snapshot.tails[k]


def _make_posed_cage(context: bpy.types.Context, cage: bpy.types.Object, bound: Bound) -> None:
    """The posed cage: a mesh of the cage's faces in rig space, parented to the armature."""
    settings = cage.cage_rig
    mesh = positions.new_mesh(f"{cage.name} Posed", bound.snapshot.cage, bound.snapshot.cage_faces)
    positions.add_layers(mesh, binding.MEMORY)
    obj = settings.posed_cage
    if obj is None or obj.type != "MESH":
        obj = bpy.data.objects.new(mesh.name, mesh)
        obj.display_type, obj.show_in_front, obj.hide_render = "WIRE", True, True
        settings.posed_cage = obj
    else:
        old, obj.data = obj.data, mesh
        mesh.name = old.name
        remove_mesh(old)
    _attach(context, obj, cage, "POSED_CAGE")


def _make_refit_armature(context: bpy.types.Context, cage: bpy.types.Object) -> None:
    settings = cage.cage_rig
    remove_object(settings.refit_armature)
    data = armature.new_refit_armature(f"{cage.name} Refit", settings.armature.data)
    obj = bpy.data.objects.new(data.name, data)
    obj.show_in_front, obj.hide_render = True, True
    settings.refit_armature = obj
    _attach(context, obj, cage, "REFIT_ARMATURE")
    armature.free_bones(obj, context)


def _attach(context: bpy.types.Context, obj: bpy.types.Object, cage: bpy.types.Object, part: str) -> None:
    obj.cage_rig.part, obj.cage_rig.owner = part, cage
    obj.parent = cage.cage_rig.armature
    obj.matrix_parent_inverse.identity()
    obj.matrix_basis.identity()
    if not obj.users_collection:
        collections = cage.users_collection or (context.scene.collection,)
        collections[0].objects.link(obj)


def remove_mesh(mesh: bpy.types.Mesh | None) -> None:
    """Remove a rig's mesh, unless a duplicate of the character has it too."""
    if mesh is not None and mesh.library is None and mesh.users <= 1:
        bpy.data.meshes.remove(mesh)


def remove_object(obj: bpy.types.Object | None) -> None:
    """Remove a rig's object and its data."""
    if obj is None:
        return
    data = obj.data
    bpy.data.objects.remove(obj)
    if data.users == 0:
        bpy.data.batch_remove([data])


def leave(skin: bpy.types.Object, cage: bpy.types.Object) -> None:
    """Take one rig off a skin; the last one gives it back as it was."""
    others = [found for found in modifier.ours(skin) if modifier.cage_of(found) not in (cage, None)]
    if not others:
        stack.release(skin)
        return
    modifier.remove(skin, cage)
    layers.settle(skin)
    for found in others:
        layers.wait(modifier.cage_of(found))
