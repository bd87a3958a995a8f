# SPDX-License-Identifier: GPL-3.0-or-later
"""Jump to Cage Key: to the next or previous one in time."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty

from .. import keying, props, selection


class CAGE_RIG_OT_jump_to_key(bpy.types.Operator):
    """Go to the next or previous key of the rest cage"""

    bl_idname = "cage_rig.jump_to_key"
    bl_label = "Jump to Cage Key"
    bl_options = {"REGISTER", "UNDO"}

    forward: BoolProperty(name="Next", description="To the next key, else to the previous one", default=True)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_live(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        frame = keying.neighbour(cage, context.scene.frame_current_final, forward=self.forward)
        if frame is None:
            self.report({"INFO"}, f"No {'later' if self.forward else 'earlier'} key of '{cage.name}'")
            return {"CANCELLED"}
        context.scene.frame_set(int(frame // 1), subframe=frame % 1)
        return {"FINISHED"}
