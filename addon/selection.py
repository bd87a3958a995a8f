# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist has selected, in the rig's terms."""

from __future__ import annotations

import bpy
from mathutils import Vector

from .lifecycle import BindError
from .props import rig_of


def poll_rig(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll of operators that work on the active object's rig in Object Mode."""
    if context.mode != "OBJECT":
        operator.poll_message_set("Only in Object Mode")
        return False
    if rig_of(context.object) is None:
        operator.poll_message_set("Select the cage, a skin or the armature of a rig")
        return False
    return True


def poll_live(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Poll of operators that work on the active object's live rig, in any mode."""
    cage = rig_of(context.object)
    if cage is None:
        operator.poll_message_set("Select the cage, a skin or the armature of a rig")
        return False
    if cage.cage_rig.state != "LIVE":
        operator.poll_message_set("The rig is paused: " + cage.cage_rig.message)
        return False
    return True


def to_bind(
    context: bpy.types.Context,
) -> tuple[bpy.types.Object, bpy.types.Object, list[bpy.types.Object]]:
    """Cage, armature and skins from the selection. Raises `BindError` with what is missing."""
    selected = context.selected_objects
    armatures = [obj for obj in selected if obj.type == "ARMATURE"]
    meshes = [obj for obj in selected if obj.type == "MESH"]
    if len(armatures) != 1:
        raise BindError(f"Select one armature with the skins and the cage; {len(armatures)} are selected")
    if len(meshes) < 2:
        raise BindError(f"Select the skin meshes and the cage with the armature; {len(meshes)} mesh is selected")
    cage = _cage_among(meshes, context.view_layer.objects.active)
    return cage, armatures[0], [obj for obj in meshes if obj != cage]


def to_generate(
    context: bpy.types.Context,
) -> tuple[bpy.types.Object | None, bpy.types.Object | None, list[bpy.types.Object]]:
    """A generated cage that is to be made anew, or None; the armature, if there is one; the skins. From the selection.

    What the selection lacks is taken from the cage, or from the skins' Armature modifiers. Raises `BindError`.
    """
    selected = context.selected_objects
    meshes = [obj for obj in selected if obj.type == "MESH"]
    cages = [obj for obj in meshes if _is_cage(obj)]
    if len(cages) > 1:
        raise BindError(f"'{cages[0].name}' and '{cages[1].name}' are cages; select one of them")
    cage = next(iter(cages), None)
    skins = [obj for obj in meshes if obj != cage and obj.cage_rig.part != "POSED_CAGE"]
    if not skins and cage is not None:
        skins = _caged_by(cage)
    if not skins:
        raise BindError("Select the skin meshes that the cage is to enclose, and their armature")
    return cage, _armature(selected, skins, cage), skins


def to_fit(
    context: bpy.types.Context,
) -> tuple[bpy.types.Object, bpy.types.Object | None, list[bpy.types.Object]]:
    """A cage whose vertices are to be moved; the armature, if there is one; the skins. From the selection.

    The cage is the one mesh that no bones move, or that was a cage before; of several the active object. Raises
    `BindError` with what is missing.
    """
    selected = context.selected_objects
    meshes = [obj for obj in selected if obj.type == "MESH" and obj.cage_rig.part != "POSED_CAGE"]
    cages = [obj for obj in meshes if _is_cage(obj)]
    armature = _armature(selected, [obj for obj in meshes if obj not in cages], next(iter(cages), None))
    likely = [obj for obj in meshes if obj in cages or not _is_moved(obj, armature)] or meshes
    active = context.view_layer.objects.active
    cage = likely[0] if len(likely) == 1 else next((obj for obj in likely if obj == active), None)
    skins = [obj for obj in meshes if obj != cage] or (_caged_by(cage) if cage is not None else [])
    if cage is None or not skins:
        raise BindError("Select the skin meshes and a rough cage around them, and make the cage the active object")
    other = next((obj for obj in cages if obj != cage), None)
    if other is not None:
        raise BindError(f"'{cage.name}' and '{other.name}' are cages; select one of them")
    return cage, armature, skins


def _is_cage(obj: bpy.types.Object) -> bool:
    return len(obj.cage_rig_generated.skins) > 0 or obj.cage_rig.state != "NONE"


def _caged_by(cage: bpy.types.Object) -> list[bpy.types.Object]:
    """The skins that a generated cage was made for."""
    kept = cage.cage_rig_generated
    return [item.object for item in kept.skins if item.object is not None and item.object.users_collection]


def _armature(
    selected: list[bpy.types.Object], skins: list[bpy.types.Object], cage: bpy.types.Object | None
) -> bpy.types.Object | None:
    """The armature that is selected, else that of the skins' modifiers, else the one that the cage remembers."""
    armatures = [obj for obj in selected if obj.type == "ARMATURE" and obj.cage_rig.part == "NONE"]
    if not armatures:
        armatures = list({mod.object for obj in skins for mod in obj.modifiers if mod.type == "ARMATURE"} - {None})
    if not armatures and cage is not None and cage.cage_rig_generated.armature is not None:
        armatures = [cage.cage_rig_generated.armature]
    if len(armatures) > 1:
        raise BindError(f"Select one armature with the skins; {len(armatures)} are meant")
    return next(iter(armatures), None)


def _is_moved(obj: bpy.types.Object, armature: bpy.types.Object | None) -> bool:
    """Whether a mesh has vertex groups of the armature's bones."""
    return armature is not None and any(group.name in armature.data.bones for group in obj.vertex_groups)


def _cage_among(meshes: list[bpy.types.Object], active: bpy.types.Object | None) -> bpy.types.Object:
    enclosing = [obj for obj in meshes if all(other == obj or _encloses(obj, other) for other in meshes)]
    if len(enclosing) == 1:
        return enclosing[0]
    if active in meshes:
        return active
    raise BindError("No selected mesh encloses the others; make the cage the active object")


def _encloses(outer: bpy.types.Object, inner: bpy.types.Object) -> bool:
    """Whether the box of one object contains that of the other, in world space."""
    low, high = _box(outer)
    inner_low, inner_high = _box(inner)
    return all(low[k] <= inner_low[k] and inner_high[k] <= high[k] for k in range(3))


def _box(obj: bpy.types.Object) -> tuple[Vector, Vector]:
    corners = [obj.matrix_world @ Vector(corner) for corner in obj.bound_box]
    return Vector(map(min, zip(*corners, strict=True))), Vector(map(max, zip(*corners, strict=True)))
