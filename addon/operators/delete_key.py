# SPDX-License-Identifier: GPL-3.0-or-later
"""Delete Cage Key: see `keying`."""

from __future__ import annotations

import bpy

from .. import keying, props, selection


class CAGE_RIG_OT_delete_key(bpy.types.Operator):
    """Delete the key of the rest cage at this frame"""

    bl_idname = "cage_rig.delete_key"
    bl_label = "Delete Cage Key"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_live(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        try:
            frame = keying.delete(context, cage)
        except keying.KeyingError as error:
            self.report({"WARNING"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Deleted the key of '{cage.name}' at frame {frame:g}")
        return {"FINISHED"}
