# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rigs a file has and which of them an update touches: names and session uids, never objects.

The lists are a cache of what the .blend says. They are forgotten whenever objects may have come or gone, and read
again on the next question.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy

from . import layers
from .adapters import stack

Key = tuple[str, str | None]  # an object's name and the path of its library


@dataclass
class _Found:
    count: int = -1  # objects in the file when it was looked through
    names: dict[Key, int] = field(default_factory=dict)  # of rest cages -> their session uids
    participants: dict[int, set[int]] = field(default_factory=dict)  # session uid -> those of rest cages


_found = _Found()


def forget() -> None:
    """Look through the file again at the next question."""
    _found.count = -1


def rigs() -> list[bpy.types.Object]:
    """The rest cage objects of all rigs in the file, in the order in which they act."""
    if _found.count != len(bpy.data.objects):
        _look()
    return layers.bottom_up(_cages())


def key_of(obj: bpy.types.Object) -> Key:
    """By what an object is found again: a linked one may share its name with a local one."""
    return obj.name, obj.library.filepath if obj.library else None


def find(key: Key) -> bpy.types.Object | None:
    """The object of this key, or None."""
    return bpy.data.objects.get(key)


def _cages() -> list[bpy.types.Object]:
    found = []
    for key, uid in _found.names.items():
        cage = find(key)
        if cage is None or cage.session_uid != uid or not is_rig(cage):  # renamed, replaced or gone
            _look()
            return [bpy.data.objects[key] for key in _found.names]
        found.append(cage)
    return found


def is_rig(obj: bpy.types.Object) -> bool:
    """Whether the object is the rest cage of a rig."""
    return obj.cage_rig.state != "NONE"


def touched(depsgraph: bpy.types.Depsgraph) -> list[bpy.types.Object]:
    """The rigs of which a participant is among the updates of `depsgraph`. Runs on every update: must idle cheaply."""
    updated, unknown = _updated(depsgraph)  # first: to look may remove what is among them
    if unknown or _found.count != len(bpy.data.objects):
        _look()
    found = set().union(*(_found.participants.get(uid, set()) for uid in updated))
    return layers.bottom_up([cage for cage in _cages() if cage.session_uid in found]) if found else []


def _updated(depsgraph: bpy.types.Depsgraph) -> tuple[list[int], bool]:
    """Session uids of what was updated, and whether a rig is among it that was not found yet: it may have taken the
    place of another object.
    """
    uids, unknown = [], False
    for update in depsgraph.updates:
        changed = update.id.original
        uids.append(changed.session_uid)
        if isinstance(changed, bpy.types.Object) and uids[-1] not in _found.participants:
            unknown |= is_rig(changed)
    return uids, unknown


def participants(cage: bpy.types.Object) -> list[bpy.types.ID]:
    """Every datablock whose change can matter to the rig."""
    settings = cage.cage_rig
    objects = [cage, settings.armature, settings.posed_cage, *(skin.object for skin in settings.skins)]
    for lower in layers.below(cage):
        objects += [lower, lower.cage_rig.posed_cage]
    found: list[bpy.types.ID] = []
    for obj in objects:
        if obj is None:
            continue
        found += [obj, obj.data] if obj.data is not None else [obj]
        keys = getattr(obj.data, "shape_keys", None)
        if keys is not None:
            found.append(keys)
    return found


def _look() -> None:
    _found.count = len(bpy.data.objects)
    cages = [obj for obj in bpy.data.objects if is_rig(obj)]
    _found.names = {key_of(cage): cage.session_uid for cage in cages}
    _found.participants = {}
    _release_strays()
    for cage in cages:
        for datablock in participants(cage):
            _found.participants.setdefault(datablock.session_uid, set()).add(cage.session_uid)


def _release_strays() -> None:
    """Skins whose rig is gone, and copies of skins that no rig lists, go back to plain Blender skinning."""
    for obj in bpy.data.objects:
        mark = obj.cage_rig
        if mark.part == "SKIN" and not (mark.owner and any(skin.object == obj for skin in mark.owner.cage_rig.skins)):
            stack.release(obj, removing=False)
