# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place that knows how Blender 4.2 to 5.2 differ."""

from __future__ import annotations

from typing import Any

import bpy


def set_modifier_input(modifier: bpy.types.NodesModifier, identifier: str, value: Any) -> None:
    """Set a Geometry Nodes input: an ID property up to 5.1, an RNA property from 5.2."""
    inputs = getattr(getattr(modifier, "properties", None), "inputs", None)
    if inputs is not None:
        getattr(inputs, identifier).value = value
    else:
        modifier[identifier] = value


def modifier_input(modifier: bpy.types.NodesModifier, identifier: str) -> Any:
    """Read a Geometry Nodes input; None where it is not set."""
    inputs = getattr(getattr(modifier, "properties", None), "inputs", None)
    if inputs is not None:
        found = getattr(inputs, identifier, None)
        return None if found is None else found.value
    return modifier.get(identifier)


def action_curves(owner: bpy.types.ID) -> list[bpy.types.FCurve]:
    """The curves of the action (and its slot, from 4.4 on) that animates `owner`: `action.fcurves` is gone in 5.0."""
    data = owner.animation_data
    if data is None or data.action is None:
        return []
    if not hasattr(data.action, "slots"):
        return list(data.action.fcurves)
    slot = data.action_slot
    strips = [strip for layer in data.action.layers for strip in layer.strips]
    bags = [strip.channelbag(slot) for strip in strips] if slot is not None else []
    return [curve for bag in bags if bag is not None for curve in bag.fcurves]


def ensure_curves(owner: bpy.types.ID, name: str) -> Any:
    """Where the curves of `owner`'s action are (`.fcurves`, `.groups`); an action `name` is made where there is none.

    A linked action is replaced by a copy of this file's, which can be edited.
    """
    data = owner.animation_data
    if data is None or data.action is None:
        return new_action(owner, name)
    if data.action.library is not None:
        slot_name = data.action_slot.identifier if getattr(data, "action_slot", None) else None
        data.action = data.action.copy()
        if slot_name is not None:
            data.action_slot = data.action.slots[slot_name]
    action = data.action
    if not hasattr(action, "slots"):
        return action
    if data.action_slot is None:
        data.action_slot = action.slots.new(owner.id_type, owner.name)
    layer = action.layers[0] if action.layers else action.layers.new("Layer")
    strip = layer.strips[0] if layer.strips else layer.strips.new(type="KEYFRAME")
    return strip.channelbag(data.action_slot, ensure=True)


def new_curve(container: Any, path: str, group: str) -> bpy.types.FCurve:
    """A new curve for `path` in what `ensure_curves` gave, in a group of channels."""
    curve = container.fcurves.new(path)
    curve.group = container.groups.get(group) or container.groups.new(group)
    return curve


def new_action(owner: bpy.types.ID, name: str) -> Any:
    """Give `owner` a new, empty action; returns where its curves are made: `.fcurves.new(path, index=k)`.

    That is the action itself up to 4.3, and the channelbag of a slot of its own from 4.4 on.
    """
    data = owner.animation_data_create()
    action = bpy.data.actions.new(name)
    data.action = action
    if not hasattr(action, "slots"):
        return action
    slot = action.slots.new(owner.id_type, owner.name)
    data.action_slot = slot
    return action.layers.new("Layer").strips.new(type="KEYFRAME").channelbag(slot, ensure=True)


def call(operator: Any, **options: Any) -> set[str]:
    """Call an operator with those of the options that this Blender's version of it has."""
    known = operator.get_rna_type().properties
    return operator(**{name: value for name, value in options.items() if name in known})


def select_only_bone(obj: bpy.types.Object, name: str) -> None:
    """Select one bone of an armature object and make it active; from 5.0 on pose bones are what is selected."""
    poses = "select" in bpy.types.PoseBone.bl_rna.properties
    for bone in obj.pose.bones:
        (bone if poses else bone.bone).select = bone.name == name
    obj.data.bones.active = obj.data.bones[name]
