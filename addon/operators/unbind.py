# SPDX-License-Identifier: GPL-3.0-or-later
"""Unbind: everything as it was before the bind."""

from __future__ import annotations

import bpy

from .. import lifecycle, props, selection


class CAGE_RIG_OT_unbind(bpy.types.Operator):
    """Take the rig apart: skins, cage and armature are as before the bind; the posed cage and refit bones go"""

    bl_idname = "cage_rig.unbind"
    bl_label = "Unbind"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_rig(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        try:
            lifecycle.unbind(cage)
        except lifecycle.BindError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"'{cage.name}' is an ordinary mesh again")
        return {"FINISHED"}
