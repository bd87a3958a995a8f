# SPDX-License-Identifier: GPL-3.0-or-later
"""Drop Coordinates: the rig uses its own again."""

from __future__ import annotations

import bpy

from .. import exchange, props, selection


class CAGE_RIG_OT_drop_coordinates(bpy.types.Operator):
    """Forget the coordinates that were loaded, and compute those of the bind"""

    bl_idname = "cage_rig.drop_coordinates"
    bl_label = "Drop Coordinates"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not selection.poll_rig(cls, context):
            return False
        if not props.rig_of(context.object).cage_rig.coordinates:
            cls.poll_message_set("The rig uses coordinates of its own")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        try:
            exchange.drop_coordinates(cage)
        except exchange.FileError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"'{cage.name}' uses coordinates of its own")
        return {"FINISHED"}
