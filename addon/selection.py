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
    cages = [obj for obj in meshes if len(obj.cage_rig_generated.skins) or obj.cage_rig.state != "NONE"]
    if len(cages) > 1:
        raise BindError(f"'{cages[0].name}' and '{cages[1].name}' are cages; select one of them")
    cage = next(iter(cages), None)
    kept = cage.cage_rig_generated if cage is not None else None
    skins = [obj for obj in meshes if obj != cage and obj.cage_rig.part != "POSED_CAGE"]
    if not skins and kept is not None:
        skins = [item.object for item in kept.skins if item.object is not None and item.object.users_collection]
    if not skins:
        raise BindError("Select the skin meshes that the cage is to enclose, and their armature")
    armatures = [obj for obj in selected if obj.type == "ARMATURE" and obj.cage_rig.part == "NONE"]
    if not armatures:
        armatures = list({mod.object for obj in skins for mod in obj.modifiers if mod.type == "ARMATURE"} - {None})
    if not armatures and kept is not None and kept.armature is not None:
        armatures = [kept.armature]
    if len(armatures) > 1:
        raise BindError(f"Select one armature with the skins; {len(armatures)} are meant")
    return cage, next(iter(armatures), None), skins


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
