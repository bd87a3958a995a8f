# SPDX-License-Identifier: GPL-3.0-or-later
"""Fix: what the panel offers about a paused rig."""

from __future__ import annotations

import bpy

from .. import lifecycle, props, repair, selection


class CAGE_RIG_OT_fix_problem(bpy.types.Operator):
    """Do what the message says, so that the rig runs again"""

    bl_idname = "cage_rig.fix_problem"
    bl_label = "Fix"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not selection.poll_rig(cls, context):
            return False
        if not props.rig_of(context.object).cage_rig.fix:
            cls.poll_message_set("There is nothing that a button can fix")
            return False
        return True

    @classmethod
    def description(cls, context: bpy.types.Context, _properties: bpy.types.OperatorProperties) -> str:
        cage = props.rig_of(context.object)
        return cage.cage_rig.message if cage is not None else cls.__doc__

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            repair.repair(context, props.rig_of(context.object))
        except lifecycle.BindError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}
