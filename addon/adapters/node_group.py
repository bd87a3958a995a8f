# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geometry Nodes group behind the "Cage Rig" modifier.

It places vertices where the feed says: a point attribute of the mesh, or, where the mesh can't be written because it is
linked from another file, the vertices of a feed object. Without a feed it moves nothing. On request it keeps what it is
given (positions, a mask) as attributes of its result, for the next update to read. It takes cages as inputs: a posed
cage names its rig where a skin has several, and what is an input is evaluated, also where it is hidden.

Every node, and every geometry between two, takes time in every frame, also where it does nothing. So a modifier that is
asked for no more than to read an attribute has a plain group. That has all the inputs too, so that modifiers keep their
values when they change from one to the other.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

NAME = "Cage Rig"
OURS = "cage_rig."  # what the names of all our attributes of a skin begin with
ATTRIBUTE = f"{OURS}posed"
INPUT = f"{OURS}input"
POSITION = "position"  # Blender's; to store it takes less time than to set it, which adds an offset
INDEX = f"{OURS}index"  # kept beside the two: the proof that modifiers after ours reorder nothing

SOCKETS = {
    "Attribute": "NodeSocketString",
    "Use Feed": "NodeSocketBool",
    "Feed": "NodeSocketObject",
    "Rest Cage": "NodeSocketObject",
    "Posed Cage": "NodeSocketObject",
    "Keep Input": "NodeSocketBool",
    "Keep Mask": "NodeSocketBool",
    "Mask": "NodeSocketString",
    "Mask As": "NodeSocketString",
}
ASKING = ("Use Feed", "Keep Input", "Keep Mask")  # inputs that a plain group leaves alone
PLAIN = "cage_rig_plain"  # what marks a plain group


def is_ours(group: bpy.types.NodeTree | None) -> bool:
    """Whether this is a node group of a "Cage Rig" modifier."""
    return group is not None and bool(group.get("cage_rig"))


def is_plain(group: bpy.types.NodeTree) -> bool:
    """Whether a group of ours does no more than to place vertices where an attribute says."""
    return bool(group.get(PLAIN))


def node_group(*, plain: bool = True) -> bpy.types.NodeTree:
    """The shared node group of this file of either kind, made on first use."""
    for group in bpy.data.node_groups:
        if is_ours(group) and group.library is None and is_plain(group) == plain and is_current(group):
            return group
    group = bpy.data.node_groups.new(NAME if plain else f"{NAME} Full", "GeometryNodeTree")
    group["cage_rig"] = True
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    complete(group, plain=plain)
    return group


def complete(group: bpy.types.NodeTree, *, plain: bool) -> None:
    """Give a group of ours all its inputs, and the nodes of either kind. Those inputs that it has stay, with the values
    in modifiers.

    They have to: Blender crashes where a library override of a modifier finds another type behind an identifier.
    """
    group[PLAIN] = plain
    kinds = {name: kind for name, _, kind in _inputs(group)}
    for item in list(group.interface.items_tree):
        if item.name in SOCKETS and kinds.get(item.name) != SOCKETS[item.name]:
            group.interface.remove(item)
    for name, kind in SOCKETS.items():
        if kinds.get(name) != kind:
            group.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    group.nodes.clear()
    builder = _Builder(group)
    if plain:
        builder.build_plain()
    else:
        builder.build()


def is_current(group: bpy.types.NodeTree) -> bool:
    """Whether a group of ours has all inputs: an earlier Cage Rig made it with fewer, or somebody took some away."""
    return {name: kind for name, _, kind in _inputs(group) if name in SOCKETS} == SOCKETS


def identifier(group: bpy.types.NodeTree, name: str) -> str | None:
    """The identifier of an input of the group, by which a modifier holds its value; None where it has none."""
    return next((found for socket, found, _ in _inputs(group) if socket == name), None)


def _inputs(group: bpy.types.NodeTree) -> Iterator[tuple[str, str, str]]:
    """Name, identifier and type of each input."""
    for item in group.interface.items_tree:
        if item.item_type == "SOCKET" and item.in_out == "INPUT":
            yield item.name, item.identifier, item.socket_type


def _socket(sockets: bpy.types.bpy_prop_collection, name: str) -> bpy.types.NodeSocket:
    """The enabled socket of this name: a node keeps one for every data type."""
    return next(socket for socket in sockets if socket.name == name and socket.enabled)


class _Builder:
    """Adds nodes from left to right."""

    def __init__(self, group: bpy.types.NodeTree) -> None:
        self.group = group
        self.source = self.node("NodeGroupInput")

    def node(self, kind: str, **settings: str) -> bpy.types.Node:
        node = self.group.nodes.new(kind)
        node.location = (180 * (len(self.group.nodes) - 1), 0)
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def link(self, source: bpy.types.NodeSocket, node: bpy.types.Node, name: str) -> None:
        self.group.links.new(source, _socket(node.inputs, name))

    def given(self, name: str) -> bpy.types.NodeSocket:
        return self.source.outputs[name]

    def build_plain(self) -> None:
        self.link(self.by_attribute(self.given("Geometry")), self.node("NodeGroupOutput"), "Geometry")

    def build(self) -> None:
        index = self.node("GeometryNodeInputIndex").outputs["Index"]
        position = self.node("GeometryNodeInputPosition").outputs["Position"]
        mask = self.node("GeometryNodeInputNamedAttribute", data_type="FLOAT")
        self.link(self.given("Mask"), mask, "Name")
        geometry = self.given("Geometry")
        for switch, name, kind, value in (
            ("Keep Input", INPUT, "FLOAT_VECTOR", position),
            ("Keep Mask", self.given("Mask As"), "FLOAT", _socket(mask.outputs, "Attribute")),
        ):
            stored = self.stored(self.stored(geometry, name, kind, value), INDEX, "FLOAT", index)
            geometry = self.either(switch, geometry, stored)
        placed = self.either("Use Feed", self.by_attribute(geometry), self.by_feed(geometry, index, position))
        self.link(placed, self.node("NodeGroupOutput"), "Geometry")

    def stored(
        self, geometry: bpy.types.NodeSocket, name: str | bpy.types.NodeSocket, kind: str, value: bpy.types.NodeSocket
    ) -> bpy.types.NodeSocket:
        node = self.node("GeometryNodeStoreNamedAttribute", data_type=kind, domain="POINT")
        if isinstance(name, str):
            node.inputs["Name"].default_value = name
        else:
            self.link(name, node, "Name")
        self.link(geometry, node, "Geometry")
        self.link(value, node, "Value")
        return node.outputs["Geometry"]

    def either(self, switch: str, off: bpy.types.NodeSocket, on: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        node = self.node("GeometryNodeSwitch", input_type="GEOMETRY")
        self.link(self.given(switch), node, "Switch")
        self.link(off, node, "False")
        self.link(on, node, "True")
        return _socket(node.outputs, "Output")

    def by_attribute(self, geometry: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        named = self.node("GeometryNodeInputNamedAttribute", data_type="FLOAT_VECTOR")
        self.link(self.given("Attribute"), named, "Name")
        placed = self.stored(geometry, POSITION, "FLOAT_VECTOR", _socket(named.outputs, "Attribute"))
        self.link(named.outputs["Exists"], placed.node, "Selection")
        return placed

    def by_feed(
        self, geometry: bpy.types.NodeSocket, index: bpy.types.NodeSocket, position: bpy.types.NodeSocket
    ) -> bpy.types.NodeSocket:
        feed = self.node("GeometryNodeObjectInfo")
        self.link(self.given("Feed"), feed, "Object")
        sample = self.node("GeometryNodeSampleIndex", data_type="FLOAT_VECTOR", domain="POINT")
        self.link(feed.outputs["Geometry"], sample, "Geometry")
        self.link(position, sample, "Value")
        self.link(index, sample, "Index")
        return self.stored(geometry, POSITION, "FLOAT_VECTOR", _socket(sample.outputs, "Value"))
