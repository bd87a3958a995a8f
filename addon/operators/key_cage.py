# SPDX-License-Identifier: GPL-3.0-or-later
"""Key Cage: see `keying`."""

from __future__ import annotations

import bpy

from .. import keying, props, selection


class CAGE_RIG_OT_key_cage(bpy.types.Operator):
    """Key the rest cage as it is now at this frame, beside any action. Between keys its vertices move linearly"""

    bl_idname = "cage_rig.key_cage"
    bl_label = "Key Cage"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_live(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        frame = keying.key(context, cage)
        self.report({"INFO"}, f"Keyed '{cage.name}' at frame {frame:g}")
        return {"FINISHED"}
