# SPDX-License-Identifier: GPL-3.0-or-later
"""Apply Refit: the refit joints become the armature's own rest joints."""

from __future__ import annotations

import bpy

from .. import lifecycle, props, selection


class CAGE_RIG_OT_apply_refit(bpy.types.Operator):
    """Move the armature's rest bones to the joints that the edited cage gives them. Actions keep their meaning"""

    bl_idname = "cage_rig.apply_refit"
    bl_label = "Apply Refit"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_rig(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        try:
            moved = lifecycle.apply_refit(context, cage)
        except lifecycle.BindError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{moved} bones of '{cage.cage_rig.armature.name}' moved to their refit joints")
        return {"FINISHED"}
