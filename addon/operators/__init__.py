# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do, one operator a file."""

from __future__ import annotations

import bpy

from .. import samples
from . import waiting
from .add_sample import CAGE_RIG_MT_samples, CAGE_RIG_OT_add_sample
from .apply_refit import CAGE_RIG_OT_apply_refit
from .bake import CAGE_RIG_OT_bake
from .bind import CAGE_RIG_OT_bind
from .cancel_method import CAGE_RIG_OT_cancel_method
from .delete_key import CAGE_RIG_OT_delete_key
from .discard_edit import CAGE_RIG_OT_discard_edit
from .drop_coordinates import CAGE_RIG_OT_drop_coordinates
from .export_coordinates import CAGE_RIG_OT_export_coordinates
from .fit_cage import CAGE_RIG_OT_fit_cage
from .fix_problem import CAGE_RIG_OT_fix_problem
from .generate_cage import CAGE_RIG_OT_generate_cage
from .import_rig import CAGE_RIG_FH_prototype, CAGE_RIG_OT_import_rig
from .jump_to_key import CAGE_RIG_OT_jump_to_key
from .key_cage import CAGE_RIG_OT_key_cage
from .key_envelope import CAGE_RIG_OT_key_envelope
from .load_coordinates import CAGE_RIG_OT_load_coordinates
from .rebind import CAGE_RIG_OT_rebind
from .select_part import CAGE_RIG_OT_select_part
from .unbind import CAGE_RIG_OT_unbind

CLASSES = (
    CAGE_RIG_OT_generate_cage,
    CAGE_RIG_OT_fit_cage,
    CAGE_RIG_OT_bind,
    CAGE_RIG_OT_rebind,
    CAGE_RIG_OT_unbind,
    CAGE_RIG_OT_apply_refit,
    CAGE_RIG_OT_cancel_method,
    CAGE_RIG_OT_bake,
    CAGE_RIG_OT_key_cage,
    CAGE_RIG_OT_key_envelope,
    CAGE_RIG_OT_delete_key,
    CAGE_RIG_OT_discard_edit,
    CAGE_RIG_OT_jump_to_key,
    CAGE_RIG_OT_select_part,
    CAGE_RIG_OT_fix_problem,
    CAGE_RIG_OT_import_rig,
    CAGE_RIG_FH_prototype,
    CAGE_RIG_OT_load_coordinates,
    CAGE_RIG_OT_drop_coordinates,
    CAGE_RIG_OT_export_coordinates,
    CAGE_RIG_OT_add_sample,
    CAGE_RIG_MT_samples,
)


def _samples_menu(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    if context.mode == "OBJECT" and samples.names():
        self.layout.menu(CAGE_RIG_MT_samples.bl_idname, icon="ARMATURE_DATA")


def _object_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator(CAGE_RIG_OT_generate_cage.bl_idname)
    self.layout.operator(CAGE_RIG_OT_fit_cage.bl_idname)
    self.layout.operator(CAGE_RIG_OT_bind.bl_idname)


def _cage_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator(CAGE_RIG_OT_generate_cage.bl_idname, text="Cage of Selected Character", icon="MESH_CUBE")


def _import_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.operator(CAGE_RIG_OT_import_rig.bl_idname, text="Cage Rig Prototype (.skt)")


def _export_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.operator(CAGE_RIG_OT_export_coordinates.bl_idname, text="Cage Rig Coordinates (.npz)")


MENUS = (
    (bpy.types.VIEW3D_MT_add, _samples_menu),
    (bpy.types.VIEW3D_MT_object, _object_menu),
    (bpy.types.VIEW3D_MT_mesh_add, _cage_menu),
    (bpy.types.TOPBAR_MT_file_import, _import_menu),
    (bpy.types.TOPBAR_MT_file_export, _export_menu),
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for menu, draw in MENUS:
        menu.append(draw)


def unregister() -> None:
    waiting.end_all()
    for menu, draw in MENUS:
        menu.remove(draw)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
