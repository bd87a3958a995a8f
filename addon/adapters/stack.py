# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifiers on a skin beside ours: the Armature modifier that ours stands in for, and those before and after."""

from __future__ import annotations

import bpy

from . import dependence
from .modifier import is_emptied, ours, read, remove

# Modifiers that touch no vertex.
HARMLESS = {
    "UV_PROJECT", "UV_WARP", "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY", "COLLISION",
    "NORMAL_EDIT", "WEIGHTED_NORMAL", "DATA_TRANSFER",
}  # fmt: skip
# Modifiers that move vertices and never add or remove any: before ours, what they do is a change of the rest skin.
DEFORMING = {
    "ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM", "SHRINKWRAP",
    "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH", "SURFACE_DEFORM", "WARP", "WAVE", "CLOTH",
    "SOFT_BODY", "MESH_CACHE",
}  # fmt: skip
# Modifiers that keep the vertices they are given first and in order.
GROWING = {"ARRAY", "MIRROR", "MULTIRES", "SOLIDIFY", "SUBSURF", "TRIANGULATE"}


def suspend_armature(obj: bpy.types.Object, armature: bpy.types.Object) -> None:
    """Switch off Armature modifiers of `armature`, which would deform twice, and remember how they were."""
    known = suspended_names(obj)
    for modifier in obj.modifiers:
        if modifier.type == "ARMATURE" and modifier.object == armature:
            if modifier.name not in known:
                record = obj.cage_rig.suspended.add()
                record.name, record.uid = modifier.name, modifier.persistent_uid
                record.show_viewport, record.show_render = modifier.show_viewport, modifier.show_render
            modifier.show_viewport = modifier.show_render = False


def unlike_weights(obj: bpy.types.Object, armature: bpy.types.Object) -> str:
    """How the object's shown modifiers of this armature do other than its weights say; empty where they don't."""
    shown = [m for m in obj.modifiers if m.type == "ARMATURE" and m.object == armature]
    shown = [m for m in shown if m.show_viewport or m.show_render]
    if len(shown) > 1:
        return f"modifier '{shown[1].name}' deforms it a second time by the same armature; remove one of them"
    for modifier in shown:
        if modifier.use_bone_envelopes or not modifier.use_vertex_groups:
            return f"modifier '{modifier.name}' uses bone envelopes; let it use vertex groups alone"
        if modifier.vertex_group:
            return f"modifier '{modifier.name}' is masked by vertex group '{modifier.vertex_group}'; clear the mask"
    return ""


def reshaping(obj: bpy.types.Object) -> str:
    """The name of a shown modifier that gives the mesh another shape at rest; empty where there is none."""
    kept = HARMLESS | {"ARMATURE"}
    return next((m.name for m in obj.modifiers if m.show_viewport and m.type not in kept), "")


def preserves_volume(obj: bpy.types.Object, armature: bpy.types.Object) -> bool:
    """Whether the object's modifier of this armature has Preserve Volume on."""
    ours = [m for m in obj.modifiers if m.type == "ARMATURE" and m.object == armature]
    return bool(ours) and all(m.use_deform_preserve_volume for m in ours)


def show_suspended(obj: bpy.types.Object, shown: bool) -> None:
    """While a rig is paused its suspended modifiers do their work again (`shown`), as they were before the bind."""
    for modifier, record in _suspended(obj):
        modifier.show_viewport = shown and record.show_viewport
        modifier.show_render = shown and record.show_render
        _let_rest(modifier, record, not shown)


def let_suspended_rest(objects: list[bpy.types.Object]) -> None:
    """Take bones from suspended modifiers that are hidden, and give them back to those that somebody shows.

    An Armature modifier makes its mesh wait for the bones of its vertex groups even where it is hidden, so that the
    mesh would be evaluated before the bones are read and once more after.
    """
    for obj in objects:
        for modifier, record in _suspended(obj):
            _let_rest(modifier, record, not (modifier.show_viewport or modifier.show_render))


def wake_suspended(objects: list[bpy.types.Object]) -> None:
    """Give suspended modifiers their bones back, however hidden they are."""
    for obj in objects:
        for modifier, record in _suspended(obj):
            _let_rest(modifier, record, False)


def _let_rest(modifier: bpy.types.Modifier, record: bpy.types.PropertyGroup, rest: bool) -> None:
    own = modifier.id_data.library is None and modifier.id_data.override_library is None
    if own and rest and not record.rests and modifier.use_vertex_groups and not modifier.use_bone_envelopes:
        modifier.use_vertex_groups, record.rests = False, True
    elif record.rests and not rest:
        modifier.use_vertex_groups, record.rests = True, False


def _suspended(obj: bpy.types.Object) -> list[tuple[bpy.types.Modifier, bpy.types.PropertyGroup]]:
    """The suspended modifiers that are still there, under whatever names, with how they were."""
    by_uid = {modifier.persistent_uid: modifier for modifier in obj.modifiers}
    records = obj.cage_rig.suspended
    found = [(by_uid.get(record.uid, obj.modifiers.get(record.name)), record) for record in records]
    return [(modifier, record) for modifier, record in found if modifier is not None and modifier.type == "ARMATURE"]


def suspended_names(obj: bpy.types.Object) -> set[str]:
    """The present names of the suspended modifiers."""
    return {modifier.name for modifier, _ in _suspended(obj)}


def shown_suspended(obj: bpy.types.Object) -> list[str]:
    """The present names of suspended modifiers that somebody shows."""
    return [modifier.name for modifier, _ in _suspended(obj) if modifier.show_viewport or modifier.show_render]


def restore_suspended(obj: bpy.types.Object) -> None:
    """Put suspended modifiers back as they were, and forget them."""
    show_suspended(obj, True)
    obj.cage_rig.suspended.clear()


def keep_suspended_off(obj: bpy.types.Object) -> None:
    """Leave suspended modifiers whole and hidden, also when they are put back: their work is in the mesh."""
    for record in obj.cage_rig.suspended:
        record.show_viewport = record.show_render = False
    show_suspended(obj, True)


def place(skin: bpy.types.Object, armature: bpy.types.Object) -> int:
    """Where our modifier is in the skin's stack, or belongs: at the armature's modifier, else before all others."""
    if ours(skin):
        return first(skin)
    for index, modifier in enumerate(skin.modifiers):
        if modifier.type == "ARMATURE" and modifier.object == armature:
            return index
    return 0


def first(skin: bpy.types.Object) -> int:
    """The place of the first of our modifiers in the skin's stack."""
    return list(skin.modifiers).index(ours(skin)[0])


def _shown_before(skin: bpy.types.Object, index: int) -> list[bpy.types.Modifier]:
    shown = [m for m in list(skin.modifiers)[:index] if m.show_viewport or m.show_render]
    return [m for m in shown if m.type not in HARMLESS and not is_emptied(m)]


def blocking(skin: bpy.types.Object, index: int) -> str | None:
    """The name of a shown modifier before `index` that may add or remove vertices, or None."""
    return next((m.name for m in _shown_before(skin, index) if m.type not in DEFORMING), None)


def move_after(skin: bpy.types.Object) -> None:
    """Move modifiers that may add or remove vertices from before ours to right after ours."""
    while True:
        name = blocking(skin, first(skin))
        if name is None:
            return
        skin.modifiers.move(skin.modifiers.find(name), list(skin.modifiers).index(ours(skin)[-1]))


def deformed_before(skin: bpy.types.Object) -> bool:
    """Whether shown modifiers before ours move the skin."""
    return bool(ours(skin)) and bool(_shown_before(skin, first(skin)))


def reads_back(skin: bpy.types.Object) -> bool:
    """Whether something that our modifiers are given has to be read from their result."""
    return deformed_before(skin) or any(read(modifier, "Keep Mask") for modifier in ours(skin))


def reordering(skin: bpy.types.Object) -> str | None:
    """The name of a shown modifier after ours that may reorder vertices, where what ours is given has to be read."""
    if not reads_back(skin):
        return None
    known = HARMLESS | DEFORMING | GROWING
    after = [m for m in list(skin.modifiers)[first(skin) :] if m not in ours(skin)]
    return next((m.name for m in after if (m.show_viewport or m.show_render) and m.type not in known), None)


def release(skin: bpy.types.Object, *, removing: bool = True) -> None:
    """Give a skin back as it was before all binds: our modifiers and feed off, its Armature modifier on again.

    `removing` as in `modifier.remove`.
    """
    remove(skin, None, removing=removing)
    restore_suspended(skin)
    dependence.settle(skin, [])
    skin.property_unset("cage_rig")
