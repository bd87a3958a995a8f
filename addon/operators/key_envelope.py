# SPDX-License-Identifier: GPL-3.0-or-later
"""Key Envelope: see `keying`."""

from __future__ import annotations

import bpy

from .. import keying, props, selection


class CAGE_RIG_OT_key_envelope(bpy.types.Operator):
    """Key the un-edited cage, as it was bound, at this frame"""

    bl_idname = "cage_rig.key_envelope"
    bl_label = "Key Envelope"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_live(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        frame = keying.key_envelope(context, cage)
        self.report({"INFO"}, f"Keyed the un-edited '{cage.name}' at frame {frame:g}")
        return {"FINISHED"}
