# SPDX-License-Identifier: GPL-3.0-or-later
"""Rebind: the present meshes, weights and rest bones become the new rest."""

from __future__ import annotations

import bpy

from .. import lifecycle, props, selection


class CAGE_RIG_OT_rebind(bpy.types.Operator):
    """Take the present meshes, weights and rest bones as the new rest. The cage's keys and settings stay"""

    bl_idname = "cage_rig.rebind"
    bl_label = "Rebind"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_rig(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        try:
            dropped = lifecycle.rebind(context, cage)
        except lifecycle.BindError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, lifecycle.summary(cage))
        if dropped:
            self.report({"WARNING"}, dropped)
        return {"FINISHED"}
