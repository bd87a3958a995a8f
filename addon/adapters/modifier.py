# SPDX-License-Identifier: GPL-3.0-or-later
"""The "Cage Rig" Geometry Nodes modifiers on a skin, one for each of its rigs, and the feed.

Base coordinates are never written. Where a skin has several, the posed cage, an object input, says of which rig each
is. A single one does without: what is an input is evaluated before the skin, and both are written in every frame. Where
the skin can keep no driver (`dependence`) both cages are inputs, so that Blender evaluates them for the skin.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import compat
from . import positions
from .node_group import (
    ASKING,
    ATTRIBUTE,
    INDEX,
    INPUT,
    NAME,
    OURS,
    SOCKETS,
    complete,
    identifier,
    is_current,
    is_ours,
    is_plain,
    node_group,
)
from .positions import Points


def ours(skin: bpy.types.Object) -> list[bpy.types.Modifier]:
    """The skin's Cage Rig modifiers."""
    return [m for m in skin.modifiers if m.type == "NODES" and is_ours(m.node_group)]


def is_emptied(modifier: bpy.types.Modifier) -> bool:
    """Whether the node group of a modifier was deleted, so that it does nothing."""
    return modifier.type == "NODES" and modifier.node_group is None


def find(skin: bpy.types.Object, cage: bpy.types.Object) -> bpy.types.Modifier | None:
    """The skin's modifier of the rig of this cage, or None."""
    return next((modifier for modifier in ours(skin) if cage_of(modifier) == cage), None)


def cage_of(modifier: bpy.types.Modifier) -> bpy.types.Object | None:
    """The rest cage of the rig that the modifier is of; None for one of several whose posed cage was deleted."""
    posed, rest = read(modifier, "Posed Cage"), read(modifier, "Rest Cage")
    if posed is not None or rest is not None:
        return rest if posed is None else posed.cage_rig.owner
    skin = modifier.id_data
    named = [read(other, "Posed Cage") for other in ours(skin)]
    owner = skin.cage_rig.owner
    return None if owner is not None and owner.cage_rig.posed_cage in filter(None, named) else owner


def read(modifier: bpy.types.Modifier, name: str) -> Any:
    """The value of an input of our modifier; see `node_group.SOCKETS`. None where the group has no such input."""
    found = identifier(modifier.node_group, name)
    return None if found is None else compat.modifier_input(modifier, found)


def set_inputs(modifier: bpy.types.Modifier, values: dict[str, Any]) -> bool:
    """Set inputs of our modifier; returns whether they were so already."""
    changed = {name: value for name, value in values.items() if (read(modifier, name) or None) != (value or None)}
    for name, value in changed.items():
        compat.set_modifier_input(modifier, identifier(modifier.node_group, name), value)
    if changed:
        _choose_group(modifier)
        modifier.id_data.update_tag()
    return not changed


def _asks(modifier: bpy.types.Modifier) -> bool:
    """Whether more is asked of the modifier than to place vertices where an attribute says."""
    return any(read(modifier, name) for name in ASKING)


def _choose_group(modifier: bpy.types.Modifier) -> None:
    """Let a plain group do where it can. One of another file stays while it serves."""
    plain, group = not _asks(modifier), modifier.node_group
    if is_plain(group) == plain or not is_current(group) or (plain and group.library is not None):
        return
    values = {name: read(modifier, name) for name in SOCKETS}
    modifier.node_group = node_group(plain=plain)
    for name, value in values.items():
        if value is not None:
            compat.set_modifier_input(modifier, identifier(modifier.node_group, name), value)


def _name_rig(modifier: bpy.types.Modifier) -> None:
    """Let a modifier say itself of which rig it is."""
    cage = cage_of(modifier)
    if cage is not None:
        set_inputs(modifier, {"Posed Cage": cage.cage_rig.posed_cage})


def add(skin: bpy.types.Object, posed_cage: bpy.types.Object, index: int) -> None:
    """Add the modifier of a rig to the skin at place `index` of its stack, without a feed.

    It takes the place of one of ours whose node group or posed cage was deleted.
    """
    for other in ours(skin):
        _name_rig(other)
    nameless = [found for found in skin.modifiers if is_emptied(found) and found.name.startswith(NAME)]
    for emptied in nameless + [found for found in ours(skin) if cage_of(found) is None]:
        index -= list(skin.modifiers).index(emptied) < index
        skin.modifiers.remove(emptied)
    modifier = skin.modifiers.new(NAME, "NODES")
    modifier.node_group = node_group()
    modifier.show_in_editmode = False  # there the base mesh is edited, and the feed can't be written
    set_inputs(modifier, {"Posed Cage": posed_cage})
    skin.modifiers.move(len(skin.modifiers) - 1, index)


def renew(skin: bpy.types.Object) -> None:
    """Make the node groups of our modifiers whole where they lack inputs; the values that modifiers have stay.

    A group of another file stays as it is.
    """
    for modifier in ours(skin):
        group = modifier.node_group
        if group.library is None and group.override_library is None and not is_current(group):
            complete(group, plain=not _asks(modifier))
            modifier.show_in_editmode = False
        _choose_group(modifier)


def is_whole(skin: bpy.types.Object) -> bool:
    """Whether the node groups of our modifiers have all inputs."""
    return all(is_current(modifier.node_group) for modifier in ours(skin))


def lead(skin: bpy.types.Object, cage: bpy.types.Object) -> None:
    """Let the modifier of this rig, and no other, place the skin's vertices."""
    leader = find(skin, cage)
    for modifier in ours(skin):
        if modifier != leader:
            _hand_over(modifier, leader)
    set_inputs(leader, {"Attribute": ATTRIBUTE})


def _hand_over(modifier: bpy.types.Modifier, leader: bpy.types.Modifier) -> None:
    feed = read(modifier, "Feed")
    if feed is not None:
        set_inputs(leader, {"Use Feed": True, "Feed": feed})
    set_inputs(modifier, {"Attribute": "", "Use Feed": False, "Feed": None})


def write(skin: bpy.types.Object, points: Points) -> None:
    """Feed posed coordinates (`#M by 3`, the skin's own space) to the modifier. Not in Edit Mode of the skin."""
    mesh = skin.data
    if _is_linked(mesh) or _is_shared(mesh):
        positions.write_base(_own_feed(skin).data, points)
        return
    attribute = mesh.attributes.get(ATTRIBUTE)
    if attribute is None:
        attribute = mesh.attributes.new(ATTRIBUTE, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", points.reshape(-1))
    mesh.update_tag()


def take_own(skin: bpy.types.Object) -> bool:
    """Let the modifier take what is written to the skin's own mesh, where that was shared until now; returns whether
    it was so already.
    """
    if _is_linked(skin.data) or _is_shared(skin.data):
        return True
    return set_inputs(_leader(skin), {"Use Feed": False, "Feed": None})


def is_fed(skin: bpy.types.Object) -> bool:
    """Whether `write` has written to the skin, and nothing has taken that away."""
    if _is_linked(skin.data) or _is_shared(skin.data):
        return _feed(skin) is not None
    return ATTRIBUTE in skin.data.attributes


def read_fed(skin: bpy.types.Object) -> Points | None:
    """What was last fed to the skin, `#M by 3`; None where nothing was. Also after its modifier is gone."""
    feed = next((obj for obj in bpy.data.objects if obj.cage_rig.owner == skin and obj.type == "MESH"), None)
    if feed is not None:
        return positions.read_base(feed.data)
    attribute = skin.data.attributes.get(ATTRIBUTE)
    if attribute is None or (attribute.domain, attribute.data_type) != ("POINT", "FLOAT_VECTOR"):
        return None
    points = np.empty((len(skin.data.vertices), 3), np.float32)
    attribute.data.foreach_get("vector", points.ravel())
    return points


def _is_linked(mesh: bpy.types.Mesh) -> bool:
    """Whether what is written to the mesh is lost or does nothing."""
    return mesh.library is not None or mesh.override_library is not None


def _is_shared(mesh: bpy.types.Mesh) -> bool:
    """Whether other objects have the mesh too: linked duplicates (Alt D) are posed each by its own rig."""
    return mesh.users - mesh.use_fake_user > 1


def _leader(skin: bpy.types.Object) -> bpy.types.Modifier:
    return next(modifier for modifier in ours(skin) if read(modifier, "Attribute"))


def _feed(skin: bpy.types.Object) -> bpy.types.Object | None:
    """The feed object of this file that the skin takes."""
    leader = _leader(skin)
    feed = read(leader, "Feed") if read(leader, "Use Feed") else None
    if feed is None or feed.library is not None or len(feed.data.vertices) != len(skin.data.vertices):
        return None
    return feed if feed.cage_rig.owner in (None, skin) else None  # a duplicate has it from the first one


def _own_feed(skin: bpy.types.Object) -> bpy.types.Object:
    feed = _feed(skin)
    if feed is None:
        mesh = bpy.data.meshes.new(f"{skin.name} Result")
        mesh.vertices.add(len(skin.data.vertices))
        feed = bpy.data.objects.new(mesh.name, mesh)
        feed.cage_rig.owner = skin
        set_inputs(_leader(skin), {"Use Feed": True, "Feed": feed})
        feed.parent = None  # an input that is set does not make Blender look for new dependencies; this does
    return feed


def remove(skin: bpy.types.Object, cage: bpy.types.Object | None, *, removing: bool = True) -> None:
    """Take the modifier of a rig off the skin (None: all of ours), and what nothing uses any more.

    Without `removing` that stays until the file is saved: handlers must not remove what an update may still name.
    """
    for modifier in ours(skin):
        if cage is None or cage_of(modifier) in (cage, None):
            feed = read(modifier, "Feed")
            set_inputs(modifier, {"Feed": None})  # or Blender 5.2 goes on counting the modifier among its users
            skin.modifiers.remove(modifier)
            if removing and feed is not None and feed.users == 0 and feed.library is None:
                bpy.data.meshes.remove(feed.data)
    if not ours(skin) and skin.data is not None and not _is_linked(skin.data):
        # the feed, and where a modifier was applied what it kept
        for name in [found.name for found in skin.data.attributes if found.name.startswith(OURS)]:
            skin.data.attributes.remove(skin.data.attributes[name])
    for group in [found for found in bpy.data.node_groups if is_ours(found)] if removing else []:
        if group.users == 0 and group.library is None:
            bpy.data.node_groups.remove(group)


def set_shown(skin: bpy.types.Object, shown: bool) -> None:
    """Show or hide our modifiers, in viewport and render."""
    for modifier in ours(skin):
        if (modifier.show_viewport, modifier.show_render) != (shown, shown):
            modifier.show_viewport = modifier.show_render = shown


def is_shown(skin: bpy.types.Object) -> bool:
    """Whether our modifiers are at work."""
    return all(modifier.show_viewport for modifier in ours(skin))


def keep_input(skin: bpy.types.Object, keep: bool) -> bool:
    """Let our first modifier keep what it is given, or not. Returns whether that was so already: it can be read."""
    return set_inputs(ours(skin)[0], {"Keep Input": keep})


def keep_mask(skin: bpy.types.Object, cage: bpy.types.Object, group: str) -> bool:
    """Let the modifier of this rig keep a vertex group (empty: none). Returns whether that was so already."""
    values = {"Keep Mask": bool(group), "Mask": group, "Mask As": _mask_name(cage) if group else ""}
    return set_inputs(find(skin, cage), values)


def _mask_name(cage: bpy.types.Object) -> str:
    return f"{OURS}mask.{cage.cage_rig.bind_id[:8]}"


def read_input(skin: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Points | None:
    """What our first modifier was given in `depsgraph`, `#M by 3`; None where it can't be read."""
    return _read_kept(skin, depsgraph, INPUT, "vector", 3)


def read_mask(
    skin: bpy.types.Object, cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph
) -> NDArray[np.float32] | None:
    """The vertex group that the modifier of this rig kept in `depsgraph`, `#M`; None where it can't be read."""
    values = _read_kept(skin, depsgraph, _mask_name(cage), "value", 1)
    return None if values is None else values[:, 0]


def _read_kept(
    skin: bpy.types.Object, depsgraph: bpy.types.Depsgraph, name: str, kind: str, width: int
) -> NDArray[np.float32] | None:
    """None where modifiers after ours hide it: they may add vertices after the first `#M` but not reorder those."""
    count = len(skin.data.vertices)
    mesh = skin.evaluated_get(depsgraph).data
    if name not in mesh.attributes or len(mesh.vertices) < count:
        return None
    index = np.empty(len(mesh.vertices), np.float32)
    mesh.attributes[INDEX].data.foreach_get("value", index)
    if not np.array_equal(index[:count], np.arange(count, dtype=np.float32)):
        return None
    values = np.empty((len(mesh.vertices), width), np.float32)
    mesh.attributes[name].data.foreach_get(kind, values.ravel())
    return values[:count]
