"""Everything that the demo asks of the add-on, through its public operators and settings, as an artist would."""

from __future__ import annotations

from collections.abc import Callable

import bmesh
import bpy
import numpy as np

from blend_fixtures.build import RigObjects

from .figures import Array


def bind(rig: RigObjects) -> None:
    """Select skins, armature and cage, and bind them. Raises RuntimeError with the add-on's message if it refuses."""
    bpy.ops.object.select_all(action="DESELECT")
    for part in rig.all:
        part.select_set(True)
    bpy.context.view_layer.objects.active = rig.cage
    bpy.ops.cage_rig.bind()
    bpy.ops.object.select_all(action="DESELECT")
    require_live(rig)


def require_live(rig: RigObjects) -> None:
    """Raise RuntimeError, with what the panel says, unless the rig is live."""
    settings = rig.cage.cage_rig
    if settings.state != "LIVE":
        raise RuntimeError(f"the rig of '{rig.cage.name}' is not live: {settings.message or settings.state}")


def posed_cage(rig: RigObjects) -> bpy.types.Object:
    """The posed cage object that binding made."""
    return rig.cage.cage_rig.posed_cage


def refit_armature(rig: RigObjects) -> bpy.types.Object:
    """The refit bones that binding made."""
    return rig.cage.cage_rig.refit_armature


def methods(rig: RigObjects) -> list[tuple[str, str]]:
    """Identifier and name of each skinning method, in the panel's order."""
    items = rig.cage.cage_rig.bl_rna.properties["method"].enum_items
    return [(item.identifier, item.name) for item in items]


def use_method(rig: RigObjects, identifier: str) -> None:
    """Choose the skinning method; the skins follow in the same update."""
    rig.cage.cage_rig.method = identifier
    bpy.context.view_layer.update()


def edit_posed_cage(rig: RigObjects, change: Callable[[Array], Array]) -> None:
    """Move the posed cage's vertices (#C by 3, its own space) in Edit Mode; the rest cage and the skins follow."""
    cage = posed_cage(rig)
    cage.hide_set(False)
    bpy.context.view_layer.objects.active = cage
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(cage.data)
    points = np.array([vertex.co for vertex in edited.verts])
    for vertex, place in zip(edited.verts, change(points).tolist(), strict=True):
        vertex.co = place
    bmesh.update_edit_mesh(cage.data)
    bpy.context.view_layer.update()
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = None
    require_live(rig)


def is_available() -> bool:
    """Whether the add-on is enabled in this Blender."""
    return hasattr(bpy.types.Object, "cage_rig")
