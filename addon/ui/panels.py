# SPDX-License-Identifier: GPL-3.0-or-later
"""The "Cage Rig" tab of the 3D View's sidebar, and the same in the object properties of the rest cage."""

from __future__ import annotations

import textwrap

import bpy

from .. import choosing, keying, repair
from ..caging import current
from ..props import METHODS, rig_of

ICONS = {"LIVE": "CHECKMARK", "PAUSED": "PAUSE"}


class _InSidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Cage Rig"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return rig_of(context.object) is not None


class _InProperties:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.cage_rig.state != "NONE"


class _Main:
    bl_label = "Cage Rig"

    def draw(self, context: bpy.types.Context) -> None:
        cage = rig_of(context.object)
        if current.shown() is not None:
            _draw_caging(self.layout, current.shown())
            return
        if cage is None:
            self.layout.label(text="Select skins and armature:")
            self.layout.operator("cage_rig.generate_cage", icon="MOD_LATTICE", text=_caging_label(context.object))
            self.layout.separator()
            self.layout.label(text="Select skins, armature and cage:")
            self.layout.operator("cage_rig.fit_cage", icon="MOD_SHRINKWRAP")
            row = self.layout.row()
            row.scale_y = 1.4
            row.operator("cage_rig.bind", icon="LINKED")
            return
        _draw_state(self.layout, cage, context.region.width)
        if cage.cage_rig.state == "LIVE":
            _draw_keys(self.layout, cage, context.scene.frame_current_final)
        _draw_settings(self.layout, cage)


class _Parts:
    bl_label = "Show"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings = rig_of(context.object).cage_rig
        column = self.layout.column(align=True)
        _draw_part(column, rig_of(context.object), "Rest Cage", "MESH_CUBE")
        _draw_part(column, settings.posed_cage, "Posed Cage", "MOD_MESHDEFORM")
        _draw_part(column, settings.armature, "Armature", "ARMATURE_DATA")
        _draw_part(column, settings.refit_armature, "Refit Bones", "BONE_DATA")


class _Skins:
    bl_label = "Skins"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings = rig_of(context.object).cage_rig
        for skin in settings.skins:
            column = self.layout.column(align=True)
            _draw_part(column, skin.object, "Skin", "OUTLINER_OB_MESH")
            if skin.object is not None:
                column.prop_search(skin, "mask", skin.object, "vertex_groups", text="", icon="MOD_MASK")
        if settings.input is not None:
            self.layout.prop(settings, "input", text="On Top Of")


class _Overlays:
    bl_label = "Overlays"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        overlays = context.workspace.cage_rig_overlays
        column = self.layout.column(align=True)
        _draw_text(column, overlays.message, context.region.width)
        for name, options in (
            ("weights", ("weights_opacity",)),
            ("joint_weights", ()),
            ("joints", ("joints_in_front",)),
            ("anchors", ()),
            ("fade", ("fade_radius", "fade_minimum")),
        ):
            column.prop(overlays, name)
            if getattr(overlays, name):
                for option in options:
                    row = column.row()
                    row.separator(factor=2.0)
                    row.prop(overlays, option)


class _Bake:
    bl_label = "Bake"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, _context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        for target, text, icon in (
            ("MESH_CACHE", "Mesh Cache", "FILE_CACHE"),
            ("ALEMBIC", "Alembic", "FILE_3D"),
            ("USD", "USD", "FILE_3D"),
            ("SHAPE_KEYS", "Shape Keys", "SHAPEKEY_DATA"),
            ("NATIVE_RIG", "Native Rig", "ARMATURE_DATA"),
        ):
            column.operator("cage_rig.bake", text=text, icon=icon).target = target


class _Rig:
    bl_label = "Rig"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.operator("cage_rig.apply_refit", icon="BONE_DATA")
        column.operator("cage_rig.rebind", icon="FILE_REFRESH")
        column.operator("cage_rig.unbind", icon="UNLINKED")
        column.separator()
        settings = rig_of(context.object).cage_rig
        column.prop(settings, "half_weights")
        column.separator()
        loaded = settings.coordinates
        column.label(text=f"Coordinates: {loaded or 'Mean Value'}")
        row = column.row(align=True)
        row.operator("cage_rig.load_coordinates", text="Load")
        row.operator("cage_rig.export_coordinates", text="Export")
        if loaded:
            row.operator("cage_rig.drop_coordinates", text="", icon="X")


def _caging_label(obj: bpy.types.Object | None) -> str:
    made = obj is not None and len(obj.cage_rig_generated.skins) > 0
    return "Edit Generated Cage" if made else "Generate Cage"


def _draw_caging(layout: bpy.types.UILayout, shown: current.Shown) -> None:
    """While bending nodes are edited, and while the cage is computed."""
    layout.label(text=shown.working or "Click on bones to add nodes", icon="INFO")
    row = layout.row()
    row.scale_y = 1.4
    row.enabled = not shown.working
    row.operator("cage_rig.generate_cage", icon="CHECKMARK", text="Generate")


def _draw_state(layout: bpy.types.UILayout, cage: bpy.types.Object, width: int) -> None:
    settings = cage.cage_rig
    box = layout.box().column(align=True)
    row = box.row()
    row.alert = settings.state == "PAUSED"
    row.label(text=f"{cage.name}: {settings.state.title()}", icon=ICONS.get(settings.state, "QUESTION"))
    _draw_text(box, settings.message, width)
    if settings.fix:
        box.separator()
        fix = "rebind" if settings.fix == "rebind" else "fix_problem"  # a rebind may take long
        box.operator(f"cage_rig.{fix}", text=repair.label(settings.fix), icon="TOOL_SETTINGS")


def _draw_text(layout: bpy.types.UILayout, text: str, width: int) -> None:
    """A sentence over as many lines as it needs; labels do not wrap."""
    scale = bpy.context.preferences.system.ui_scale
    for line in textwrap.wrap(text, max(20, int((width - 60 * scale) / (6.6 * scale)))) if text else ():
        layout.label(text=line)


def _draw_keys(layout: bpy.types.UILayout, cage: bpy.types.Object, frame: float) -> None:
    column = layout.column(align=True)
    row = column.row(align=True)
    row.scale_y = 1.3
    row.operator("cage_rig.jump_to_key", text="", icon="PREV_KEYFRAME").forward = False
    keyed = any(abs(key - frame) < 1e-3 for key in keying.frames(cage))
    row.operator("cage_rig.key_cage", icon="DECORATE_KEYFRAME" if keyed else "DECORATE_ANIMATE")
    row.operator("cage_rig.jump_to_key", text="", icon="NEXT_KEYFRAME").forward = True
    row = column.row(align=True)
    row.operator("cage_rig.key_envelope")
    row.operator("cage_rig.delete_key", text="Delete Key")
    if keying.has_draft(cage):
        row = column.row(align=True)
        row.alert = True
        row.label(text="This edit is not keyed")
        row.operator("cage_rig.discard_edit", text="Discard")


def _draw_settings(layout: bpy.types.UILayout, cage: bpy.types.Object) -> None:
    settings = cage.cage_rig
    column = layout.column()
    column.use_property_split = True
    column.use_property_decorate = False
    _draw_method(column, cage)
    row = column.row(align=True)
    row.use_property_decorate = True
    row.prop(settings, "influence", slider=True)


def _draw_method(layout: bpy.types.UILayout, cage: bpy.types.Object) -> None:
    """The method; in its place, while it is being prepared, how far that is. The rows below stay where they are."""
    found = choosing.progress(cage)
    if found is None:
        layout.prop(cage.cage_rig, "method")
        return
    share, before = found
    label = next(label for name, label, *_ in METHODS if name == before)
    row = layout.row(align=True)
    row.progress(factor=share, text=f"Computing, {share:.0%}; still {label}")
    row.operator("cage_rig.cancel_method", text="", icon="X")


def _draw_part(layout: bpy.types.UILayout, obj: bpy.types.Object | None, label: str, icon: str) -> None:
    row = layout.row(align=True)
    if obj is None:
        row.alert = True
        row.label(text=f"{label}: deleted", icon=icon)
        return
    row.operator("cage_rig.select_part", text=obj.name, icon=icon).name = obj.name
    row.prop(obj, "hide_viewport", text="", icon_only=True, emboss=True)


def _panels(place: type, prefix: str) -> list[type]:
    """The main panel and its sub-panels in one place of the window."""
    main = type(f"{prefix}_PT_cage_rig", (_Main, place, bpy.types.Panel), {"bl_idname": f"{prefix}_PT_cage_rig"})
    if place is _InSidebar:
        main.poll = classmethod(lambda cls, context: True)
    found = [main]
    for part in (_Parts, _Overlays, _Skins, _Bake, _Rig):
        name = f"{prefix}_PT_cage_rig_{part.__name__.strip('_').lower()}"
        found.append(type(name, (part, place, bpy.types.Panel), {"bl_idname": name, "bl_parent_id": main.bl_idname}))
    return found


CLASSES = (*_panels(_InSidebar, "VIEW3D"), *_panels(_InProperties, "OBJECT"))
