# SPDX-License-Identifier: GPL-3.0-or-later
"""Import: a rig of [CTL*20]'s prototype, from its text files."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from .. import exchange

# Numbers never move: they are what presets store.
AXES = [
    ("Y", "Y", "Y is up in the files, as in the prototype's examples", 0),
    ("Z", "Z", "Z is up in the files, as in Blender", 1),
]
FILES = ("mesh", "weights", "cage", "skeleton_motion", "cage_motion", "anchors", "coordinates", "centers")
SETTINGS = ("up", "scale", "frame_start", "every_frame", "keep_steps", "set_frame_range", "bind", "use_coordinates")


def _file(name: str, ending: str) -> StringProperty:
    return StringProperty(
        name=name, description=f"Empty: the file '{ending}' beside", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )


class CAGE_RIG_OT_import_rig(bpy.types.Operator):
    """Import a rig of the text files of the Cage Rig prototype: skin, skeleton, cage, weights and animations"""

    bl_idname = "cage_rig.import_rig"
    bl_label = "Import Cage Rig Prototype"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.skt", options={"HIDDEN"})
    mesh: _file("Skin", "X.obj")
    weights: _file("Weights", "X.skw")
    cage: _file("Cage", "X_cage.obj")
    skeleton_motion: _file("Skeleton Animation", "X_skelAnim.txt")
    cage_motion: _file("Cage Animation", "X_cageAnim.txt")
    anchors: _file("Anchors", "X_cage.maxvol")
    coordinates: _file("Coordinates", "X_cage_cageWeights.txt")
    centers: _file("Centers of Rotation", "X_corWeights.txt")
    up: EnumProperty(items=AXES, name="Up", description="Which axis of the files is up", default="Y")
    scale: FloatProperty(
        name="Scale", description="Scale of the armature object", default=1.0, min=1e-6, soft_max=100.0
    )
    frame_start: IntProperty(name="First Frame", description="Where the animations begin", default=1)
    every_frame: BoolProperty(
        name="Key Every Frame",
        description="Key the bones on every frame, which plays as the prototype does. "
        "Off: only at the file's own keys, which are easier to edit",
        default=True,
    )
    keep_steps: BoolProperty(
        name="Keep Joint Distances",
        description="Take every joint's place from the animation. Off: only the roots', and the others stay on their "
        "fathers as they rest, as in the prototype",
    )
    set_frame_range: BoolProperty(name="Set Frame Range", description="That of the animations", default=True)
    bind: BoolProperty(name="Bind", description="Bind the rig, so that it is live", default=True)
    use_coordinates: BoolProperty(
        name="Use Coordinates",
        description="Bind with the coordinates, anchors and centers of rotation of the files, where there are any",
        default=True,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Import in Object Mode")
            return False
        return True

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        if self.filepath:  # dropped into the window
            return context.window_manager.invoke_props_dialog(self)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in SETTINGS:
            layout.prop(self, name)
        layout.separator()
        for name in FILES:
            layout.prop(self, name)

    def execute(self, context: bpy.types.Context) -> set[str]:
        options = exchange.Options(**{name: getattr(self, name) for name in SETTINGS})
        try:
            rig = exchange.import_rig(self.filepath, options, **{name: getattr(self, name) for name in FILES})
        except exchange.FileError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, rig.summary)
        return {"FINISHED"}


class CAGE_RIG_FH_prototype(bpy.types.FileHandler):
    """Lets a prototype's .skt be dropped into the 3D View."""

    bl_idname = "CAGE_RIG_FH_prototype"
    bl_label = "Cage Rig Prototype"
    bl_import_operator = CAGE_RIG_OT_import_rig.bl_idname
    bl_file_extensions = ".skt"

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"
