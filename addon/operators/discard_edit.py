# SPDX-License-Identifier: GPL-3.0-or-later
"""Discard Edit: see `keying`."""

from __future__ import annotations

import bpy

from .. import keying, props, selection


class CAGE_RIG_OT_discard_edit(bpy.types.Operator):
    """Throw away the edit of the cage that is not keyed yet"""

    bl_idname = "cage_rig.discard_edit"
    bl_label = "Discard Edit"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_live(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        try:
            keying.discard_draft(context, cage)
        except keying.KeyingError as error:
            self.report({"WARNING"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}
