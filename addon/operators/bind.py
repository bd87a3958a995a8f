# SPDX-License-Identifier: GPL-3.0-or-later
"""Bind Cage Rig: from the selected skins, armature and cage."""

from __future__ import annotations

import bpy

from .. import lifecycle, selection


class CAGE_RIG_OT_bind(bpy.types.Operator):
    """Couple the selected skin meshes, armature and cage. The cage is the mesh that encloses the others, or the active one"""  # noqa: E501

    bl_idname = "cage_rig.bind"
    bl_label = "Bind Cage Rig"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Bind in Object Mode")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            cage, armature, skins = selection.to_bind(context)
            lifecycle.bind(context, cage, armature, skins)
        except lifecycle.BindError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, lifecycle.summary(cage))
        return {"FINISHED"}
