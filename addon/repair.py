# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel's button does about a paused rig: the `fix` of its `health.Problem`, as "what:name"."""

from __future__ import annotations

import bpy

from . import lifecycle
from .adapters import stack

LABELS = {
    "rebind": "Rebind",
    "unbind": "Unbind",
    "segments": "Set Segments to 1",
    "move_after": "Move It After Cage Rig",
    "clear_mask": "Clear the Mask",
    "clear_input": "Clear the Input",
    "select": "Select '{name}'",
}


def label(fix: str) -> str:
    """What the button says."""
    what, _, name = fix.partition(":")
    return LABELS[what].format(name=name)


def repair(context: bpy.types.Context, cage: bpy.types.Object) -> None:
    """Do it. Object Mode. Raises `lifecycle.BindError` where that can't be."""
    settings = cage.cage_rig
    what, _, name = settings.fix.partition(":")
    match what:
        case "rebind":
            lifecycle.rebind(context, cage)
        case "unbind":
            lifecycle.unbind(cage)
        case "segments":
            settings.armature.data.bones[name].bbone_segments = 1
        case "move_after":
            stack.move_after(bpy.data.objects[name])
        case "clear_mask":
            next(skin for skin in settings.skins if skin.object and skin.object.name == name).mask = ""
        case "clear_input":
            settings.input = None
        case "select":
            select(context, name)
    cage.update_tag()
    context.view_layer.update()


def select(context: bpy.types.Context, name: str) -> bool:
    """Select this object alone; returns whether it is in the view layer."""
    obj = context.view_layer.objects.get(name)
    if obj is None:
        return False
    for other in context.selected_objects:
        other.select_set(False)
    obj.hide_set(False)
    obj.select_set(True)
    context.view_layer.objects.active = obj
    return True
