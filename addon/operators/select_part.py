# SPDX-License-Identifier: GPL-3.0-or-later
"""Select a part of the rig by name, from the panel."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty


class CAGE_RIG_OT_select_part(bpy.types.Operator):
    """Select this object alone"""

    bl_idname = "cage_rig.select_part"
    bl_label = "Select"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    name: StringProperty(name="Object", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.mode == "OBJECT"

    def execute(self, context: bpy.types.Context) -> set[str]:
        obj = context.view_layer.objects.get(self.name)
        if obj is None:
            self.report({"WARNING"}, f"'{self.name}' is not in this view layer")
            return {"CANCELLED"}
        for other in context.selected_objects:
            other.select_set(False)
        obj.hide_set(False)
        obj.select_set(True)
        context.view_layer.objects.active = obj
        return {"FINISHED"}
