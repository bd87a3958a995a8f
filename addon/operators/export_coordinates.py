# SPDX-License-Identifier: GPL-3.0-or-later
"""Export Coordinates: those that the rig uses, for other programs."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, StringProperty

from .. import exchange, props, selection


class CAGE_RIG_OT_export_coordinates(bpy.types.Operator):
    """Write the rig's coordinates and anchors: an .npz with its rest shape, or the prototype's text (.txt)"""

    bl_idname = "cage_rig.export_coordinates"
    bl_label = "Export Coordinates"

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    check_existing: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_glob: StringProperty(default="*.npz;*.txt", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_rig(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        name = bpy.path.clean_name(props.rig_of(context.object).name)
        self.filepath = self.filepath or bpy.path.abspath(f"//{name}.npz")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            paths = exchange.export_coordinates(props.rig_of(context.object), self.filepath)
        except exchange.FileError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, "Written: " + ", ".join(f"'{path}'" for path in paths))
        return {"FINISHED"}
