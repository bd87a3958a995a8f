# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake: what the rig shows, as files or objects that need no add-on."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from .. import bake, props, selection
from ..bake import mesh_cache, native_rig, scenes, shape_keys
from . import waiting

# Numbers never move: they are what keymaps and presets store.
TARGETS = [
    ("MESH_CACHE", "Mesh Cache", "Point caches (PC2), one a skin, for Blender's Mesh Cache modifier and others", 0),
    ("ALEMBIC", "Alembic", "The skins as they are seen, by Blender's exporter, which can't be cancelled on its way", 1),
    ("USD", "USD", "The skins as they are seen, by Blender's exporter, which can't be cancelled on its way", 2),
    ("SHAPE_KEYS", "Shape Keys", "Copies of the skins with a shape key every frame, which FBX and glTF can hold", 3),
    ("NATIVE_RIG", "Native Rig", "Copies of skins and armature that play alike by Blender's Armature modifier", 4),
]
SUFFIXES = {"MESH_CACHE": mesh_cache.SUFFIXES, "ALEMBIC": scenes.ALEMBIC, "USD": scenes.USD}
SETTINGS = {
    "MESH_CACHE": ("samples", "make_result"),
    "ALEMBIC": ("samples", "subdivide", "make_result"),
    "USD": ("subdivide", "make_result"),
    "SHAPE_KEYS": ("step",),
    "NATIVE_RIG": ("samples", "keep_action"),
}


class CAGE_RIG_OT_bake(bpy.types.Operator):
    """Bake what the rig shows over a frame range to what plays without the add-on. The rig stays as it is"""

    bl_idname = "cage_rig.bake"
    bl_label = "Bake"
    bl_options = {"UNDO"}

    target: EnumProperty(items=TARGETS, name="Bake to", default="MESH_CACHE")
    frame_start: IntProperty(
        name="Start", description="First frame; the scene's where it is not set", options={"SKIP_SAVE"}
    )
    frame_end: IntProperty(name="End", description="Last frame; the scene's where it is not set", options={"SKIP_SAVE"})
    samples: IntProperty(name="Samples", description="How many times a frame, evenly spaced", default=1, min=1, max=100)
    step: IntProperty(name="Step", description="Frames from one shape key to the next", default=1, min=1)
    subdivide: BoolProperty(
        name="Subdivide", description="Write what a Subdivision Surface modifier makes, and not its control mesh"
    )
    keep_action: BoolProperty(
        name="Keep Action",
        description="Let the new armature play the old one's action instead of new keys. For bones without constraints",
    )
    make_result: BoolProperty(
        name="Make Objects",
        description="Also make objects that play the file. Where it is not set: for a Mesh Cache, which has no faces",
        options={"SKIP_SAVE"},
    )
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    check_existing: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_glob: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    by_hand = False  # from a menu or a button, not by a script: then the window goes on meanwhile
    _steps: bake.Steps[Any] | None = None
    _wait: waiting.Wait | None = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return selection.poll_rig(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        self._fill_in(context)
        self.by_hand = True
        if self.target not in SUFFIXES:
            name = next(name for target, name, *_ in TARGETS if target == self.target)
            return context.window_manager.invoke_props_dialog(self, title=f"Bake to {name}", confirm_text="Bake")
        name = bpy.path.clean_name(props.rig_of(context.object).name)
        self.filepath = self.filepath or bpy.path.abspath(f"//{name}{SUFFIXES[self.target][0]}")
        self.filter_glob = ";".join(f"*{suffix}" for suffix in SUFFIXES[self.target])
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        for name in ("frame_start", "frame_end", *SETTINGS[self.target]):
            layout.prop(self, name)

    def execute(self, context: bpy.types.Context) -> set[str]:
        self._fill_in(context)
        steps = self._new_steps(props.rig_of(context.object))
        manager = context.window_manager
        if self.by_hand and not bpy.app.background:
            self._steps = steps
            self._wait = waiting.Wait(context, "Baking", steps.close, interval=0.01)
            self._tell(0.0)
            manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        manager.progress_begin(0.0, 100.0)
        try:
            made = bake.run(steps, lambda share: manager.progress_update(100.0 * share))
        except bake.BakeError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            manager.progress_end()
        self.report({"INFO"}, made.summary)
        return {"FINISHED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if waiting.wants_out(event):
            self.cancel(context)
            self.report({"INFO"}, "Bake cancelled; nothing of it is left")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}  # nothing else may change what is baked
        try:
            self._tell(next(self._steps))
        except StopIteration as end:
            self.cancel(context)
            self.report({"INFO"}, end.value.summary)
            return {"FINISHED"}
        except bake.BakeError as error:
            self.cancel(context)
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except BaseException:
            self.cancel(context)
            raise
        return {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Take back what is not finished, and give the window back. Blender calls it too when it closes."""
        if self._wait is not None:
            self._wait.give_up()

    def _fill_in(self, context: bpy.types.Context) -> None:
        """Defaults that depend on the scene and on the target."""
        given = self.properties.is_property_set
        for name in ("frame_start", "frame_end"):
            if not given(name):
                setattr(self, name, getattr(context.scene, name))
        if not given("make_result"):
            self.make_result = self.target == "MESH_CACHE"

    def _new_steps(self, cage: bpy.types.Object) -> bake.Steps[Any]:
        frames, path = (self.frame_start, self.frame_end), self.filepath
        files = {"subdivide": self.subdivide, "result": self.make_result}
        match self.target:
            case "MESH_CACHE":
                return mesh_cache.steps(cage, path, *frames, samples=self.samples, result=self.make_result)
            case "ALEMBIC":
                return scenes.alembic_steps(cage, path, *frames, samples=self.samples, **files)
            case "USD":
                return scenes.usd_steps(cage, path, *frames, **files)
            case "SHAPE_KEYS":
                return shape_keys.steps(cage, *frames, step=self.step)
            case _:
                return native_rig.steps(cage, *frames, samples=self.samples, keep_action=self.keep_action)

    def _tell(self, share: float) -> None:
        exporting = self.target in ("ALEMBIC", "USD")
        stage = "Blender's exporter is at work, which can't be cancelled" if exporting else ""
        self._wait.tell(share, stage, way_out=not exporting)
