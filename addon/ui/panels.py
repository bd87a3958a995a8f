# SPDX-License-Identifier: GPL-3.0-or-later
"""The "Cage Rig" tab of the 3D View's sidebar."""

from __future__ import annotations

import textwrap

import bpy

from ..props import rig_of

ICONS = {"LIVE": "CHECKMARK", "PAUSED": "PAUSE"}


class VIEW3D_PT_cage_rig(bpy.types.Panel):
    bl_label = "Cage Rig"
    bl_category = "Cage Rig"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        cage = rig_of(context.object)
        if cage is None:
            layout.label(text="Select skins, armature and cage:")
            row = layout.row()
            row.scale_y = 1.4
            row.operator("cage_rig.bind", icon="LINKED")
            return
        _draw_state(layout, cage, context.region.width)
        _draw_settings(layout, cage)
        layout.operator("cage_rig.apply_refit", icon="BONE_DATA")
        row = layout.row(align=True)
        row.operator("cage_rig.rebind", icon="FILE_REFRESH")
        row.operator("cage_rig.unbind", icon="UNLINKED")


def _draw_state(layout: bpy.types.UILayout, cage: bpy.types.Object, width: int) -> None:
    settings = cage.cage_rig
    box = layout.box()
    row = box.row()
    row.alert = settings.state == "PAUSED"
    row.label(text=f"{cage.name}: {settings.state.title()}", icon=ICONS.get(settings.state, "QUESTION"))
    scale = bpy.context.preferences.system.ui_scale
    for line in textwrap.wrap(settings.message, max(20, int((width - 60 * scale) / (7.0 * scale)))):
        box.label(text=line)


def _draw_settings(layout: bpy.types.UILayout, cage: bpy.types.Object) -> None:
    settings = cage.cage_rig
    column = layout.column()
    column.use_property_split = True
    column.use_property_decorate = False
    column.prop(settings, "method")
    column.prop(settings, "influence", slider=True)
    if settings.input is not None:
        column.prop(settings, "input")
    parts = layout.column(align=True)
    _draw_part(parts, cage, "Rest Cage", "MESH_CUBE")
    _draw_part(parts, settings.posed_cage, "Posed Cage", "MOD_MESHDEFORM")
    _draw_part(parts, settings.armature, "Armature", "ARMATURE_DATA")
    _draw_part(parts, settings.refit_armature, "Refit Bones", "BONE_DATA")
    for skin in settings.skins:
        _draw_part(parts, skin.object, "Skin", "OUTLINER_OB_MESH")
        if skin.object is not None:
            parts.prop_search(skin, "mask", skin.object, "vertex_groups", text="")


def _draw_part(layout: bpy.types.UILayout, obj: bpy.types.Object | None, label: str, icon: str) -> None:
    row = layout.row(align=True)
    if obj is None:
        row.alert = True
        row.label(text=f"{label}: deleted", icon=icon)
        return
    row.operator("cage_rig.select_part", text=obj.name, icon=icon).name = obj.name
    row.prop(obj, "hide_viewport", text="", icon_only=True, emboss=True)


CLASSES = (VIEW3D_PT_cage_rig,)
