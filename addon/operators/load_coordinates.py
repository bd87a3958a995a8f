# SPDX-License-Identifier: GPL-3.0-or-later
"""Load Coordinates: those that were computed elsewhere."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from .. import exchange, props, selection


class CAGE_RIG_OT_load_coordinates(bpy.types.Operator):
    """Let the rig use coordinates of a file: an .npz, or the prototype's text. They are kept with the .blend"""

    bl_idname = "cage_rig.load_coordinates"
    bl_label = "Load Coordinates"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.npz;*.txt", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_rig(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        cage = props.rig_of(context.object)
        try:
            loaded = exchange.load_coordinates(cage, self.filepath)
        except exchange.FileError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"'{cage.name}' uses {', '.join(loaded.names)} of '{cage.cage_rig.coordinates}'")
        return {"FINISHED"}
