# SPDX-License-Identifier: GPL-3.0-or-later
"""Select a part of the rig by name, from the panel."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from .. import repair


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
        if not repair.select(context, self.name):
            self.report({"WARNING"}, f"'{self.name}' is not in this view layer")
            return {"CANCELLED"}
        return {"FINISHED"}
