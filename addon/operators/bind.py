# SPDX-License-Identifier: GPL-3.0-or-later
"""Bind Cage Rig: from the selected skins, armature and cage."""

from __future__ import annotations

import bpy

from .. import lifecycle, selection
from .waiting import Binds


class CAGE_RIG_OT_bind(Binds, bpy.types.Operator):
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

    def begin(self, context: bpy.types.Context) -> lifecycle.Work:
        return lifecycle.begin_bind(context, *selection.to_bind(context))
