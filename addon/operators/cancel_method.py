# SPDX-License-Identifier: GPL-3.0-or-later
"""Cancel a change of method that is still being prepared."""

from __future__ import annotations

import bpy

from .. import choosing, props, selection


class CAGE_RIG_OT_cancel_method(bpy.types.Operator):
    """Prepare the chosen method no further; the rig's method is again the one that it has"""

    bl_idname = "cage_rig.cancel_method"
    bl_label = "Cancel"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_live(cls, context) and choosing.progress(props.rig_of(context.object)) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        choosing.cancel(props.rig_of(context.object))
        return {"FINISHED"}
