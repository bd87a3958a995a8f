# SPDX-License-Identifier: GPL-3.0-or-later
"""Rebind: the present meshes, weights and rest bones become the new rest."""

from __future__ import annotations

import bpy

from .. import lifecycle, props, selection
from .waiting import Binds


class CAGE_RIG_OT_rebind(Binds, bpy.types.Operator):
    """Take the present meshes, weights and rest bones as the new rest. The cage's keys and settings stay"""

    bl_idname = "cage_rig.rebind"
    bl_label = "Rebind"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_rig(cls, context)

    def begin(self, context: bpy.types.Context) -> lifecycle.Work:
        return lifecycle.begin_rebind(context, props.rig_of(context.object))
