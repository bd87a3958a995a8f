# SPDX-License-Identifier: GPL-3.0-or-later
"""Add a sample character."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from .. import samples


class CAGE_RIG_OT_add_sample(bpy.types.Operator):
    """Add a character with a cage, an action and cage keys at the 3D cursor, to try Cage Rig with"""

    bl_idname = "cage_rig.add_sample"
    bl_label = "Cage Rig Sample"
    bl_options = {"REGISTER", "UNDO"}

    name: StringProperty(name="Sample", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Only in Object Mode")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            cage = samples.add(context, self.name)
        except samples.SampleError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for obj in context.selected_objects:
            obj.select_set(False)
        cage.select_set(True)
        context.view_layer.objects.active = cage
        return {"FINISHED"}


class CAGE_RIG_MT_samples(bpy.types.Menu):
    """The sample characters of the extension."""

    bl_idname = "CAGE_RIG_MT_samples"
    bl_label = "Cage Rig Sample"

    def draw(self, _context: bpy.types.Context) -> None:
        for name in samples.names():
            self.layout.operator(CAGE_RIG_OT_add_sample.bl_idname, text=name, icon="ARMATURE_DATA").name = name
