# SPDX-License-Identifier: GPL-3.0-or-later
"""Bind, rebind and unbind: everything is read and computed first, and only then is anything written."""

from __future__ import annotations

import uuid
from dataclasses import dataclass, replace

import bpy
import numpy as np
from numpy.typing import NDArray

from . import binding, layers, props, reading, sync
from .adapters import armature, modifier, positions, shape_keys, snapshot, stack
from .reading import BindError
from .session import Known, Session, SessionError, Snapshot

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class _Bound:
    """What a bind has read: the core's snapshot, and what only Blender needs of it."""

    snapshot: Snapshot
    bone_names: list[str]
    skin_to_rig: list[Matrix]
    cage_to_rig: Matrix


def bind(
    context: bpy.types.Context,
    cage: bpy.types.Object,
    armature_object: bpy.types.Object,
    skins: list[bpy.types.Object],
    *,
    known: Known | None = None,
    source: str = "",
) -> None:
    """Bind skins, armature and cage into a rig that is live from now on. Object Mode.

    Where another rig of this armature deforms one of the skins already, the new one stands on it. What is `known`, from
    a `source` that the artist is told, is not computed. Raises `BindError`, with nothing changed, where it can't be.
    """
    _refuse_cage(cage)
    lower = _rig_below(armature_object, skins)
    bound = _read(context, cage, armature_object, skins)
    bound = replace(bound, snapshot=replace(bound.snapshot, known=known or Known()))
    session = _compute(cage, bound)
    settings = cage.cage_rig
    settings.version, settings.armature, settings.input = props.VERSION, armature_object, lower
    settings.coordinates = source
    if lower is not None:
        settings.method = lower.cage_rig.method
    elif all(stack.preserves_volume(obj, armature_object) for obj in skins):
        settings.method = "DQS"
    for obj in skins:
        settings.skins.add().object = obj
    try:
        _install(context, cage, bound, session)
    except Exception:
        unbind(cage)
        raise


def rebind(context: bpy.types.Context, cage: bpy.types.Object) -> str:
    """Take the present meshes, weights and rest bones as the new rest; keep keys and settings. Object Mode.

    Skins that were deleted are forgotten. Coordinates that were loaded stay while the rest shape is what they were
    loaded for; returns a sentence on those that did not. Raises `BindError`, with nothing changed, where it can't be.
    """
    settings = cage.cage_rig
    _refuse_override(cage)
    if settings.armature is None or not settings.armature.users_collection:
        raise BindError(f"The armature of '{cage.name}' was deleted; undo, or Unbind and bind with another")
    if settings.posed_cage is not None and settings.posed_cage.cage_rig.owner != cage:
        raise BindError(f"'{cage.name}' is a copy of another rig's cage; Unbind it, then bind it")
    skins = [skin.object for skin in settings.skins if skin.object is not None and skin.object.users_collection]
    if not skins:
        raise BindError(f"All skins of '{cage.name}' were deleted; undo, or Unbind")
    bound, before = _read(context, cage, settings.armature, skins), settings.coordinates
    fits = bool(before) and _same_rest(cage, bound)
    if fits:
        bound = replace(bound, snapshot=replace(bound.snapshot, known=binding.read(cage).known))
    session = _compute(cage, bound)
    for index in reversed(range(len(settings.skins))):
        if settings.skins[index].object not in skins:
            _remove_mesh(settings.skins[index].snapshot)
            settings.skins.remove(index)
    settings.coordinates = before if fits else ""
    _install(context, cage, bound, session)
    if fits or not before:
        return ""
    return f"The rest shape has changed, so the coordinates of '{before}' were dropped and computed anew"


def use_coordinates(context: bpy.types.Context, cage: bpy.types.Object, known: Known, source: str) -> None:
    """Let the rig use coordinates for its bind that were computed elsewhere (`Known()`: its own), at once.

    `source` is what the artist is told of them. Raises `BindError`, with nothing changed, where it can't.
    """
    settings = cage.cage_rig
    _refuse_override(cage)
    if settings.snapshot is None or any(skin.snapshot is None for skin in settings.skins):
        raise BindError(f"What was bound of '{cage.name}' is lost; press Rebind")
    try:
        session = Session(replace(binding.read(cage), known=known))
    except SessionError as error:
        raise BindError(f"'{cage.name}' can't use these coordinates: {error}") from error
    binding.write_known(cage, known)
    settings.coordinates, settings.bind_id = source, uuid.uuid4().hex
    sync.start(cage, context.evaluated_depsgraph_get(), session)


def _same_rest(cage: bpy.types.Object, bound: _Bound) -> bool:
    """Whether skins, joints and cage rest where they did when the rig was bound."""
    settings, now = cage.cage_rig, bound.snapshot
    if any(skin.snapshot is None for skin in settings.skins) or settings.snapshot is None:
        return False
    then = binding.read(cage)
    pairs = [(then.cage, now.cage), (then.heads, now.heads), (then.parents, now.parents)]
    pairs += [(one.points, other.points) for one, other in zip(then.skins, now.skins, strict=False)]
    same = len(then.skins) == len(now.skins) and [joint.name for joint in settings.joints] == bound.bone_names
    return same and all(np.array_equal(one, other) for one, other in pairs)


def unbind(cage: bpy.types.Object) -> None:
    """Put everything back as it was before the bind and forget the rig. What stood on it stands on what is below.

    Raises `BindError`, with nothing changed, for a rig of another file.
    """
    settings = cage.cage_rig
    _refuse_override(cage)
    sync.drop(cage)
    owned = settings.posed_cage is None or settings.posed_cage.cage_rig.owner == cage
    for upper in [obj for obj in bpy.data.objects if obj.cage_rig.input == cage]:
        upper.cage_rig.input = settings.input
    for skin in settings.skins:
        if owned and skin.object is not None:
            _leave(skin.object, cage)
        if owned:
            _remove_mesh(skin.snapshot)
    if owned:
        stack.restore_suspended(cage)
        _remove_mesh(settings.snapshot)
        for obj in (settings.posed_cage, settings.refit_armature):
            _remove_object(obj)
    cage.property_unset("cage_rig")
    sync.drop(cage)


def apply_refit(context: bpy.types.Context, cage: bpy.types.Object) -> int:
    """Move the armature's rest bones to the refit joints of a still cage; returns how many moved. Object Mode.

    Orientations are kept, so that actions keep their meaning and the motion stays what it is; bones that leave their
    parent's tail are disconnected. The rig stays bound as it was. Raises `BindError` with nothing changed.
    """
    settings = cage.cage_rig
    obj = settings.armature
    if settings.state != "LIVE":
        raise BindError(f"'{cage.name}' is not live: {settings.message}")
    if obj.library or obj.data.library or obj.override_library or obj.data.override_library:
        raise BindError(f"Armature '{obj.name}' is linked from another file, so its rest bones can't be moved")
    upper = [other.name for other in bpy.data.objects if other.cage_rig.input == cage]
    if upper:
        raise BindError(f"'{upper[0]}' stands on '{cage.name}' and moves its joints on; apply the refit of that one")
    animated = next((layer for layer in (cage, *layers.below(cage)) if shape_keys.is_animated(layer)), None)
    if animated is not None:
        raise BindError(
            f"The rest cage '{animated.name}' is animated, so its joints have no one place; "
            "remove its keys, drivers and modifiers, or apply them, and try again"
        )
    rest = armature.read_rest(obj.data)
    heads = dict(zip(rest.names, rest.heads, strict=True))
    joints = sync.refit_joints(cage)
    size = float(np.linalg.norm(np.ptp(joints, axis=0))) + 1e-12
    places = {joint.name: place for joint, place in zip(settings.joints, joints, strict=True)}
    moved = {name: place for name, place in places.items() if np.linalg.norm(place - heads[name]) > 1e-6 * size}
    if not moved:
        return 0
    heads |= moved
    keyed = armature.keyed_location(obj, armature.leaves_parent(obj.data, heads))
    if keyed:
        raise BindError(
            f"Bone '{keyed}' of '{obj.name}' has to be disconnected, which would bring its keyed location to life; "
            "delete its location keys and try again"
        )
    armature.move_heads(obj, context, heads)
    for layer in (cage, *layers.below(cage)):
        for joint in layer.cage_rig.joints:
            joint.shift = heads[joint.name] - np.array(joint.head)
    context.view_layer.update()
    return len(moved)


def summary(cage: bpy.types.Object) -> str:
    """One sentence on what was bound, and what the bind found that the artist should know."""
    settings, report = cage.cage_rig, sync.report(cage)
    if settings.state == "PAUSED":
        return settings.message
    vertices = sum(len(skin.snapshot.vertices) for skin in settings.skins)
    text = (
        f"Bound '{cage.name}' ({len(settings.snapshot.vertices)} vertices) to {len(settings.skins)} skin(s) "
        f"({vertices} vertices) and {len(settings.joints)} bones"
    )
    if settings.input is not None:
        text += f", on top of '{settings.input.name}'"
    missed = report.get("vertices_outside", 0)
    if missed:
        text += f". {missed} skin vertices are outside the cage, which moves them less the farther they are"
    outside = [settings.joints[k].name for k in report.get("joints_outside_hull", [])]
    if outside:
        named = ", ".join(f"'{name}'" for name in outside[:3]) + (" and others" if len(outside) > 3 else "")
        text += f". Outside the cage: {named}"
    return text


def _refuse_cage(obj: bpy.types.Object) -> None:
    settings = obj.cage_rig
    if settings.state != "NONE":
        owner = settings.posed_cage.cage_rig.owner if settings.posed_cage else obj
        if owner not in (None, obj):
            unbind(obj)  # a copy of a bound cage: it may start anew
            return
        raise BindError(f"'{obj.name}' is the cage of a rig already; press Rebind, or Unbind it first")
    if settings.part != "NONE" and settings.owner is not None:
        raise BindError(f"'{obj.name}' belongs to the rig of cage '{settings.owner.name}'; Unbind that first")
    if obj.library is not None or obj.data.library is not None:
        raise BindError(f"'{obj.name}' is linked from another file; make it local first")


def _rig_below(armature_object: bpy.types.Object, skins: list[bpy.types.Object]) -> bpy.types.Object | None:
    """The rig that deforms skins of the selection already, on which a new one would stand."""
    lower: bpy.types.Object | None = None
    for obj in skins:
        settings = obj.cage_rig
        if obj.library is not None:
            raise BindError(f"'{obj.name}' is linked from another file; make a library override or make it local")
        if settings.state != "NONE":
            raise BindError(f"'{obj.name}' is the cage of a rig; Unbind it first, or leave it out of the selection")
        if settings.part == "NONE" or settings.owner is None:
            continue
        if settings.part != "SKIN" or settings.owner.cage_rig.armature != armature_object:
            raise BindError(f"'{obj.name}' belongs to the rig of cage '{settings.owner.name}'; Unbind that first")
        if lower not in (None, settings.owner):
            raise BindError(
                f"The skins belong to the rigs of '{lower.name}' and '{settings.owner.name}'; bind a cage to one only"
            )
        lower = settings.owner
    return lower


def _refuse_override(cage: bpy.types.Object) -> None:
    if cage.library is not None or cage.override_library is not None:
        raise BindError(f"'{cage.name}' was bound in another file; open that one to bind anew, or delete it here")


def _leave(skin: bpy.types.Object, cage: bpy.types.Object) -> None:
    """Take one rig off a skin; the last one gives it back as it was."""
    others = [found for found in modifier.ours(skin) if modifier.read(found, "Rest Cage") not in (cage, None)]
    if not others:
        stack.release(skin)
        return
    modifier.remove(skin, cage)
    layers.settle(skin)


def _read(
    context: bpy.types.Context,
    cage: bpy.types.Object,
    armature_object: bpy.types.Object,
    skins: list[bpy.types.Object],
) -> _Bound:
    found = reading.read(context, armature_object, skins, cage)
    rest, to_rig = found.rest, found.to_rig
    cage_points = positions.apply_matrix(to_rig[-1], positions.read_base(cage.data))
    core = Snapshot(
        found.skins,
        rest.heads.astype(np.float32).astype(np.float64),
        rest.tails.astype(np.float32).astype(np.float64),
        rest.parents,
        cage_points,
        positions.read_faces(cage.data),
        cage.cage_rig.method.lower(),
    )
    return _Bound(core, rest.names, to_rig[:-1], to_rig[-1])


def _compute(cage: bpy.types.Object, bound: _Bound) -> Session:
    """Let the core bind: what it refuses is refused before anything is written."""
    try:
        return Session(bound.snapshot)
    except SessionError as error:
        raise BindError(f"'{cage.name}' can't be bound: {error}") from error


def _install(context: bpy.types.Context, cage: bpy.types.Object, bound: _Bound, session: Session) -> None:
    settings = cage.cage_rig
    sync.drop(cage)
    _write_joints(cage, bound)
    settings.bind_id = uuid.uuid4().hex
    settings.cage_to_rig = bound.cage_to_rig.T.tolist()
    _remove_mesh(settings.snapshot)
    settings.snapshot = snapshot.write(f"{cage.name} Bind", bound.snapshot.cage, bound.snapshot.cage_faces, None)
    _make_posed_cage(context, cage, bound)
    _make_refit_armature(context, cage)
    stack.suspend_armature(cage, settings.armature)
    for index, skin in enumerate(settings.skins):
        part = bound.snapshot.skins[index]
        _remove_mesh(skin.snapshot)
        skin.snapshot = snapshot.write(f"{skin.object.name} Bind", part.points, part.faces, part.weights)
        skin.skin_to_rig = bound.skin_to_rig[index].T.tolist()
        _join(skin.object, cage)
    binding.write_known(cage, bound.snapshot.known)
    settings.state = "PAUSED"  # a rig until the first update makes it live
    sync.start(cage, context.evaluated_depsgraph_get(), session)


def _join(skin: bpy.types.Object, cage: bpy.types.Object) -> None:
    settings = cage.cage_rig
    skin.cage_rig.part = "SKIN"
    ours = modifier.find(skin, cage)
    if ours is None:
        modifier.add(skin, cage, settings.posed_cage, stack.place(skin, settings.armature))
    else:
        modifier.set_inputs(ours, {"Posed Cage": settings.posed_cage})
    layers.settle(skin)
    stack.suspend_armature(skin, settings.armature)


def _write_joints(cage: bpy.types.Object, bound: _Bound) -> None:
    joints = cage.cage_rig.joints
    joints.clear()
    weighted = set(np.concatenate([skin.weights[1] for skin in bound.snapshot.skins]).tolist())
    for k, name in enumerate(bound.bone_names):
        joint = joints.add()
        joint.name, joint.parent = name, int(bound.snapshot.parents[k])
        joint.weighted = k in weighted
        joint.head, joint.tail = bound.snapshot.heads[k], bound.snapshot.tails[k]


def _make_posed_cage(context: bpy.types.Context, cage: bpy.types.Object, bound: _Bound) -> None:
    """The posed cage: a mesh of the cage's faces in rig space, parented to the armature."""
    settings = cage.cage_rig
    mesh = positions.new_mesh(f"{cage.name} Posed", bound.snapshot.cage, bound.snapshot.cage_faces)
    positions.add_layers(mesh, sync.MEMORY)
    obj = settings.posed_cage
    if obj is None:
        obj = bpy.data.objects.new(mesh.name, mesh)
        obj.display_type, obj.show_in_front, obj.hide_render = "WIRE", True, True
        settings.posed_cage = obj
    else:
        old, obj.data = obj.data, mesh
        mesh.name = old.name
        _remove_mesh(old)
    _attach(context, obj, cage, "POSED_CAGE")
    armature.depend_on_bones(obj, settings.armature, bound.bone_names)


def _make_refit_armature(context: bpy.types.Context, cage: bpy.types.Object) -> None:
    settings = cage.cage_rig
    _remove_object(settings.refit_armature)
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


def _remove_mesh(mesh: bpy.types.Mesh | None) -> None:
    """Remove a rig's mesh, unless a duplicate of the character has it too."""
    if mesh is not None and mesh.library is None and mesh.users <= 1:
        bpy.data.meshes.remove(mesh)


def _remove_object(obj: bpy.types.Object | None) -> None:
    if obj is None:
        return
    data = obj.data
    bpy.data.objects.remove(obj)
    if data.users == 0:
        bpy.data.batch_remove([data])
