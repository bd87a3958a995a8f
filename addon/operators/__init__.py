# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do, one operator a file."""

from __future__ import annotations

import bpy

from .apply_refit import CAGE_RIG_OT_apply_refit
from .bake import CAGE_RIG_OT_bake
from .bind import CAGE_RIG_OT_bind
from .delete_key import CAGE_RIG_OT_delete_key
from .discard_edit import CAGE_RIG_OT_discard_edit
from .jump_to_key import CAGE_RIG_OT_jump_to_key
from .key_cage import CAGE_RIG_OT_key_cage
from .key_envelope import CAGE_RIG_OT_key_envelope
from .rebind import CAGE_RIG_OT_rebind
from .select_part import CAGE_RIG_OT_select_part
from .unbind import CAGE_RIG_OT_unbind

CLASSES = (
    CAGE_RIG_OT_bind,
    CAGE_RIG_OT_rebind,
    CAGE_RIG_OT_unbind,
    CAGE_RIG_OT_apply_refit,
    CAGE_RIG_OT_bake,
    CAGE_RIG_OT_key_cage,
    CAGE_RIG_OT_key_envelope,
    CAGE_RIG_OT_delete_key,
    CAGE_RIG_OT_discard_edit,
    CAGE_RIG_OT_jump_to_key,
    CAGE_RIG_OT_select_part,
)


def _object_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator(CAGE_RIG_OT_bind.bl_idname)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.VIEW3D_MT_object.append(_object_menu)


def unregister() -> None:
    bpy.types.VIEW3D_MT_object.remove(_object_menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
