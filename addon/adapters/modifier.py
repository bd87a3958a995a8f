# SPDX-License-Identifier: GPL-3.0-or-later
"""The "Cage Rig" Geometry Nodes modifier on a skin, its feed, and the modifiers it stands in for.

The feed is a FLOAT_VECTOR point attribute that the modifier's Set Position reads: base coordinates are never
written. Where modifiers before ours move the skin, it also keeps what it was given, for the next update to read. The
modifier takes the rest cage and the posed cage as object inputs, which is what makes Blender evaluate them (and,
through a driver on the posed cage, every bone) when they are hidden.
"""

from __future__ import annotations

import bpy
import numpy as np

from .. import compat
from .positions import Points

NAME = "Cage Rig"
ATTRIBUTE = "cage_rig.posed"
INPUT = "cage_rig.input"
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


def node_group() -> bpy.types.NodeTree:
    """The shared node group, made on first use."""
    for group in bpy.data.node_groups:
        if group.get("cage_rig") and group.library is None:
            return group
    group = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    group["cage_rig"] = True
    group.is_modifier = True
    new = group.interface.new_socket
    new("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    new("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    new("Attribute", in_out="INPUT", socket_type="NodeSocketString")
    for name in ("Rest Cage", "Posed Cage"):
        new(name, in_out="INPUT", socket_type="NodeSocketObject")
    new("Keep Input", in_out="INPUT", socket_type="NodeSocketBool")
    nodes, links = group.nodes, group.links
    source, target = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    named, place = nodes.new("GeometryNodeInputNamedAttribute"), nodes.new("GeometryNodeSetPosition")
    named.data_type = "FLOAT_VECTOR"
    keep, store = nodes.new("GeometryNodeSwitch"), nodes.new("GeometryNodeStoreNamedAttribute")
    position = nodes.new("GeometryNodeInputPosition")
    keep.input_type, store.data_type, store.domain = "GEOMETRY", "FLOAT_VECTOR", "POINT"
    store.inputs["Name"].default_value = INPUT
    links.new(source.outputs["Geometry"], store.inputs["Geometry"])
    links.new(position.outputs["Position"], _socket(store.inputs, "Value"))
    links.new(source.outputs["Keep Input"], keep.inputs["Switch"])
    links.new(source.outputs["Geometry"], _socket(keep.inputs, "False"))
    links.new(store.outputs["Geometry"], _socket(keep.inputs, "True"))
    links.new(_socket(keep.outputs, "Output"), place.inputs["Geometry"])
    links.new(source.outputs["Attribute"], named.inputs["Name"])
    links.new(named.outputs["Exists"], place.inputs["Selection"])
    links.new(named.outputs["Attribute"], place.inputs["Position"])
    links.new(place.outputs["Geometry"], target.inputs["Geometry"])
    for column, node in enumerate((source, position, store, keep, named, place, target)):
        node.location = (column * 200, 0)
    return group


def _socket(sockets: bpy.types.bpy_prop_collection, name: str) -> bpy.types.NodeSocket:
    """The enabled socket of this name: a node keeps one for every data type."""
    return next(socket for socket in sockets if socket.name == name and socket.enabled)


def find(skin: bpy.types.Object) -> bpy.types.Modifier | None:
    """The skin's Cage Rig modifier, or None."""
    for modifier in skin.modifiers:
        if modifier.type == "NODES" and modifier.node_group and modifier.node_group.get("cage_rig"):
            return modifier
    return None


def input_object(modifier: bpy.types.Modifier, name: str) -> bpy.types.Object | None:
    """The object set in an input of our modifier ("Rest Cage" or "Posed Cage")."""
    return compat.modifier_input(modifier, _identifier(modifier.node_group, name))


def add(skin: bpy.types.Object, rest_cage: bpy.types.Object, posed_cage: bpy.types.Object, index: int) -> None:
    """Add our modifier to the skin at place `index` of its stack."""
    modifier = skin.modifiers.new(NAME, "NODES")
    modifier.node_group = node_group()
    modifier.show_in_editmode = False  # there the base mesh is edited, and the feed can't be written
    connect(modifier, rest_cage, posed_cage)
    skin.modifiers.move(len(skin.modifiers) - 1, index)


def connect(modifier: bpy.types.Modifier, rest_cage: bpy.types.Object, posed_cage: bpy.types.Object) -> None:
    """Set the inputs of our modifier."""
    values = {"Attribute": ATTRIBUTE, "Rest Cage": rest_cage, "Posed Cage": posed_cage}
    for name, value in values.items():
        compat.set_modifier_input(modifier, _identifier(modifier.node_group, name), value)


def _identifier(group: bpy.types.NodeTree, name: str) -> str:
    return next(
        item.identifier
        for item in group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.name == name
    )


def write(skin: bpy.types.Object, points: Points) -> None:
    """Feed posed coordinates (`#M by 3`, the skin's own space) to the modifier. Not in Edit Mode of the skin."""
    mesh = skin.data
    attribute = mesh.attributes.get(ATTRIBUTE)
    if attribute is None:
        attribute = mesh.attributes.new(ATTRIBUTE, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", np.ascontiguousarray(points, np.float32).ravel())
    mesh.update_tag()


def remove(skin: bpy.types.Object) -> None:
    """Take our modifier and its feed off the skin, and the node group when nothing uses it any more."""
    modifier = find(skin)
    if modifier is not None:
        group = modifier.node_group
        skin.modifiers.remove(modifier)
        if group.users == 0:
            bpy.data.node_groups.remove(group)
    if skin.data is not None and ATTRIBUTE in skin.data.attributes:
        skin.data.attributes.remove(skin.data.attributes[ATTRIBUTE])


def set_shown(skin: bpy.types.Object, shown: bool) -> None:
    """Show or hide our modifier, in viewport and render."""
    modifier = find(skin)
    if modifier is not None and (modifier.show_viewport, modifier.show_render) != (shown, shown):
        modifier.show_viewport = modifier.show_render = shown


def suspend_armature(obj: bpy.types.Object, armature: bpy.types.Object) -> None:
    """Switch off Armature modifiers of `armature`, which would deform twice, and remember how they were."""
    for modifier in obj.modifiers:
        if modifier.type == "ARMATURE" and modifier.object == armature:
            if modifier.name not in obj.cage_rig.suspended:
                record = obj.cage_rig.suspended.add()
                record.name = modifier.name
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


def preserves_volume(obj: bpy.types.Object, armature: bpy.types.Object) -> bool:
    """Whether the object's modifier of this armature has Preserve Volume on."""
    ours = [m for m in obj.modifiers if m.type == "ARMATURE" and m.object == armature]
    return bool(ours) and all(m.use_deform_preserve_volume for m in ours)


def show_suspended(obj: bpy.types.Object, shown: bool) -> None:
    """While a rig is paused its suspended modifiers do their work again (`shown`), as they were before the bind."""
    for record in obj.cage_rig.suspended:
        modifier = obj.modifiers.get(record.name)
        if modifier is not None:
            modifier.show_viewport = shown and record.show_viewport
            modifier.show_render = shown and record.show_render


def restore_suspended(obj: bpy.types.Object) -> None:
    """Put suspended modifiers back as they were, and forget them."""
    show_suspended(obj, True)
    obj.cage_rig.suspended.clear()


def place(skin: bpy.types.Object, armature: bpy.types.Object) -> int:
    """Where our modifier is in the skin's stack, or belongs: at the armature's modifier, else before all others."""
    ours = find(skin)
    if ours is not None:
        return list(skin.modifiers).index(ours)
    for index, modifier in enumerate(skin.modifiers):
        if modifier.type == "ARMATURE" and modifier.object == armature:
            return index
    return 0


def _shown_before(skin: bpy.types.Object, index: int) -> list[bpy.types.Modifier]:
    return [m for m in list(skin.modifiers)[:index] if (m.show_viewport or m.show_render) and m.type not in HARMLESS]


def blocking(skin: bpy.types.Object, index: int) -> str | None:
    """The name of a shown modifier before `index` that may add or remove vertices, or None."""
    return next((m.name for m in _shown_before(skin, index) if m.type not in DEFORMING), None)


def deformed_before(skin: bpy.types.Object) -> bool:
    """Whether shown modifiers before ours move the skin."""
    ours = find(skin)
    return ours is not None and bool(_shown_before(skin, list(skin.modifiers).index(ours)))


def reordering(skin: bpy.types.Object) -> str | None:
    """The name of a shown modifier after ours that may reorder vertices, where what ours is given has to be read."""
    if not deformed_before(skin):
        return None
    ours = list(skin.modifiers).index(find(skin))
    known = HARMLESS | DEFORMING | GROWING
    after = [m for m in list(skin.modifiers)[ours + 1 :] if m.show_viewport or m.show_render]
    return next((m.name for m in after if m.type not in known), None)


def keep_input(skin: bpy.types.Object, keep: bool) -> bool:
    """Let our modifier keep what it is given, or not; returns whether that was so already."""
    ours = find(skin)
    identifier = _identifier(ours.node_group, "Keep Input")
    if bool(compat.modifier_input(ours, identifier)) == keep:
        return True
    compat.set_modifier_input(ours, identifier, keep)
    skin.update_tag()
    return False


def read_input(skin: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Points | None:
    """What our modifier was given in `depsgraph`, `#M by 3`; None where modifiers after ours made it unreadable.

    They may add vertices after the first `#M` but not reorder those: the feed, which went with them, is the proof.
    """
    count = len(skin.data.vertices)
    mesh = skin.evaluated_get(depsgraph).data
    if INPUT not in mesh.attributes or len(mesh.vertices) < count:
        return None
    arrays = []
    for source, name in ((mesh, INPUT), (mesh, ATTRIBUTE), (skin.data, ATTRIBUTE)):
        points = np.empty((len(source.vertices), 3), np.float32)
        source.attributes[name].data.foreach_get("vector", points.ravel())
        arrays.append(points[:count])
    return arrays[0] if np.array_equal(arrays[1], arrays[2]) else None


def release(skin: bpy.types.Object) -> None:
    """Give a skin back as it was before the bind: our modifier and feed off, its Armature modifier on again."""
    remove(skin)
    restore_suspended(skin)
    skin.property_unset("cage_rig")
