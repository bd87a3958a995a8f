# SPDX-License-Identifier: GPL-3.0-or-later
"""Characters linked from another file: what a rig writes to has to be of this file.

With library overrides the objects are of this file and their meshes are not, and neither can be edited. The posed cage,
which the rig writes at every update and the artist edits, is replaced by an object of this file at once; the rest cage
gets a mesh of its own when it is first edited. Skins keep the linked mesh.
"""

from __future__ import annotations

import bpy

from .adapters import modifier


def adopt(cage: bpy.types.Object) -> bool:
    """Give an overridden rig a posed cage of this file. Returns whether that was needed."""
    settings = cage.cage_rig
    linked = settings.posed_cage
    if cage.library is not None or linked is None or (linked.library is None and linked.override_library is None):
        return False
    own = bpy.data.objects.new(linked.name, linked.data.copy())
    own.display_type, own.show_in_front = linked.display_type, linked.show_in_front
    own.hide_viewport, own.hide_render = linked.hide_viewport, True
    own.cage_rig.part, own.cage_rig.owner = "POSED_CAGE", cage
    own.parent = settings.armature
    bpy.context.scene.collection.objects.link(own)
    linked.hide_viewport = True
    settings.posed_cage = own
    for skin in settings.skins:
        found = modifier.find(skin.object, cage) if skin.object is not None else None
        if found is not None:
            modifier.set_inputs(found, {"Posed Cage": own})
    return True


def own_mesh(obj: bpy.types.Object) -> bool:
    """Replace the object's linked mesh, with its shape keys and their animation, by a copy of this file's.

    Returns whether that was needed.
    """
    if obj.data.library is None and obj.data.override_library is None:
        return False
    name = obj.data.name
    obj.data = obj.data.copy()
    obj.data.name = name
    return True


def own_posed_mesh(cage: bpy.types.Object) -> None:
    """Give a linked duplicate (Alt D) of a rig a posed cage that no other rig writes to."""
    posed = cage.cage_rig.posed_cage
    if posed is None or posed.type != "MESH" or posed.data.is_editmode or posed.library or posed.override_library:
        return
    if posed.data.users - posed.data.use_fake_user > 1:
        posed.data = posed.data.copy()


def problem(cage: bpy.types.Object) -> str:
    """Why a linked rig can't run, or an empty string."""
    if cage.library is None:
        return ""
    return (
        f"'{cage.name}' is linked from '{cage.library.name}'; make a library override of the character "
        "(Object, Library Override), or append it"
    )
